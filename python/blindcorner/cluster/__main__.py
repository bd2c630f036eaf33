# SPDX-License-Identifier: Apache-2.0
"""python -m blindcorner.cluster trials DRIVE -n N -o DIR [--workers N | --scheduler ADDRESS | --slurm KEY=VALUE,...]"""

from __future__ import annotations

import argparse
import contextlib
import os
import sys
from collections.abc import Iterator
from typing import Any

from .. import Captures, Error, Scene, load_captures
from . import fit, trials
from ._run import Client


def slurm_options(text: str) -> dict[str, str]:
    """KEY=VALUE pairs for dask_jobqueue.SLURMCluster: partition (its `queue`), cores, memory,
    walltime, jobs, account, interface, log_directory."""
    options = {}
    for pair in text.split(","):
        key, equals, value = pair.partition("=")
        accepted = ("partition", "cores", "memory", "walltime", "jobs", "account", "interface",
                    "log_directory")
        if not equals or key not in accepted:
            raise Error(f'--slurm: found "{pair}", accepted: {", ".join(accepted)}, each with =VALUE')
        options[key] = value
    return options


def whole_number(name: str, text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise Error(f'--slurm: {name}: found "{text}", accepted: a whole number, 1 or more')
    return int(text)


@contextlib.contextmanager
def client_of(arguments: argparse.Namespace) -> Iterator[Client]:
    """A client of what the arguments name: a scheduler that runs, Slurm jobs, or local processes."""
    if arguments.scheduler:
        try:
            client = Client(arguments.scheduler, timeout=30)
        except OSError as error:
            raise Error(f"--scheduler: {arguments.scheduler} does not answer ({error})") from None
        with client:
            client.wait_for_workers(1)
            yield client
        return
    if arguments.slurm:
        options: dict[str, Any] = dict(slurm_options(arguments.slurm))
        jobs, cores = (whole_number(name, options.pop(name, "1")) for name in ("jobs", "cores"))
        try:
            from dask_jobqueue import SLURMCluster
        except ImportError:
            raise Error('--slurm: needs dask-jobqueue: pip install "blindcorner[slurm]"') from None
        with SLURMCluster(
            queue=options.pop("partition", None), cores=cores, processes=cores,
            memory=options.pop("memory", f"{2 * cores} GB"), python=sys.executable, **options,
        ) as cluster:
            cluster.scale(jobs=jobs)
            with Client(cluster) as client:
                client.wait_for_workers(1)
                yield client
        return
    from distributed import LocalCluster

    # A process for each worker, with one thread: two drives on a thread each waste less time than
    # one drive on two threads.
    with LocalCluster(n_workers=arguments.workers, threads_per_worker=1,
                      dashboard_address=":0") as cluster, Client(cluster) as client:
        yield client


def add_where(command: argparse.ArgumentParser) -> None:
    where = command.add_mutually_exclusive_group()
    where.add_argument("--workers", type=int, default=os.cpu_count() or 1, metavar="N",
                       help="worker processes on this machine; default: one per processor")
    where.add_argument("--scheduler", metavar="ADDRESS", help="of a Dask scheduler, tcp://host:8786")
    where.add_argument("--slurm", metavar="KEY=VALUE,...",
                       help="workers as Slurm jobs: partition=, cores=, memory=, walltime=, jobs=")
    command.add_argument("-o", "--output", required=True, metavar="DIR",
                         help="directory for the results; made if missing")
    command.add_argument("--seed", type=int, default=1)
    command.add_argument("--chunk", type=int, metavar="N", help="trials or captures of a task")


def parser() -> argparse.ArgumentParser:
    top = argparse.ArgumentParser(prog="python -m blindcorner.cluster", description=(
        "Trials and fits on more than one machine, by Dask. The same command goes on where it was "
        "interrupted."))
    commands = top.add_subparsers(dest="command", required=True)
    command = commands.add_parser("trials", help="many drives; writes DIR/trials.csv and trials.html")
    command.add_argument("drive", metavar="DRIVE", help="drive file")
    command.add_argument("-n", "--trials", type=int, default=120, metavar="N",
                         help="trials of each perception")
    command.add_argument("--perception", default="los,solver,oracle", metavar="NAME,...")
    command.add_argument("--error-trials", type=int, default=0, metavar="N")
    command.add_argument("--light", type=float, default=0.0, metavar="FACTOR")
    command.add_argument("--weights", action="append", default=[], metavar="FILE")
    command.add_argument("--replays", type=int, default=4, metavar="N")
    add_where(command)
    command = commands.add_parser("fit", help="each capture by itself; writes DIR/result.json")
    command.add_argument("scene", metavar="SCENE", help="scene file")
    command.add_argument("captures", metavar="CAPTURE", help="capture file")
    command.add_argument("--instrument", metavar="FILE")
    add_where(command)
    return top


def run(arguments: argparse.Namespace) -> int:
    if arguments.workers < 1:
        raise Error(f"--workers: found {arguments.workers}, accepted: 1 or more")
    if arguments.command == "trials":
        with client_of(arguments) as client:
            summary = trials(
                arguments.drive, arguments.trials, client, arguments.output,
                perceptions=arguments.perception.split(","), seed=arguments.seed,
                error_trials=arguments.error_trials, light=arguments.light,
                weights=arguments.weights, replays=arguments.replays,
                **({"chunk": arguments.chunk} if arguments.chunk else {}),
            )
        print(summary)
        return 0
    scene = Scene.load(arguments.scene, arguments.instrument)
    captures: Captures = load_captures(arguments.captures)
    with client_of(arguments) as client:
        results = fit(scene, captures, client, arguments.output, chunk=arguments.chunk or 0,
                      seed=arguments.seed)
    print(repr(results))
    return 1 if any(result.error for result in results) else 0


def main() -> int:
    arguments = parser().parse_args()
    try:
        return run(arguments)
    except Error as error:
        print(f"blindcorner: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("blindcorner: interrupted; the same command goes on from the journal", file=sys.stderr)
        return 1


if __name__ == "__main__":
    sys.exit(main())
