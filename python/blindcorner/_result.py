# SPDX-License-Identifier: Apache-2.0
"""What a fit found: explanations, how sure they are, and whether there is an object at all."""

from __future__ import annotations

import html
import json
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import _core
from ._core import Error
from ._scene import PathLike, Scene


def numbers(value: Any) -> NDArray[np.float64]:
    """An array from numbers in JSON; null becomes NaN."""
    return np.array(value, dtype=np.float64)


@dataclass(frozen=True, eq=False)
class Mode:
    """One explanation of the data. Vectors follow the scene's unknowns, m, rad or 1."""

    weight: float  #: share of the posterior, given that there is an object
    pose: NDArray[np.float64]  #: [unknowns] mean
    covariance: NDArray[np.float64]  #: [unknowns, unknowns]
    undetermined: list[str]  #: unknowns that the data left open
    log_likelihood: float  #: at the optimum
    optimum: NDArray[np.float64]  #: [unknowns] the maximum itself


@dataclass(frozen=True, eq=False)
class FittedHistograms:
    """The best fit of one capture; arrays [zones, bins], expected counts. They are views of the
    result's own memory."""

    measured: NDArray[np.float64]  #: the capture
    model: NDArray[np.float64]  #: all terms of the model
    object: NDArray[np.float64]  #: of these, the light that visited the hidden object
    zone_used: NDArray[np.bool_]  #: [zones]
    first_bin: int  #: bins from first_bin to end_bin - 1 entered the likelihood
    end_bin: int


def frame(page: str) -> str:
    """A page inside a notebook."""
    return (
        f'<iframe srcdoc="{html.escape(page)}" style="width:100%;height:720px;border:1px solid '
        '#d0d4d8"></iframe>'
    )


