"""The analysis of a recording that still grows, repeated as often as its share of a core allows."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from acquisition.block import F8, I8, U8, Block, SourceInfo
from acquisition.buffer import GrowingColumns
from acquisition.recordings.recording import Recording
from pipeline.errors import PipelineError
from springmass.loading.loaded import Loaded
from springmass.loading.options import AnalysisOptions

if TYPE_CHECKING:
    from springmass.runs.run import Run

FEWEST = 16
"""Number of samples before the first analysis, a sixth of a second at 100 Hz."""
COLUMNS = (float, float, np.uint8, np.int64)
"""Types of times, distances, flags and host times, which are -1 if there are none."""


def columns_of(block: Block) -> tuple[F8, F8, U8, I8 | int]:
    """Return the columns of samples for a buffer."""
    return block.t, block.distance, block.flags, -1 if block.host_ns is None else block.host_ns


@dataclass(frozen=True, slots=True)
class NotYet:
    """The reason why there is no analysis yet."""

    why: str  # in one line


def live_run(
    samples: Block,
    info: SourceInfo,
    scene: Mapping[str, Any] | None,
    provenance: Mapping[str, Any],
    how: AnalysisOptions,
) -> Run:
    """Return the samples so far of a recording that is being made, as the run that its log would give."""
    from springmass.runs.run import Run  # with the first analysis: a recording begins sooner without it

    return Run(Loaded(Recording("wire", "", info, "", samples), "wire", scene, provenance), how=how)


def part_of(run: Run, low_s: float, high_s: float) -> Run:
    """Return the part of a run between two times, which may be empty, not analysed yet."""
    return replace(run, loaded=replace(run.loaded, from_s=low_s, to_s=high_s))


def analysed(run: Run) -> Run | NotYet:
    """Return a run that has its analysis, or why its samples cannot be analysed."""
    try:
        _ = run.analysis
    except PipelineError as error:
        return NotYet(str(error))
    return run


class Rolling:
    """Analyses the samples so far whenever this takes less than a share of the time since the last analysis.

    ``run_of`` makes a run of samples, whose analysis is that of the same samples at any later time. ``share`` is the
    largest share of a core, of the time ``now`` in s. The ``samples`` may come from another thread that appends them;
    otherwise they are pushed, and with ``most`` only the latest are kept.
    """

    def __init__(
        self,
        run_of: Callable[[Block], Run],
        *,
        share: float,
        samples: GrowingColumns | None = None,
        most: int | None = None,
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        self._run_of, self._share, self._most, self._now = run_of, share, most, now
        self._samples = GrowingColumns(*COLUMNS) if samples is None else samples
        self._analysed = FEWEST - 1
        self._due_s, self._cost_s = -math.inf, 0.0
        self._latest: Run | NotYet | None = None

    def push(self, block: Block) -> None:
        """Take the next samples."""
        self._samples.append(*columns_of(block))
        if self._most is not None and len(self._samples) > 2 * self._most:
            self._samples.keep(slice(-self._most, None))

    @property
    def host_ns(self) -> I8:
        """The host times of the samples, ns."""
        return self._samples[:][3]

    def due(self) -> bool:
        """Return whether samples came since the last analysis, and the share allows another one."""
        return self._samples.total > self._analysed and self._now() >= self._due_s

    def latest(self, seconds: float = math.inf) -> Run | NotYet:
        """Return the analysed run of the last seconds, or why there is none; it is analysed anew if that is due."""
        if self.due():
            self._analysed, start_s = self._samples.total, time.thread_time()
            run = self.run()
            if math.isfinite(seconds):
                run = part_of(run, float(run.loaded.samples.t[-1]) - seconds, math.inf)
            self._latest = analysed(run)
            # Time in this thread, without waiting for a core that other programs use. An analysis that first loads a
            # library takes longer; the next one need not wait for that.
            cost_s = time.thread_time() - start_s
            self._due_s = self._now() + min(cost_s, self._cost_s) / self._share
            self._cost_s = cost_s
        return NotYet(f"{self._samples.total} samples so far") if self._latest is None else self._latest

    def run(self) -> Run:
        """Return the samples as they are now as a run that is not analysed yet."""
        t, distance, flags, host_ns = self._samples[slice(None if self._most is None else -self._most, None)]
        return self._run_of(Block(0, t, distance, flags, host_ns))
