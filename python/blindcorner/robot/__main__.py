# SPDX-License-Identifier: Apache-2.0
"""python -m blindcorner.robot drive|result|live INPUT [--foxglove FILE] [--ros2 DIR] [--serve]"""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import math
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from .. import Drive, Error, Scene, drive
from . import (Foxglove, LiveAnswers, Moment, Naming, RosBag, Setting, of_drive_document, of_results,
               of_run, read_document, write_commonroad)

LOCALHOST = "127.0.0.1"


@contextlib.contextmanager
def whole(path: str) -> Iterator[Path]:
    """Gives a place of the same name in a directory beside ``path``. What was written there becomes
    ``path`` at the end; after an error, nothing is left of it."""
    folder = Path(path).absolute().parent
    try:
        folder.mkdir(parents=True, exist_ok=True)
        beside = Path(tempfile.mkdtemp(prefix=".blindcorner_", dir=folder))
    except OSError as error:
        raise Error(f"{folder}: {error.strerror}") from None
    try:
        place = beside / Path(path).name
        yield place
        for made in sorted(beside.iterdir()):
            os.replace(made, folder / made.name)
    except OSError as error:
        raise Error(f"{path}: {error.strerror}") from None
    finally:
        shutil.rmtree(beside, ignore_errors=True)


def refuse_bag(path: str) -> None:
    """Raises Error if ``path`` exists: a bag is a directory, and is not written over."""
    if Path(path).exists():
        raise Error(f"{path}: is there already, accepted: a new directory")


def naming_of(arguments: argparse.Namespace, start_s: float) -> Naming:
    if not math.isfinite(start_s):
        raise Error(f"--start: found {start_s}, accepted: 0 to 2147483647")
    naming = Naming(arguments.prefix, arguments.map_frame, arguments.base_frame,
                    arguments.sensor_frame, round(start_s * 1e9), arguments.least_presence)
    naming.validate()
    return naming


# --- Drives and results -----------------------------------------------------------------------------


def drive_of(arguments: argparse.Namespace) -> tuple[Setting, list[Moment]]:
    """Setting and moments of a drive file, which is driven, or of a ``drive.json``."""
    place = Path(arguments.input)
    if place.is_dir():
        place = place / "drive.json"
    document = read_document(place)
    if "format" not in document:
        run = drive(Drive.load(place), perception=arguments.perception or "", seed=arguments.seed)
        print(run, file=sys.stderr)
        return of_run(run)
    if document["format"] != "blindcorner.drive/1":
        raise Error(f'{place}: format: found "{document["format"]}", accepted: "blindcorner.drive/1", '
                    "or a drive file")
    return of_drive_document(document, str(place),
                             Drive.load(arguments.drive) if arguments.drive else None)


def results_of(arguments: argparse.Namespace) -> tuple[Setting, list[Moment]]:
    place = Path(arguments.input)
    if place.is_dir():
        place = place / "result.json"
    document = read_document(place)
    if document.get("format") != "blindcorner.result/1":
        raise Error(f'{place}: format: accepted: "blindcorner.result/1"')
    return of_results(document, str(place), scene_of(arguments), arguments.cell)


def scene_of(arguments: argparse.Namespace) -> Scene | None:
    return Scene.load(arguments.scene) if arguments.scene else None


def write_files(arguments: argparse.Namespace, setting: Setting, moments: Sequence[Moment]) -> None:
    """The files that were asked for, each whole or not at all."""
    naming = naming_of(arguments, arguments.start)
    if arguments.ros2:
        refuse_bag(arguments.ros2)
        with whole(arguments.ros2) as place, RosBag(place, setting, naming, arguments.storage) as bag:
            for moment in moments:
                bag.add(moment)
    if arguments.foxglove:
        with whole(arguments.foxglove) as place, Foxglove(setting, naming, file=place) as out:
            for moment in moments:
                out.add(moment)
    if getattr(arguments, "commonroad", None):
        with whole(arguments.commonroad) as place:
            write_commonroad(place, setting, moments)


