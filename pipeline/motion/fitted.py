"""What all fits of an oscillation share: its phase, rest position and waveform."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.polynomial import Legendre

from pipeline.damping.law_fit import mean_squared_rate
from pipeline.damping.select import Damping
from pipeline.modes.mode import Modes
from pipeline.motion.frequency import Bend, TimeTable, turns
from pipeline.notice import Refusal
from pipeline.numerics.estimate import Estimate, Joint
from pipeline.numerics.regression import Scatter
from pipeline.track import F8, U8
from pipeline.windows.demodulate import Windows
from pipeline.windows.walk import Walk


@dataclass(frozen=True, slots=True, eq=False)
class Phase:
    """Total phase against time: a straight line, bent if the frequency changes, less the lag of a period's sinusoid."""

    t0: float  # time of the start, s
    angular_frequency: Estimate  # mean over the record: the slope of a straight line through the phases
    phase: Estimate  # at t0, wrapped into (-pi, pi]
    reduced_chi2: float
    correlation: float  # of the straight line's residuals, as a number of windows
    residual: F8  # (w,) phases minus the straight line, rad
    coefficients: F8  # of 1, of t - middle and of the integrals of the terms by which the frequency changes
    middle: float  # weighted mean time, s
    bend: Bend | None = None  # how the frequency changes; None if a constant describes the phases
    lag: TimeTable | None = None  # delay of a period's sinusoid, rad; None if it is constant
    small_swings: Estimate | None = None  # angular frequency of very small swings, by a law of the amplitude
    of_pendulum: bool = False  # whether this law is that of a pendulum
    walk: Walk | None = None  # of amplitude and phase, if they wander at random; the frequency is that of the walk
    spread: Scatter | None = None  # of the windows' phases about a smooth curve; None of a single window
    squared_rate: float | None = None  # that of the oscillation, by a fit of the equation

    @property
    def of_amplitude(self) -> bool:
        """Whether the frequency changes with the amplitude, and the law of time that fits as well is excluded."""
        return self.of_pendulum or (self.bend is not None and not self.bend.by_time)

    @property
    def tables(self) -> tuple[TimeTable, ...]:
        """The integrals of the terms by which the frequency changes."""
        return () if self.bend is None else self.bend.tables

    def total(self, t: F8) -> F8:
        """Return the total phase in rad at times t (n,)."""
        return np.asarray(self.columns(t) @ self.coefficients - delay(t, self.lag))

    def columns(self, t: F8) -> F8:
        """Return the derivatives (n, p) of :meth:`total` by the coefficients."""
        return turns(t, self.middle, self.tables)

    def rate(self, amplitude: F8, t: F8) -> F8:
        """Return the angular frequency in rad/s at amplitudes and times (n,)."""
        rate = np.full(t.size, self.coefficients[1])
        if self.bend is not None:
            rate += self.coefficients[2:] @ np.array(self.bend.law.terms(amplitude, t - self.middle))
        return rate


@dataclass(frozen=True, slots=True, eq=False)
class RestPosition:
    """The rest position: its mean, and a smooth curve through the windows that counts if it ``drifts``."""

    mean: Estimate
    curve: Legendre  # m, by the time in s; its domain is the part of the record that was fitted
    drift: float = 0.0  # peak-to-peak range of the curve at the windows
    drifts: bool = False  # whether the curve fits much better than a constant
    spread: Scatter | None = None  # of the windows' rest positions about a smooth curve

    def at(self, t: F8) -> F8:
        """Return the rest position in m at times t (n,)."""
        if not self.drifts:
            return np.full(t.size, self.mean.value)
        return np.asarray(self.curve(np.clip(t, *self.curve.domain)))


@dataclass(frozen=True, eq=False)
class Waveform:
    """The fitted motion at every sample; its residual contains everything that the model does not describe."""

    position: F8  # (n,) m
    moving: Callable[[], F8]
    residual: F8  # (n,) distance minus position, NaN where none was measured
    rms: float  # root mean square of the residual over the samples used

    @cached_property
    def velocity(self) -> F8:
        """Velocity of the oscillation (n,) in m/s, calculated on first use, as only figures need it."""
        return self.moving()


Method = Literal["windows", "samples", "equation"]
"""What the motion was fitted to."""


@dataclass(frozen=True, slots=True, eq=False)
class Oscillation:
    """An oscillation in the form that the stages after the fit use."""

    windows: Windows  # the windows, with the final flags
    modes: Modes  # other oscillations, which may have been subtracted before the fit
    damping: Damping
    phase: Phase
    rest: RestPosition
    waveform: Waveform  # including the modes
    method: Method
    refused: tuple[Refusal, ...] = ()  # why the equation of motion, or all samples, were not fitted

    @property
    def flags(self) -> U8:
        """The final flags of all samples, (n,) uint8."""
        return self.windows.flags

    @property
    def residual(self) -> F8:
        """What the motion leaves of every sample, (n,); NaN where none was measured."""
        return self.waveform.residual

    @property
    def start_s(self) -> float:
        """The time for which amplitude, phase and damping rate are stated, s."""
        return self.phase.t0

    @property
    def squared_rate(self) -> float:
        """Decrease of the squared angular frequency by drag, 1/s^2."""
        if self.phase.squared_rate is not None:
            return self.phase.squared_rate
        return mean_squared_rate(self.damping.best, self.damping.best.amplitude(self.windows.t - self.damping.t0))

    @property
    def shift(self) -> float:
        """The relative shift of the frequency from very small swings to the first ones, or with time over the run."""
        phase = self.phase
        ends = np.array([phase.t0, float(np.max(self.windows.t))])
        first, last = phase.rate(self.damping.best.amplitude(ends - phase.t0), ends).tolist()
        if phase.small_swings is not None and phase.of_amplitude:
            return float(first / phase.small_swings.value - 1.0)
        return float((last - first) / phase.angular_frequency.value)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ClosedMotion:
    """A motion with few parameters and no laws."""

    joint: Joint  # its parameters, in the record's times and values
    dof: float  # number of independent samples less that of the parameters
    noise: Estimate  # of one sample
    start_s: float  # time at which the fitted part of the motion begins
    residual: F8  # (n,) what the motion leaves of every sample, NaN before the start
    flags: U8  # (n,) with those before the start as outside


def delay(t: F8, lag: TimeTable | None) -> F8 | float:
    """Return the delay of a period's sinusoid at times t (n,), rad."""
    return 0.0 if lag is None else np.interp(t, *lag)


def wrapped(angle: float) -> float:
    """Return the angle in rad wrapped into (-pi, pi]."""
    turned = math.remainder(angle, 2.0 * math.pi)
    return math.pi if turned == -math.pi else turned