class Result:
    """The answer of one fit: a Gaussian mixture over poses, and a probability that there is an
    object. In a notebook it shows the page of ``blindcorner fit``."""

    def __init__(self, document: dict[str, Any], entry: dict[str, Any],
                 fit: _core.Fit | None = None, scene: Scene | None = None) -> None:
        """From the fields of ``result.json`` and an entry of its list ``captures``
        (docs/result.md); see :func:`load_results`."""
        self._head = {k: v for k, v in document.items() if k != "captures"}
        self._entry = entry
        self._fit = fit
        self._scene = scene

    @classmethod
    def _of(cls, scene: Scene, fit: _core.Fit) -> Result:
        head = json.loads(_core.result_text(scene._core, []))
        return cls(head, json.loads(fit.text), fit, scene)

    @property
    def unknowns(self) -> list[str]:
        """Names with units, in the order of all vectors."""
        return list(self._head["unknowns"])

    @property
    def periods(self) -> NDArray[np.float64]:
        """[unknowns] period after which each repeats, rad; 0: it does not."""
        return numbers(self._head["periods"])

    @property
    def source(self) -> str | list[str] | None:
        """File that the capture came from; for a joint fit, a list of files."""
        return self._entry["source"]

    @property
    def index(self) -> int | list[int] | None:
        """The capture's place in its file; for a joint fit, a list of places."""
        return self._entry["index"]

    @property
    def modes(self) -> list[Mode]:
        """The explanations that the data left, heaviest first."""
        return [
            Mode(m["weight"], numbers(m["pose"]), numbers(m["covariance"]), m["undetermined"],
                 np.nan if m["log_likelihood"] is None else m["log_likelihood"],
                 numbers(m["optimum"]))
            for m in self._entry["modes"]
        ]

    def _of_posterior(self, field: str, shape: tuple[int, ...]) -> NDArray[np.float64]:
        value = self._entry[field]
        return np.full(shape, np.nan) if value is None else numbers(value)

    @property
    def mean(self) -> NDArray[np.float64]:
        """[unknowns] of the whole posterior, m, rad or 1 (yaw: circular); NaN without a mode."""
        return self._of_posterior("mean", (len(self.unknowns),))

    @property
    def covariance(self) -> NDArray[np.float64]:
        """[unknowns, unknowns] of the whole posterior; NaN without a mode."""
        return self._of_posterior("covariance", (len(self.unknowns),) * 2)

    @property
    def presence_probability(self) -> float:
        """Posterior probability that there is an object; NaN for a fit that failed."""
        value = self._entry["presence_probability"]
        return np.nan if value is None else value

    @property
    def false_alarm_probability(self) -> float | None:
        """Chance that an empty scene looks at least this much like one with an object; None: not
        asked for."""
        return self._entry["false_alarm_probability"]

    @property
    def goodness_of_fit(self) -> dict[str, float]:
        """``deviance``, its ``expected`` value and ``standard_deviation`` if the model is right, and
        ``inflation``, the factor on the covariances."""
        return dict(self._entry["goodness_of_fit"] or {})

    @property
    def flags(self) -> list[str]:
        """Words (docs/result.md)."""
        return list(self._entry["flags"])

    @property
    def hints(self) -> list[str]:
        """Sentences on what is odd, and what to do about it."""
        return list(self._entry["hints"])

    @property
    def truth(self) -> NDArray[np.float64] | None:
        """[unknowns] true values, NaN where not known; None: nothing is known."""
        value = self._entry["truth"]
        return None if value is None else numbers(value)

    @property
    def error(self) -> str:
        """One line if this capture failed; else empty."""
        return self._entry["error"] or ""

    @property
    def track(self) -> dict[str, Any] | None:
        """What a tracker adds (docs/result.md); None without one."""
        return self._entry.get("track")

    @property
    def time_ms(self) -> dict[str, float]:
        """Wall-clock times by stage, ms."""
        return dict(self._entry["time_ms"])

    @property
    def histograms(self) -> list[FittedHistograms]:
        """Measured and fitted histograms of each capture. Empty for a result that was read from a
        file or came from another process."""
        if self._fit is None:
            return []
        return [
            FittedHistograms(**{**h, "zone_used": np.array(h["zone_used"], dtype=bool)})
            for h in self._fit.histograms
        ]

    @property
    def headline(self) -> str:
        """What was found, in a sentence; empty for a result that was read from a file."""
        return self._fit.headline if self._fit is not None else ""

    def draw(self, n: int, seed: int | np.random.Generator | None = None) -> NDArray[np.float64]:
        """[n, unknowns] poses drawn from the mixture, m, rad or 1. They scatter as the posterior
        does if there is an object. Yaws lie about that of their mode and are not wrapped. Raises
        Error without a mode."""
        modes = self.modes
        if not modes:
            raise Error(f"draw: {self.error or 'there is no mode'}")
        random = np.random.default_rng(seed)
        weights = np.array([mode.weight for mode in modes])
        which = random.choice(len(modes), size=n, p=weights / weights.sum())
        normal = random.standard_normal((n, len(self.unknowns)))
        means = np.array([mode.pose for mode in modes])
        roots = np.array([_root(mode.covariance) for mode in modes])
        return means[which] + np.einsum("nij,nj->ni", roots[which], normal)

    def to_dict(self) -> dict[str, Any]:
        """What ``result.json`` holds for this fit (docs/result.md)."""
        return {**self._head, "captures": [self._entry]}

    def save(self, directory: PathLike) -> None:
        """Writes ``result.json`` and, where the fit was made in this process, ``result.html``, as
        ``blindcorner fit -o DIR``; the directory is made. Raises Error."""
        Results([self], self._scene).save(directory)

    def page(self) -> str:
        """The page of ``blindcorner fit`` as HTML. Raises Error for a result that was read from a
        file."""
        return Results([self], self._scene).page()

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_fit": None}

    def __repr__(self) -> str:
        return _table([self]) + (f"\n{self.headline}" if self.headline else "")

    def _repr_html_(self) -> str:
        return Results([self], self._scene)._repr_html_()


def _root(covariance: NDArray[np.float64]) -> NDArray[np.float64]:
    """A matrix R with R R' = covariance, which may be singular."""
    values, vectors = np.linalg.eigh(covariance)
    return vectors * np.sqrt(np.maximum(values, 0))


