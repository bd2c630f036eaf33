# SPDX-License-Identifier: Apache-2.0
"""Makes every kind of page that the program writes, small: each takes seconds at most.

`benchmark light` needs light that a path tracer computed; its page comes from the same function as those
of the other studies of one chart after the other (`derivatives`, `forward`, `moving`, `planner`, `vehicles`).
"""
import concurrent.futures
import os
import subprocess
import threading
from pathlib import Path

SCENES = Path(__file__).resolve().parents[2] / "scenes"
CAPTURES = SCENES / "captures"
WALL = SCENES / "tmf8828_wall.json"
DENALI = SCENES / "denali_like.json"
ROBOT = SCENES / "robot_drive.json"
MIRRORS = SCENES / "cheapspad_mirrors.json"
LIGHT = ["--light", "sensor"]

MAP = "type octile\nheight 4\nwidth 4\nmap\n....\n@@@.\n....\n....\n"
PROBLEMS = ("version 1\n0\tsmall.map\t4\t4\t0\t0\t0\t3\t8.41421356\n"
            "0\tsmall.map\t4\t4\t0\t0\t3\t0\t3.0\n")


def run(*arguments, accepted=(0,)):
    """Runs the program; 1 is accepted of a study whose claims so few captures may not bear out."""
    done = subprocess.run([os.environ["BLINDCORNER_PROGRAM"], *map(str, arguments)],
                          capture_output=True, text=True, timeout=300)
    if done.returncode not in accepted:
        raise RuntimeError(f"{' '.join(map(str, arguments))}: exit code {done.returncode}: {done.stderr}")


def study(folder, name, *arguments):
    run("benchmark", *arguments, "-o", folder, accepted=(0, 1))
    return folder / f"{name}.html"


def fit(folder):
    run("fit", WALL, CAPTURES / "tmf8828_wall.exr", "-o", folder)
    return folder / "result.html"


def track(folder):
    run("fit", SCENES / "person_vl53l8ch.json", CAPTURES / "person_walk.exr", "--track", "-o", folder)
    return folder / "result.html"


def evaluation(folder):
    track(folder)
    run("evaluate", folder / "result.json", "--resamples", 100)
    return folder / "evaluation.html"


def scene(folder):
    run("info", WALL, "-o", folder)
    return folder / "tmf8828_wall.html"


def init(folder):
    run("init", "--sensor", "street_lidar_8x8", "-o", folder / "scene.json")
    return folder / "scene.html"


def index(folder):
    fit(folder)
    run("evaluate", folder / "result.json", "--resamples", 10)
    return folder / "index.html"


def bound(folder):
    run("bound", WALL, "--grid", 5, "--test-poses", 20, "-o", folder)
    return folder / "bound.html"


def stability(folder):
    run("stability", "--rows", "pulse_of_0.01,one_bin", "-o", folder)
    return folder / "stability.html"


def drive(folder):
    run("drive", ROBOT, "--perception", "oracle", "--seed", 2, "-o", folder)
    return folder / "drive.html"


def side_by_side(folder):
    run("drive", ROBOT, "--perception", "los,oracle", "--seed", 2, "-o", folder)
    return folder / "drive.html"


def trials(folder):
    run("trials", ROBOT, "--perception", "los,oracle", "-n", 3, "--pairs", 2, "--replays", 1, "-o", folder)
    return folder / "trials.html"


def plan(folder):
    (folder / "small.map").write_text(MAP)
    run("plan", folder / "small.map", "--start", "0.5,3.5", "--goal", "0.5,0.5", "-o", folder)
    return folder / "path.html"


def planner(folder):
    (folder / "small.map").write_text(MAP)
    (folder / "small.scen").write_text(PROBLEMS)
    return study(folder, "planner", "planner", "--map", folder / "small.map", "--scenario",
                 folder / "small.scen")


def compare(folder):
    run("compare", WALL, "-n", 2, "--conditions", "trained", "--objects", 4, "--sensors", 1, "-o", folder)
    return folder / "comparison.html"


def coverage(folder):
    return study(folder, "coverage", "coverage", DENALI, "-n", 4, *LIGHT, "--photons", 300,
                 "--wrong-assumptions", "--wrong-captures", 2)


