# SPDX-License-Identifier: Apache-2.0
"""Trials on many machines."""

from __future__ import annotations

import csv
import os
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

from .. import _core
from .._core import Error
from .._drive import Drive
from .._scene import PathLike
from ._run import Client, limit_threads, run_chunks

#: Time between writings of the tables while trials go on, s.
TABLE_INTERVAL = 5.0
#: Trials of a task unless another number is stated. A drive takes seconds.
CHUNK = 4

#: drive, trials, perceptions, seed, error trials, light, weights. A study is made from these.
Request = tuple[str, int, tuple[str, ...], int, int, float, tuple[str, ...]]


@dataclass(frozen=True)
class TrialSummary:
    """What a directory holds after a run: ``reached[perception, zone]`` of ``trials[perception,
    zone]`` drives reached the goal, zones as "6-7" m/s."""

    directory: str
    reached: dict[tuple[str, str], int] = field(default_factory=dict)
    trials: dict[tuple[str, str], int] = field(default_factory=dict)

    def __repr__(self) -> str:
        lines = [f"Trials in {self.directory}"]
        for (perception, zone), number in self.trials.items():
            reached = self.reached.get((perception, zone), 0)
            lines.append(f"  {perception:<8} {zone:>8} m/s  {reached}/{number} = {reached / number:.3f}")
        return "\n".join(lines)


def summary_of(directory: PathLike) -> TrialSummary:
    summary = TrialSummary(os.fspath(directory))
    with open(Path(directory) / "trials.csv", newline="", encoding="utf-8") as file:
        for row in csv.DictReader(file):
            key = (row["perception"], row["zone"])
            summary.trials[key] = summary.trials.get(key, 0) + 1
            summary.reached[key] = summary.reached.get(key, 0) + (row["outcome"] == "reached")
    return summary


@lru_cache(maxsize=2)
def _runner(request: Request) -> _core.TrialRunner:
    drive, number, perceptions, seed, error_trials, light, weights = request
    return _core.TrialRunner.make(drive, number, list(perceptions), seed, error_trials, light,
                                  list(weights))


def run_chunk(pid: int, request: Request, study: str, trials: list[Any]) -> list[str]:
    """Runs in a worker. Returns lines of the journal. Raises Error if the worker sees other files
    than the process that asks."""
    limit_threads(pid)
    runner = _runner(request)
    if runner.study != study:
        _runner.cache_clear()
        raise Error(f"{request[0]}: a worker sees another drive or scene file than the process that "
                    "asks, accepted: the same files on all machines")
    return [runner.run(trial) for trial in trials]


def trials(
    drive: Drive | PathLike,
    n: int,
    client: Client,
    directory: PathLike,
    *,
    perceptions: Sequence[str] = ("los", "solver", "oracle"),
    seed: int = 1,
    error_trials: int = 0,
    light: float = 0.0,
    weights: Sequence[PathLike] = (),
    replays: int = 4,
    chunk: int = CHUNK,
    progress: bool = True,
) -> TrialSummary:
    """``n`` drives of each perception, as ``blindcorner trials DRIVE -n N -o DIRECTORY``: the same
    trials.csv, errors.csv and pages, whatever the number of workers and their order.

    All machines have to see the drive file, its scene and the weights under the same path. A
    finished trial counts only once it is in ``directory/journal.csv``, so that the same call goes
    on after any failure; a larger ``n`` adds trials. ``chunk``: trials of a task. ``light``: factor
    on the laser's light, 0: the drive file's. ``replays``: number of failed trials of each
    perception that get a page. ``progress``: tell the dashboard's address, the rate and the time
    left on standard error. Raises Error.
    """
    path = drive.path if isinstance(drive, Drive) else os.fspath(drive)
    if isinstance(drive, Drive) and not light:
        light = drive.light
    if chunk < 1:
        raise Error(f"chunk: found {chunk}, accepted: a number of trials, 1 or more")
    request: Request = (os.path.abspath(path), n, tuple(perceptions), seed, error_trials, light,
                        tuple(os.path.abspath(w) for w in weights))
    study = _core.TrialStudy.open(os.fspath(directory), request[0], n, list(perceptions), seed,
                                  error_trials, light, list(request[6]))
    written = time.monotonic()

    def keep(lines: list[str]) -> int:
        nonlocal written
        for line in lines:
            study.add(line)
        if time.monotonic() - written > TABLE_INTERVAL:
            study.write_tables()
            written = time.monotonic()
        return len(lines)

    run_chunks(client, study.open_trials, chunk, run_chunk, (os.getpid(), request, study.study), keep,
               "trials", progress)
    study.finish(replays)
    _core.write_index(os.fspath(directory))
    return summary_of(directory)