def play(arguments: argparse.Namespace, setting: Setting, moments: Sequence[Moment]) -> None:
    """Serves the moments at their pace, again and again with ``--loop``."""
    naming = naming_of(arguments, arguments.start)
    with Foxglove(setting, naming, host=arguments.host, port=arguments.port) as out:
        tell_server(arguments, out)
        while True:
            # Viewers of a stream expect the wall clock.
            out.naming = dataclasses.replace(naming, start_ns=time.time_ns())
            begin, first = time.monotonic(), moments[0].time_s
            for moment in moments:
                wait = (moment.time_s - first) / arguments.pace - (time.monotonic() - begin)
                time.sleep(max(0.0, wait))
                out.add(moment)
            if not arguments.loop:
                return


def tell_server(arguments: argparse.Namespace, out: Foxglove) -> None:
    print(f"Foxglove: ws://{arguments.host}:{out.port}", file=sys.stderr, flush=True)
    if arguments.host not in (LOCALHOST, "localhost", "::1"):
        print(f"whoever reaches {arguments.host}:{out.port} can read the answers", file=sys.stderr)


def recorded(arguments: argparse.Namespace, setting: Setting, moments: list[Moment]) -> int:
    if not (arguments.ros2 or arguments.foxglove or arguments.serve
            or getattr(arguments, "commonroad", None)):
        raise Error("found nothing to write, accepted: --foxglove, --ros2, --serve"
                    + (", --commonroad" if arguments.command == "drive" else ""))
    if not moments:
        raise Error(f"{arguments.input}: found no frames, accepted: one or more")
    write_files(arguments, setting, moments)
    if arguments.serve:
        play(arguments, setting, moments)
    return 0


# --- Live -------------------------------------------------------------------------------------------


@contextlib.contextmanager
def live_lines(arguments: argparse.Namespace) -> Iterator[tuple[Iterable[str], str]]:
    """Lines of a program that is started, of a file, or of standard input, and the name of their
    source."""
    if arguments.program:
        try:
            child = subprocess.Popen(arguments.program, stdout=subprocess.PIPE, text=True)
        except OSError as error:
            raise Error(f"{arguments.program[0]}: {error.strerror}") from None
        try:
            assert child.stdout is not None
            yield child.stdout, arguments.program[0]
        finally:
            child.terminate()
            child.wait()
    elif arguments.input == "-":
        yield sys.stdin, "standard input"
    else:
        try:
            file = open(arguments.input, encoding="utf-8")
        except OSError as error:
            raise Error(f"{arguments.input}: {error.strerror}") from None
        with file:
            yield file, arguments.input


def live(arguments: argparse.Namespace) -> int:
    """Publishes each answer as it arrives. Files hold the answers that came before the end or
    Ctrl-C."""
    if not (arguments.serve or arguments.foxglove or arguments.ros2):
        raise Error("found nothing to write, accepted: --serve, --foxglove, --ros2")
    if arguments.ros2:
        refuse_bag(arguments.ros2)
    with live_lines(arguments) as (lines, place), contextlib.ExitStack() as stack:
        answers = LiveAnswers(lines, place, scene_of(arguments), arguments.cell)
        # Viewers of a stream expect the wall clock.
        naming = naming_of(arguments, arguments.start or time.time())
        outs: list[Foxglove | RosBag] = []
        if arguments.serve or arguments.foxglove:
            viewed = Foxglove(answers.setting, naming, file=arguments.foxglove or None,
                              host=arguments.host if arguments.serve else None, port=arguments.port)
            outs.append(stack.enter_context(viewed))
            if arguments.serve:
                tell_server(arguments, viewed)
        if arguments.ros2:
            outs.append(stack.enter_context(
                RosBag(arguments.ros2, answers.setting, naming, arguments.storage)))
        for moment in answers:
            for out in outs:
                out.add(moment)
    if answers.bad_lines:
        print(f"blindcorner: {answers.first_bad}; lines left out: {answers.bad_lines}", file=sys.stderr)
    return 1 if answers.bad_lines else 0


# --- Arguments --------------------------------------------------------------------------------------


def positive(text: str) -> float:
    value = float(text)
    if not (value > 0 and math.isfinite(value)):
        raise argparse.ArgumentTypeError(f"found {text}, accepted: above 0")
    return value


def port_number(text: str) -> int:
    value = int(text)
    if not 0 <= value < 65536:
        raise argparse.ArgumentTypeError(f"found {text}, accepted: 0 to 65535")
    return value


