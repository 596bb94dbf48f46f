"""The residual of a run: what the fit of every window leaves of the samples, as input of the tests."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.bench.sensor_filter import SensorFilter
from pipeline.motion.fitted import Oscillation
from pipeline.numerics.levels import FEWEST_FOR_LINE
from pipeline.numerics.robust import median
from pipeline.samples.condition import COARSE, Samples
from pipeline.track import F8
from pipeline.windows.demodulate import model_error

# Parts of the run that must agree on a shape. At a probability of 1e-6 its power must be 23 times its variance, instead
# of 14 for infinitely many parts (F distribution with 2 and 30 degrees of freedom).
PARTS = 16


class Misfit(NamedTuple):
    """Standard uncertainties of the estimates because the model of the fit does not describe the record."""

    name: str  # of the input in every budget
    # By what they are added to: "amplitude", "offset", "phase", "damping_rate", or "clock", which is relative and of
    # all quantities measured by the times of the record.
    sizes: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a test found: numbers of its finding, what it adds to the uncertainties, and what it explains.

    ``explains`` (k,) is subtracted from the residual, and ``lags`` is the number of samples up to which correlations
    are explained. A test explains only what it models.
    """

    code: str
    numbers: Mapping[str, float | None] | None = None  # None: too small to be reported
    misfit: Misfit | None = None
    explains: F8 | float = 0.0
    lags: float = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class Residual:
    """The residual at the samples used (k,), and the fit that left it."""

    samples: Samples
    fitted: Oscillation
    filter: SensorFilter | None  # of the sensor, as the scene states it
    values: F8  # still with the harmonics that were subtracted as modes
    phase: F8  # of the oscillation, rad
    relative: F8 | None  # amplitude over that at the first sample; None if it cannot be calculated
    rows: NDArray[np.int64]  # indices of the samples
    noise: float  # standard deviation of one sample
    rounding: float  # error of the sinusoid of a window, which is larger than the noise of computed records
    amplitude: float  # mean amplitude
    seconds: float
    step_s: float  # mean time between samples
    turn: float  # increase of the phase from sample to sample, rad
    per_window: int  # number of samples in a window
    lags: float = 1.0  # number of samples up to which correlations are explained

    @property
    def enough(self) -> bool:
        """Whether there are enough samples for tests of them."""
        return self.values.size >= FEWEST_FOR_LINE * PARTS and self.seconds > 0.0

    @property
    def noisy(self) -> bool:
        """Whether there is noise, and not only rounding or coarse steps, which the finding "quantised" reports."""
        return self.noise > max(self.rounding, (self.samples.quantum or 0.0) / COARSE)

    def on_grid(self, *, of_whole_fit: bool = False) -> tuple[F8, F8]:
        """Return the residual of all samples (n,), 0 where none was used, and 1 where one was used.

        That of the whole fit includes what the windows follow and no model explains.
        """
        whole, used = np.zeros((2, len(self.samples.track)))
        whole[self.rows], used[self.rows] = self.values, 1.0
        if of_whole_fit:
            whole[self.rows] += (self.fitted.waveform.residual - self.fitted.windows.residual)[self.rows]
        return whole, used

    def less(self, outcome: Outcome) -> Residual:
        """Return what an outcome does not explain."""
        return replace(self, values=self.values - outcome.explains, lags=max(self.lags, outcome.lags))


def residual_of(samples: Samples, fitted: Oscillation, filter_: SensorFilter | None) -> Residual:
    """Return the residual of a run that was fitted by its windows."""
    windows, modes, t = fitted.windows, fitted.modes, samples.track.t
    rows = np.flatnonzero(windows.used & np.isfinite(windows.residual))
    values = windows.residual[rows]
    locked = tuple(mode for mode in modes.members if mode.kind == "harmonic")
    if modes.subtracted is not None and locked:
        values = values + replace(modes, members=locked).position(t[rows])
    size = np.abs(fitted.damping.best.amplitude(np.maximum(t[rows] - fitted.damping.t0, 0.0)))
    falls = bool(size.size and np.isfinite(size).all() and size[0] > 0.0)
    seconds = float(t[rows[-1]] - t[rows[0]]) if rows.size else 0.0
    step_s = seconds / max(int(rows[-1] - rows[0]), 1) if rows.size else 0.0
    return Residual(
        samples=samples,
        fitted=fitted,
        filter=filter_,
        values=values,
        phase=fitted.phase.total(t[rows]),
        relative=size / size[0] if falls else None,
        rows=rows,
        noise=windows.noise,
        rounding=median(model_error(windows.amplitude, windows.decay, windows.angular_frequency)),
        amplitude=float(np.mean(np.abs(windows.amplitude))),
        seconds=seconds,
        step_s=step_s,
        turn=fitted.phase.angular_frequency.value * step_s,
        per_window=rows.size // windows.t.size,
    )
