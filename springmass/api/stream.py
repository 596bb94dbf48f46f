"""Estimates while samples arrive."""

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from acquisition.block import Block
from pipeline.errors import TrackError
from springmass.api.analysing import AnyScene
from springmass.loading.options import AnalysisOptions
from springmass.loading.scenes import scene_from
from springmass.runs.rolling import Rolling
from springmass.runs.run import Run

STREAM_SHARE = 0.025
"""Largest share of a core for the analyses, of the time that the samples span: a replay is slowed to 40 times life."""


class Stream:
    """The estimates of a run so far, from samples that arrive piece by piece.

    The samples are analysed again as often as a fortieth of the time that they span allows, so a second of data costs
    the same however long the run is. The estimates are those of :func:`springmass.analyse` for the same samples.

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
        stated, how = scene_from(scene), AnalysisOptions(accuracy=accuracy, law=law)
        self._end_s = -math.inf
        self._rolling = Rolling(
            lambda block: Run.of((block.t, block.distance), stated, how),
            share=STREAM_SHARE,
            now=lambda: self._end_s,
        )

    def push(self, t: ArrayLike, y: ArrayLike) -> Run | None:
        """Take the next samples, times in s and distances in m; return the latest run, None before the first one."""
        times, values = (np.atleast_1d(np.asarray(each, np.float64)) for each in (t, y))
        if times.ndim != 1 or times.shape != values.shape:
            shapes = f"got {times.shape} and {values.shape}"
            raise TrackError(f"t and y must be one-dimensional and of one length, {shapes}", "give one time a value")
        self._rolling.push(Block(0, times, values, np.zeros(times.size, np.uint8)))
        self._end_s = float(np.max(times, initial=self._end_s, where=np.isfinite(times)))
        latest = self._rolling.latest()
        return latest if isinstance(latest, Run) else None

    def finish(self) -> Run:
        """Return the run of all samples."""
        run = self._rolling.run()
        _ = run.analysis
        return run
