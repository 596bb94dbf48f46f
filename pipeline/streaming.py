"""Streaming: period and amplitude while the samples still come, by the same stages as afterwards.

An accumulator takes samples with ``push``, gives the motion with ``value`` and forgets with ``clear``. Its value is
the analysis of the samples it holds, so that live and batch agree on the same samples to the last bit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.analyse import Oscillation, Params, analyse
from pipeline.errors import AnalysisError
from pipeline.numerics.estimate import Estimate
from pipeline.track import F8, U8, Track

__all__ = ["LiveMotion", "MotionAccumulator", "NotYet"]


@dataclass(frozen=True, slots=True)
class LiveMotion:
    """What the latest seconds say.

    Parameters
    ----------
    period, amplitude, offset, noise : Estimate
        As :func:`pipeline.analyse.analyse` gives them for the samples held; the amplitude at the first of them.
    seconds : float
        How long the samples held span, s.
    """

    period: Estimate
    amplitude: Estimate
    offset: Estimate
    noise: Estimate
    seconds: float


@dataclass(frozen=True, slots=True)
class NotYet:
    """Why there is no value.

    Parameters
    ----------
    why : str
        One sentence.
    """

    why: str


class MotionAccumulator:
    """Holds the latest samples and analyses them on request.

    Parameters
    ----------
    rate_hz : float
        Nominal samples per second, Hz.
    window_s : float
        How many seconds to hold.
    params : pipeline.analyse.Params, optional
    quantity, unit : str
        What the samples are of.

    Notes
    -----
    Memory is the window's, whatever the length of the run. A value over 10 s at 100 Hz costs a few milliseconds, so
    once a second it takes less than a hundredth of a core.
    """

    def __init__(
        self,
        rate_hz: float,
        window_s: float = 10.0,
        params: Params | None = None,
        *,
        quantity: str = "length",
        unit: str = "m",
    ) -> None:
        if not (rate_hz > 0 and window_s > 0):
            raise ValueError(f"rate_hz and window_s must be positive, got {rate_hz} and {window_s}")
        self._rate_hz = rate_hz
        self._params, self._quantity, self._unit = params, quantity, unit
        self._room = max(int(rate_hz * window_s), 16)
        self.clear()

    def clear(self) -> None:
        """Forget all samples."""
        # Twice the room: samples are moved to the front once per room, not at every push.
        self._t = np.empty(2 * self._room)
        self._y = np.empty(2 * self._room)
        self._flags = np.empty(2 * self._room, np.uint8)
        self._stop = 0

    def __len__(self) -> int:
        return min(self._stop, self._room)

    def push(self, t: F8, y: F8, flags: U8) -> None:
        """Take samples: times (n,) in s, values (n,) in their unit, flags (n,)."""
        t, y, flags = t[-self._room :], y[-self._room :], flags[-self._room :]
        n = t.size
        if self._stop + n > self._t.size:
            keep = self._room - n if n < self._room else 0
            for column in (self._t, self._y, self._flags):
                column[:keep] = column[self._stop - keep : self._stop].copy()
            self._stop = keep
        for column, values in ((self._t, t), (self._y, y), (self._flags, flags)):
            column[self._stop : self._stop + n] = values
        self._stop += n

    def track(self) -> Track:
        """Return the samples held, as a batch analysis would get them."""
        held = slice(max(self._stop - self._room, 0), self._stop)
        return Track(
            self._t[held].copy(),
            self._y[held].copy(),
            self._flags[held].copy(),
            self._rate_hz,
            clock="device",
            quantity=self._quantity,
            unit=self._unit,
        )

    def value(self) -> LiveMotion | NotYet:
        """Return the motion of the stored samples, or the reason why there is none."""
        if len(self) < 16:
            return NotYet(f"{len(self)} samples so far")
        track = self.track()
        try:
            analysis = analyse(track, params=self._params)
        except AnalysisError as error:
            return NotYet(str(error))
        if not isinstance(analysis.motion, Oscillation):
            return NotYet(analysis.motion.why)
        found = analysis.estimates
        seconds = float(track.t[-1] - track.t[0])
        return LiveMotion(found["period"], found["amplitude"], found["offset"], found["noise"], seconds)