def _cell(name: str, mode: Mode, i: int) -> str:
    sigma = np.sqrt(max(mode.covariance[i, i], 0))
    open_ = "?" if name in mode.undetermined else ""
    return f"{name} {mode.pose[i]:.3f} ± {sigma:.3f}{open_}"


def _line(result: Result) -> str:
    source = result.source
    name = (
        f"{len(source)} captures" if isinstance(source, list)
        else f"{Path(source or 'capture').name} [{result.index}]"
    )
    if result.error:
        return f"{name}: {result.error}"
    modes = result.modes
    if not modes:
        return f"{name}: no mode, presence {result.presence_probability:.3f}"
    cells = ", ".join(_cell(n, modes[0], i) for i, n in enumerate(result.unknowns))
    flags = f"; {' '.join(result.flags)}" if result.flags else ""
    return (
        f"{name}: {cells}; mode 1 of {len(modes)}, weight {modes[0].weight:.3f}, presence "
        f"{result.presence_probability:.3f}{flags}"
    )


def _table(results: Sequence[Result], most: int = 20) -> str:
    lines = [_line(result) for result in results[:most]]
    if len(results) > most:
        lines.append(f"... {len(results) - most} more")
    return "\n".join(lines)


class Results(Sequence[Result]):
    """Results of several captures, in their order."""

    def __init__(self, results: Sequence[Result], scene: Scene | None = None) -> None:
        self._results = list(results)
        self._scene = scene

    def __len__(self) -> int:
        return len(self._results)

    def __getitem__(self, which: Any) -> Any:
        if isinstance(which, slice):
            return Results(self._results[which], self._scene)
        return self._results[which]

    def __iter__(self) -> Iterator[Result]:
        return iter(self._results)

    def to_dict(self) -> dict[str, Any]:
        """What ``result.json`` holds (docs/result.md)."""
        if not self._results:
            raise Error("results: found none, accepted: one or more")
        return {**self._results[0]._head, "captures": [r._entry for r in self._results]}

    def save(self, directory: PathLike) -> None:
        """Writes ``result.json`` and, where the fits were made in this process, ``result.html``; the
        directory is made. Raises Error."""
        folder = Path(directory)
        document = self.to_dict()
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise Error(f"{folder}: cannot be made a directory: {error.strerror}") from None
        for stale in ("result.html", "evaluation.html", "evaluation.json"):
            (folder / stale).unlink(missing_ok=True)
        if all(r._fit is not None for r in self._results):
            _core.write_atomically(os.fspath(folder / "result.html"), self.page())
        _core.write_atomically(
            os.fspath(folder / "result.json"),
            json.dumps(document, indent=1, sort_keys=True, ensure_ascii=False) + "\n"
            if self._scene is None
            else _core.result_text(
                self._scene._core, [json.dumps(r._entry) for r in self._results]),
        )
        _core.write_index(os.fspath(folder))

    def page(self) -> str:
        """The page of ``blindcorner fit`` as HTML. Raises Error for results that were read from a
        file."""
        fits = [r._fit for r in self._results if r._fit is not None]
        if len(fits) != len(self._results):
            raise Error("page: found results of a file or of another process, which lack the "
                        "histograms, accepted: results of fits made in this process")
        return _core.result_page(fits)

    def __repr__(self) -> str:
        return _table(self._results)

    def _repr_html_(self) -> str:
        if all(r._fit is not None for r in self._results) and self._results:
            return frame(self.page())
        return f"<pre>{html.escape(repr(self))}</pre>"


def load_results(path: PathLike) -> Results:
    """Reads a ``result.json``, or the one in a directory. Raises Error."""
    file = Path(path)
    if file.is_dir():
        file = file / "result.json"
    try:
        document = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise Error(f"{file}: {error}") from None
    if not isinstance(document, dict) or document.get("format") != "blindcorner.result/1":
        raise Error(f'{file}: format: accepted: "blindcorner.result/1"')
    return Results([Result(document, entry) for entry in document["captures"]])
