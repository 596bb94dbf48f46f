"""Modes: the main oscillation and further modes, as functions of time and as columns of a linear fit."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from pipeline.numerics.levels import OUTLIER
from pipeline.numerics.robust import mad_sigma
from pipeline.samples.condition import Samples
from pipeline.track import C16, F8
from pipeline.windows.demodulate import Windows


@dataclass(frozen=True, slots=True, eq=False)
class Carrier:
    """The main oscillation as smooth curves through the windows' values, independent of any damping law."""

    t: F8  # (k,) s, nodes: the windows' centres and the record's ends
    # amplitude, turning, rest: (k,) m, rad, m, values at the nodes; ``turning`` is the phase less ``angular_frequency``
    # times t - t[0].
    amplitude: F8
    turning: F8
    rest: F8
    angular_frequency: float  # rad/s
    # degree, rest_degree: degrees of the polynomials in time, for amplitude and phase and for the rest position.
    degree: int
    rest_degree: int

    @classmethod
    def through(cls, windows: Windows, start: float, end: float) -> Carrier:
        """Fit polynomials to the windows' amplitudes, phases and rest positions."""
        t, omega = windows.t, windows.angular_frequency
        degree, rest_degree = min(8, max(1, t.size // 6)), min(6, max(1, t.size // 10))
        turning = windows.phase - omega * (t - start)
        nodes = np.concatenate([[start], t, [end]])
        centre, half = 0.5 * (t[0] + t[-1]), 0.5 * (t[-1] - t[0])
        powers = np.polynomial.legendre.legvander((nodes - centre) / half, max(degree, rest_degree))
        return cls(
            t=nodes,
            amplitude=_smooth(powers[:, : degree + 1], windows.amplitude),
            turning=_smooth(powers[:, : degree + 1], turning),
            rest=_smooth(powers[:, : rest_degree + 1], windows.offset),
            angular_frequency=omega,
            degree=degree,
            rest_degree=rest_degree,
        )

    def phase(self, t: F8) -> F8:
        """Return the total phase at t (n,), rad."""
        return np.asarray(self.angular_frequency * (t - self.t[0]) + np.interp(t, self.t, self.turning))

    def position(self, t: F8) -> F8:
        """Return the sum of rest position and oscillation at t (n,), m."""
        return np.asarray(self.swing(t) + np.interp(t, self.t, self.rest))

    def swing(self, t: F8) -> F8:
        """Return the oscillation about the rest position at t (n,), m."""
        return np.asarray(np.interp(t, self.t, self.amplitude) * np.cos(self.phase(t)))

    def wave(self, t: F8) -> C16:
        """Return the oscillation at t (n,): :math:`e^{i\\varphi}` times the amplitude relative to its maximum."""
        relative = np.interp(t, self.t, self.amplitude / float(np.max(self.amplitude)))
        return rotating(relative, self.phase(t))


def rotating(size: F8, angle: F8) -> C16:
    """Return size (n,) times :math:`e^{i\\,\\mathrm{angle}}` in a quarter of numpy's time for complex exponentials."""
    wave = np.empty(angle.shape, np.complex128)
    np.multiply(size, np.cos(angle), out=wave.real)
    np.multiply(size, np.sin(angle), out=wave.imag)
    return wave


def _smooth(powers: F8, y: F8) -> F8:
    """Fit a polynomial to points (w,) without outliers; return it at all points and two end nodes, (w + 2,)."""
    design, most = powers[1:-1], 2 * powers.shape[1]
    values = np.linalg.lstsq(design, y, rcond=None)[0]
    away = np.abs(y - design @ values)
    kept = away <= OUTLIER * mad_sigma(away)
    if np.count_nonzero(kept) > most and not kept.all():
        values = np.linalg.lstsq(design[kept], y[kept], rcond=None)[0]
    return np.asarray(powers @ values)


@dataclass(frozen=True, slots=True, eq=False)
class Mode:
    """One oscillation beside the main one: :math:`\\mathrm{Re}\\,E(t) w(t)`.

    The envelope E is a polynomial in time and the wave w is a complex oscillation. It has the mode's own frequency with
    an exponential decay, or it is a power of the main wave.
    """

    turns: int  # power of the main wave; 0 for an independent mode
    frequency_hz: float
    # First and last time used, s. Outside this span, envelope and decay factor keep their values at its ends.
    span: tuple[float, float]
    coefficients: C16  # (degree + 1,) m, coefficients of the envelope, in Legendre polynomials over ``span``
    decay: float = 0.0  # logarithmic decay rate of an independent mode's wave, 1/s
    amplitude: float = 0.0  # root mean square of :math:`|E w|` over the record

    @property
    def kind(self) -> Literal["mode", "harmonic"]:
        """Kind of the mode: independent, or a multiple of the main frequency."""
        return "harmonic" if self.turns else "mode"

    def wave(self, t: F8, main: C16) -> C16:
        """Return w at times t (n,), given the wave (n,) of the main oscillation."""
        if self.turns:
            return np.asarray(math.prod([main] * (self.turns - 1), start=main))
        reach, angle = 0.5 * (self.span[1] - self.span[0]), 2.0 * math.pi * self.frequency_hz * (t - self.span[0])
        return rotating(np.exp(-self.decay * reach * self._x(t)), angle)

    def envelope(self, t: F8) -> C16:
        """Return E at times t (n,), m."""
        return np.asarray(np.polynomial.legendre.legval(self._x(t), self.coefficients))

    def columns(self, t: F8, wave: C16) -> F8:
        """Return the columns (n, 2 (degree + 1)) that belong to the coefficients' real and imaginary parts."""
        powers = np.polynomial.legendre.legvander(self._x(t), self.coefficients.size - 1)
        # Re (x + iy) w = x Re w - y Im w
        return np.stack([powers * wave.real[:, None], -powers * wave.imag[:, None]], axis=2).reshape(t.size, -1)

    def _x(self, t: F8) -> F8:
        start, end = self.span
        return np.asarray(np.clip(2.0 * (t - start) / (end - start) - 1.0, -1.0, 1.0))


@dataclass(frozen=True, slots=True, eq=False)
class Modes:
    """All modes found, the strongest independent mode first, and whether they were subtracted from the samples."""

    samples: Samples  # on which later stages work: without the modes, if these were subtracted
    members: tuple[Mode, ...] = ()
    carrier: Carrier | None = None  # main oscillation; None if the record is too short, or too long, for a search
    # (n,) sum of the modes at the record's times. None if it is not subtracted, because it would bias the amplitude by
    # less than a tenth of its uncertainty.
    subtracted: F8 | None = None
    leak: float = 0.0  # bias of the amplitude that the modes would cause

    def columns(self, t: F8) -> F8:
        """Return the basis (n, k) of all modes at times t (n,) for a fit that is linear in them."""
        columns = (mode.columns(t, wave) for mode, wave in self._waves(t))
        return np.concatenate([np.empty((t.size, 0)), *columns], axis=1)

    def position(self, t: F8) -> F8:
        """Return the contribution of all modes to the distance at t (n,), m."""
        total = np.zeros(t.size)
        for mode, wave in self._waves(t):
            total += (mode.envelope(t) * wave).real
        return total

    def independent(self, t: F8) -> F8 | float:
        """Return what the independent modes contributed at t (n,), m, if they were subtracted; 0 otherwise."""
        own = tuple(mode for mode in self.members if mode.kind == "mode")
        return 0.0 if self.subtracted is None else replace(self, members=own).position(t)

    def _waves(self, t: F8) -> Iterator[tuple[Mode, C16]]:
        if self.carrier is None or not self.members:
            return
        main = self.carrier.wave(t)
        for mode in self.members:
            yield mode, mode.wave(t, main)
