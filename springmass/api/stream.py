"""Estimates while samples arrive."""

from __future__ import annotations

import contextlib
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pipeline.errors import AnalysisError
from springmass.api.analysing import AnyScene
from springmass.loading.options import AnalysisOptions
from springmass.loading.scenes import scene_from
from springmass.runs.run import Run

FEWEST = 32  # samples before the first analysis
SAMPLES_RATIO = (
    1.1  # the next analysis waits for so many times as many samples, so a second of data costs the same throughout
)


class Stream:
    """The estimates of a run so far, from samples that arrive piece by piece.

    The samples are analysed again whenever a tenth more of them have come. A second of data costs the same however
    long the run is, and the estimates are those that :func:`springmass.analyse` gives for the same samples.

    Parameters
    ----------
    scene : Scene, path or mapping, optional
        Known values of the bench.
    accuracy : {"fast", "standard", "best"}
    law : str, optional
        The damping law, if it is known.

    Examples
    --------
    >>> stream = Stream()
    >>> for second in range(10):
    ...     t = second + np.arange(100) / 100
    ...     run = stream.push(t, 0.2 + 0.05 * np.cos(8.3 * t))
    >>> round(run["period"].value, 4), stream.finish().ok
    (0.757, True)
    """

    def __init__(self, scene: AnyScene | None = None, *, accuracy: Any = "fast", law: str | None = None) -> None:
        self._scene, self._how = scene_from(scene), AnalysisOptions(accuracy=accuracy, law=law)
        self._t: list[Any] = [np.empty(0)]
        self._y: list[Any] = [np.empty(0)]
        self._count, self._due = 0, FEWEST
        self._run: Run | None = None

    def push(self, t: ArrayLike, y: ArrayLike) -> Run | None:
        """Take the next samples, times in s and distances in m; return the latest run, None before the first one."""
        self._t.append(np.atleast_1d(np.asarray(t, np.float64)))
        self._y.append(np.atleast_1d(np.asarray(y, np.float64)))
        self._count += self._t[-1].size
        if self._count >= self._due:
            self._due = int(self._count * SAMPLES_RATIO) + 1
            with contextlib.suppress(AnalysisError):  # too few are usable so far; ``finish`` says so
                self._run = self._analysed()
        return self._run

    def finish(self) -> Run:
        """Return the run of all samples."""
        self._run = self._analysed()
        return self._run

    def _analysed(self) -> Run:
        self._t, self._y = [np.concatenate(self._t)], [np.concatenate(self._y)]
        run = Run.of((self._t[0], self._y[0]), self._scene, self._how)
        _ = run.analysis
        return run