def add_outputs(command: argparse.ArgumentParser) -> None:
    out = command.add_argument_group("what comes of it")
    out.add_argument("--foxglove", metavar="FILE.mcap", help="a file that Foxglove opens")
    out.add_argument("--ros2", metavar="DIR", help="a rosbag2 directory with ROS 2 messages")
    out.add_argument("--storage", default="mcap", choices=("mcap", "sqlite3"), help="of the bag")
    out.add_argument("--serve", action="store_true", help="a WebSocket server for Foxglove")
    out.add_argument("--host", default=LOCALHOST, help="where it listens (127.0.0.1: this machine only)")
    out.add_argument("--port", type=port_number, default=8765, help="0: any that is free")
    names = command.add_argument_group("names and times")
    names.add_argument("--prefix", default="blindcorner", help="of topics")
    names.add_argument("--map-frame", default="map", metavar="NAME")
    names.add_argument("--base-frame", default="base_link", metavar="NAME")
    names.add_argument("--sensor-frame", default="blindcorner_sensor", metavar="NAME")
    names.add_argument("--start", type=float, default=0.0, metavar="S",
                       help="time of the first moment, s since 1970 (recorded: 0; live: now)")
    names.add_argument("--least-presence", type=float, default=0.5, metavar="P",
                       help="poses are published from this probability of presence on (0.5)")


def add_pace(command: argparse.ArgumentParser) -> None:
    command.add_argument("--pace", type=positive, default=1.0, metavar="F",
                         help="--serve: so many times as fast as it was (1)")
    command.add_argument("--loop", action="store_true", help="--serve: again and again, until Ctrl-C")


def parser() -> argparse.ArgumentParser:
    top = argparse.ArgumentParser(prog="python -m blindcorner.robot", description=(
        "Answers and drives for Foxglove, ROS 2 and CommonRoad (docs/robot.md)."))
    commands = top.add_subparsers(dest="command", required=True)
    command = commands.add_parser("drive", help="a drive file, which is driven, or a drive.json")
    command.add_argument("input", metavar="DRIVE", help="drive file, drive.json, or its directory")
    command.add_argument("--drive", metavar="FILE", help="drive file of a drive.json (default: the "
                         "bundled one of its name)")
    command.add_argument("--perception", metavar="NAME", help="of a drive file: los, solver, oracle, ...")
    command.add_argument("--seed", type=int, default=1, help="of a drive file")
    command.add_argument("--commonroad", metavar="FILE.xml",
                         help="a scenario, and FILE.solution.xml with the trajectory")
    add_pace(command)
    add_outputs(command)
    command = commands.add_parser("result", help="a result.json, as fit --track writes it")
    command.add_argument("input", metavar="RESULT", help="result.json, or its directory")
    add_scene(command)
    add_pace(command)
    add_outputs(command)
    command = commands.add_parser("live", help="answers of blindcorner live, as they arrive")
    command.add_argument("input", metavar="INPUT", nargs="?", default="-", help="file; -: standard input")
    add_scene(command)
    add_outputs(command)
    command.epilog = "After -- may stand a program and its arguments, whose output is read instead."
    return top


def add_scene(command: argparse.ArgumentParser) -> None:
    command.add_argument("--scene", metavar="FILE", help="scene file (default: the one it names)")
    command.add_argument("--cell", type=positive, metavar="M", help="edge of the grid's cells, m")


def run(arguments: argparse.Namespace) -> int:
    if arguments.command == "live":
        return live(arguments)
    source = drive_of if arguments.command == "drive" else results_of
    return recorded(arguments, *source(arguments))


def main(argv: Sequence[str] | None = None) -> int:
    words = list(sys.argv[1:] if argv is None else argv)
    program: list[str] = []
    if "--" in words:
        place = words.index("--")
        words, program = words[:place], words[place + 1:]
    top = parser()
    arguments = top.parse_args(words)
    arguments.program = program
    if program and arguments.command != "live":
        top.error("a program after -- is for live only")
    try:
        return run(arguments)
    except Error as error:
        print(f"blindcorner: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        kept = "; files hold what came until then" if arguments.command == "live" else ""
        print(f"blindcorner: interrupted{kept}", file=sys.stderr)
        return 1


if __name__ == "__main__":
    sys.exit(main())
