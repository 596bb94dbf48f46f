"""Streaming: period and amplitude during a recording, by the same stages as in a batch analysis.

An accumulator takes samples with ``push``, returns the motion with ``value`` and discards all samples with ``clear``.
Its value is the analysis of the stored samples, so live and batch analysis of the same samples agree to the last bit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.analyse import Oscillation, analyse
from pipeline.errors import AnalysisError
from pipeline.numerics.estimate import Estimate
from pipeline.options import Options
from pipeline.track import F8, U8, Track


@dataclass(frozen=True, slots=True)
class LiveMotion:
    """The motion in the latest seconds."""

    # period, amplitude, offset, noise: the estimates of :func:`pipeline.analyse.analyse` for the stored samples; the
    # amplitude is that at their start.
    period: Estimate
    amplitude: Estimate
    offset: Estimate
    noise: Estimate
    seconds: float  # time from the first to the last stored sample, s


@dataclass(frozen=True, slots=True)
class NotYet:
    """The reason why no value is available yet."""

    why: str  # the reason, in one line


class MotionAccumulator:
    """Buffer of the latest samples, analysed on request.

    The memory needed depends on the window and not on the length of the run. A value over 10 s at 100 Hz takes a few
    milliseconds, so one value a second uses less than a hundredth of a core.
    """

    def __init__(self, rate_hz: float, window_s: float = 10.0, options: Options | None = None) -> None:
        if not (rate_hz > 0 and window_s > 0):
            raise ValueError(f"rate_hz and window_s must be positive, got {rate_hz} and {window_s}")
        self._rate_hz, self._options = rate_hz, options
        self._room = max(int(rate_hz * window_s), 16)
        self.clear()

    def clear(self) -> None:
        """Discard all samples."""
        self._columns = np.empty(0), np.empty(0), np.empty(0, np.uint8)

    def __len__(self) -> int:
        return self._columns[0].size

    def push(self, t: F8, y: F8, flags: U8) -> None:
        """Append samples: times (n,) in s, values (n,) in their unit, flags (n,)."""
        # New arrays, so that a track that was given away never changes.
        held_t, held_y, held_flags = self._columns
        self._columns = (
            np.concatenate([held_t, t])[-self._room :],
            np.concatenate([held_y, y])[-self._room :],
            np.concatenate([held_flags, flags])[-self._room :],
        )

    def track(self) -> Track:
        """Return the stored samples as a track, as a batch analysis would get them."""
        return Track(*self._columns, self._rate_hz, clock="device")

    def value(self) -> LiveMotion | NotYet:
        """Return the motion of the stored samples, or the reason why no value is available."""
        if len(self) < 16:
            return NotYet(f"{len(self)} samples so far")
        track = self.track()
        try:
            analysis = analyse(track, options=self._options)
        except AnalysisError as error:
            return NotYet(str(error))
        if not isinstance(analysis.motion, Oscillation):
            return NotYet(analysis.motion.why)
        found = analysis.estimates
        seconds = float(track.t[-1] - track.t[0])
        return LiveMotion(found["period"], found["amplitude"], found["offset"], found["noise"], seconds)