def detection(folder):
    return study(folder, "detection", "detection", DENALI, "-n", 4, "--empty", 16, *LIGHT, "--photons",
                 "30,300", "--calibrated-on", 16)


def sweep(folder):
    return study(folder, "sweep", "solver", "--sweep", DENALI, "-n", 3, *LIGHT, "--photons", 1000,
                 "--settings", "quick")


def moving(folder):
    return study(folder, "moving", "moving", DENALI, "--objects", 1, "--photons", 500, "--frames", 3,
                 "--truth", 0.2, "--endurance", 3, "--exhaustive-every", 1, "--max-poses", 60)


def vehicles(folder):
    return study(folder, "vehicles", "vehicles", "--vehicle", "robot")


def forward(folder):
    return study(folder, "forward", "forward", DENALI, "--poses", 1, "--truth", 0.2, "--slowest-ms", 0.02)


def derivatives(folder):
    return study(folder, "derivatives", "derivatives", DENALI, "--poses", 1)


def mirrors(folder, count):
    run("render", MIRRORS, "--random", count, "--model", "fast", "-o", folder / "captures.exr")
    return folder / "captures.exr"


def calibration(folder):
    run("calibrate", MIRRORS, mirrors(folder, 12), "--no-assignments", "--no-variance-scale", "-o",
        folder / "instrument.json")
    return folder / "instrument.html"


def crossvalidation(folder):
    run("crossvalidate", MIRRORS, mirrors(folder, 16), "--schemes", "folds", "--folds", 2,
        "--importance-samples", 0, "-o", folder)
    return folder / "evaluation.html"


def training(folder):
    data = folder / "data"
    run("cnn", "dataset", WALL, "--objects", 9, "--sensors", 2, "-o", data)
    run("cnn", "train", WALL, data, "--epochs", 3, "-o", folder)
    return folder / "training.html"


def network(folder):
    page = training(folder)
    run("cnn", "evaluate", WALL, page.with_name("weights.pt"), folder / "data", "-o", folder / "errors")
    return folder / "errors" / "evaluation.html"


WITH_LIBTORCH = {"training": training, "network": network}
MAKERS = {maker.__name__: maker for maker in (
    fit, scene, init, index, bound, stability, drive, side_by_side, trials, plan, planner, compare,
    derivatives, vehicles, track, evaluation, calibration, crossvalidation, coverage, detection, sweep,
    moving, forward)}
MAKERS.update(WITH_LIBTORCH)


class Gallery:
    """All pages, made in the background from the start; a page that is asked for is waited for."""

    def __init__(self, folder):
        self._pool = concurrent.futures.ThreadPoolExecutor(max(1, os.cpu_count() or 1))
        self._pages = {}
        for name, maker in MAKERS.items():
            (folder / name).mkdir()
            self._pages[name] = self._pool.submit(maker, folder / name)

    def __getitem__(self, name):
        return self._pages[name].result()

    def close(self):
        self._pool.shutdown(cancel_futures=True)


class Live:
    """`live` with a bundled recording that is played over and over, as a sensor would send it."""

    def __init__(self, folder):
        program = os.environ["BLINDCORNER_PROGRAM"]
        self.answers = folder / "answers.jsonl"
        self._player = subprocess.Popen(
            [program, "replay", CAPTURES / "person_walk.exr", "--loop", "--listen", "tcp://127.0.0.1:0"],
            stdout=subprocess.PIPE, text=True)
        with open(self.answers, "w", encoding="utf-8") as answers:
            self._live = subprocess.Popen(
                [program, "live", SCENES / "person_vl53l8ch.json", "--input",
                 self._player.stdout.readline().strip(), "--port", "0"],
                stdout=answers, stderr=subprocess.PIPE, text=True)
        self.url = next(line.split("page: ")[1].strip() for line in self._live.stderr if "page: " in line)
        self._drain = threading.Thread(target=self._live.stderr.read, daemon=True)
        self._drain.start()

    def close(self):
        for process in (self._live, self._player):
            process.terminate()
            process.wait(timeout=20)
