# SPDX-License-Identifier: Apache-2.0
"""Fits on many machines."""

from __future__ import annotations

import csv
import fcntl
import hashlib
import io
import json
import os
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from .. import _core
from .._captures import Captures
from .._core import Error, OutputError
from .._fit import Fitter, fit_options
from .._result import Result, Results
from .._scene import PathLike, Scene
from ._run import Client, limit_threads, run_chunks

_fitters: dict[str, Fitter] = {}


def run_chunk(pid: int, key: str, scene: Scene, suited: _core.Suited, options: dict[str, Any],
              chunk: list[tuple[int, Captures]]) -> list[tuple[int, str]]:
    """Runs in a worker. Returns the captures' entries of result.json."""
    limit_threads(pid)
    fitter = _fitters.get(key)
    if fitter is None:
        _fitters.clear()  # a fitter holds what it compiled: some hundred MB
        fitter = _fitters[key] = Fitter._suited(scene, suited, options)
    entries = []
    for place, capture in chunk:
        fit = fitter._core.fit_each(*capture._arrays(), None)[0]
        entries.append((place, fit.text))
    return entries


class Journal:
    """Finished captures of a directory, a line each (``captures.jsonl``). ``fit.json`` says which
    fits they belong to.

    A chunk is on disk before the next one is written; a torn last line is dropped. Only one process
    at a time may use a journal. Without a directory, everything is kept in memory.
    """

    def __init__(self, directory: Path | None, study: dict[str, Any]) -> None:
        self.entries: dict[int, str] = {}
        self._descriptor: int | None = None
        self._path = directory / "captures.jsonl" if directory else None
        if directory is None or self._path is None:
            return
        try:
            directory.mkdir(parents=True, exist_ok=True)
            self._descriptor = os.open(self._path, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o666)
        except OSError as error:
            raise OutputError(f"{self._path}: cannot be written: {error.strerror}") from None
        try:
            try:
                fcntl.flock(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                raise Error(f"{self._path}: another run works on these fits") from None
            self._check(directory / "fit.json", study)
            self._read()
        except BaseException:
            self.close()
            raise

    @staticmethod
    def _check(path: Path, study: dict[str, Any]) -> None:
        text = json.dumps(study, indent=1, sort_keys=True) + "\n"
        if not path.exists():
            _core.write_atomically(os.fspath(path), text)
            return
        try:
            there = json.loads(path.read_text(encoding="utf-8"))
        except ValueError:
            there = {}
        different = [k for k in study if not isinstance(there, dict) or there.get(k) != study[k]]
        if different:
            raise Error(f"{path}: holds other fits ({', '.join(different)} differ); accepted: the same "
                        "scene, captures and options, or another directory")

    def _read(self) -> None:
        assert self._descriptor is not None and self._path is not None
        data = self._path.read_bytes()
        whole = data.rfind(b"\n") + 1
        if whole < len(data):
            os.ftruncate(self._descriptor, whole)
        for row, line in enumerate(data[:whole].splitlines(), 1):
            try:
                entry = json.loads(line)
                self.entries[int(entry["capture"])] = json.dumps(entry["result"])
            except (ValueError, KeyError, TypeError):
                raise Error(f"{self._path}: row {row} is no result of a capture") from None

    def add(self, entries: Sequence[tuple[int, str]]) -> None:
        """Adds finished captures durably. Those that are in the journal already are not added
        again."""
        new = [(place, text) for place, text in entries if place not in self.entries]
        if self._descriptor is not None and new:
            lines = "".join(f'{{"capture":{p},"result":{t}}}\n' for p, t in new).encode()
            try:
                while lines:
                    lines = lines[os.write(self._descriptor, lines):]
                os.fsync(self._descriptor)
            except OSError as error:
                raise OutputError(
                    f"{self._path}: cannot be written: {error.strerror}; the same call goes on from "
                    "what is there"
                ) from None
        self.entries.update(new)

    def close(self) -> None:
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None


def _study(scene: Scene, captures: Captures, options: Mapping[str, Any]) -> dict[str, Any]:
    """All that results depend on."""
    counts, metadata, sources, indices = captures._arrays()
    hashed = hashlib.sha256(metadata.encode())
    hashed.update(json.dumps([sources, indices]).encode())
    hashed.update(counts.tobytes())
    return {
        "format": "blindcorner.cluster.fit/1",
        "scene": hashlib.sha256(scene._core.text.encode()).hexdigest(),
        "captures": hashed.hexdigest(),
        "number": len(captures),
        "options": dict(options),
    }


def fit(
    scene: Scene,
    captures: Captures,
    client: Client,
    directory: PathLike | None = None,
    *,
    chunk: int = 0,
    progress: bool = True,
    **options: Any,
) -> Results:
    """Each capture by itself, as :func:`blindcorner.fit_each`, on the workers of ``client``.

    directory: where ``result.json`` goes. It is that of ``blindcorner fit SCENE CAPTURES -o
        DIRECTORY`` byte for byte, except for ``time_ms`` and ``exact_evaluations``, which differ
        from run to run. A finished capture counts only once it is in ``captures.jsonl`` there, so
        that the same call goes on after any failure. None: in memory only.
    chunk: captures of a task; 0: as many as give some ten tasks for each worker thread.
    progress: tell the dashboard's address, the rate and the time left on standard error.
    Options as for :class:`blindcorner.Fitter`. The results lack the histograms, which stay where they
    were fitted. Raises Error.
    """
    if chunk < 0:
        raise Error(f"chunk: found {chunk}, accepted: a number of captures, or 0")
    if len(captures) == 0:
        raise Error("captures: found none, accepted: one or more")
    wanted = fit_options(options)
    suited = _core.suit(scene._core, *captures._arrays())
    if suited.left_out:
        warnings.warn(suited.left_out, stacklevel=2)
    study = _study(scene, captures, wanted)
    key = hashlib.sha256(json.dumps(study, sort_keys=True).encode()).hexdigest()
    folder = None if directory is None else Path(directory)
    journal = Journal(folder, study)

    def remaining() -> list[tuple[int, Captures]]:
        return [(i, captures[i]) for i in range(len(captures)) if i not in journal.entries]

    def keep(entries: list[tuple[int, str]]) -> int:
        journal.add(entries)
        return len(entries)

    try:
        run_chunks(client, remaining, chunk, run_chunk, (os.getpid(), key, scene, suited, wanted), keep,
                   "captures", progress)
        texts = [journal.entries[i] for i in range(len(captures))]
        document = _core.result_text(scene._core, texts)
        if folder is not None:
            _core.write_atomically(os.fspath(folder / "result.json"), document)
    finally:
        journal.close()
    fields = json.loads(document)
    return Results([Result(fields, entry, None, scene) for entry in fields["captures"]], scene)


def sweep(
    scene: Scene,
    captures: Captures,
    settings: Mapping[str, Mapping[str, Any]],
    client: Client,
    directory: PathLike,
    *,
    chunk: int = 0,
    progress: bool = True,
) -> dict[str, Results]:
    """The same captures fitted with several settings: ``settings[name]`` are options of
    :class:`blindcorner.Fitter`. Each setting goes to ``directory/name`` as :func:`fit` writes
    it. ``directory/sweep.csv`` holds a row for each setting: captures, failed, median and 90th
    percentile distance of the heaviest mode from the truth (m, where known), mean presence
    probability. The same call goes on from what is there. Raises Error."""
    for name in settings:
        if not name or Path(name).name != name or name in (".", ".."):
            raise Error(f'settings: found the name "{name}", accepted: names of folders')
        fit_options(dict(settings[name]))
    folder = Path(directory)
    found = {
        name: fit(scene, captures, client, folder / name, chunk=chunk, progress=progress, **options)
        for name, options in settings.items()
    }
    table = io.StringIO()
    rows = csv.writer(table, lineterminator="\n")
    rows.writerow(["setting", "captures", "failed", "median_error_m", "p90_error_m", "mean_presence"])
    for name, results in found.items():
        errors = _errors(results)
        presence = [r.presence_probability for r in results if not r.error]
        rows.writerow([
            name, len(results), sum(bool(r.error) for r in results),
            f"{np.median(errors):.6g}" if errors else "",
            f"{np.quantile(errors, 0.9):.6g}" if errors else "",
            f"{np.mean(presence):.6g}" if presence else "",
        ])
    _core.write_atomically(os.fspath(folder / "sweep.csv"), table.getvalue())
    return found


def _errors(results: Sequence[Result]) -> list[float]:
    """Distances of heaviest modes from the truth over the unknown coordinates, m."""
    errors = []
    for result in results:
        modes, truth = result.modes, result.truth
        places = [i for i, name in enumerate(result.unknowns) if name.rsplit(".")[-1] in
                  ("x_m", "y_m", "z_m")]
        if not modes or truth is None or not places:
            continue
        distance = float(np.linalg.norm((modes[0].pose - truth)[places]))
        if np.isfinite(distance):
            errors.append(distance)
    return errors
