"""Carrier: the main oscillation as the windows show it, whatever damping law it follows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.numerics.robust import mad_sigma
from pipeline.oscillation.demodulate import Demodulated
from pipeline.track import F8

__all__ = ["C16", "Carrier", "rotating"]

C16 = NDArray[np.complex128]


@dataclass(frozen=True, slots=True, eq=False)
class Carrier:
    """The main oscillation as the windows show it, smooth, whatever law it follows.

    Parameters
    ----------
    t : (k,) float64, s
        Nodes: the windows' centres and the record's ends.
    amplitude, turning, rest : (k,) float64, m, rad, m
        At the nodes; ``turning`` is the phase beyond ``angular_frequency`` times t - t[0].
    angular_frequency : float, rad/s
    degree, rest_degree : int
        Of the polynomials in time.
    """

    t: F8
    amplitude: F8
    turning: F8
    rest: F8
    angular_frequency: float
    degree: int
    rest_degree: int

    @classmethod
    def through(cls, demodulated: Demodulated, start: float, end: float) -> Carrier:
        """Draw polynomials through the windows' amplitudes, phases and rest positions."""
        t, omega = demodulated.t, demodulated.angular_frequency
        degree, rest_degree = min(8, max(1, t.size // 6)), min(6, max(1, t.size // 10))
        turning = demodulated.phase - omega * (t - start)
        nodes = np.concatenate([[start], t, [end]])
        centre, half = 0.5 * (t[0] + t[-1]), 0.5 * (t[-1] - t[0])
        powers = np.polynomial.legendre.legvander((nodes - centre) / half, max(degree, rest_degree))
        return cls(
            nodes,
            _smooth(powers[:, : degree + 1], demodulated.amplitude),
            _smooth(powers[:, : degree + 1], turning),
            _smooth(powers[:, : rest_degree + 1], demodulated.offset),
            omega,
            degree,
            rest_degree,
        )

    def phase(self, t: F8) -> F8:
        """Return the total phase at t (n,), rad."""
        return np.asarray(self.angular_frequency * (t - self.t[0]) + np.interp(t, self.t, self.turning))

    def position(self, t: F8) -> F8:
        """Return rest position and oscillation at t (n,), m."""
        return np.asarray(self.swing(t) + np.interp(t, self.t, self.rest))

    def swing(self, t: F8) -> F8:
        """Return the oscillation about the rest position at t (n,), m."""
        return np.asarray(np.interp(t, self.t, self.amplitude) * np.cos(self.phase(t)))

    def wave(self, t: F8) -> C16:
        """Return the oscillation at t (n,) as :math:`e^{i\\varphi}` times the amplitude over its largest value."""
        relative = np.interp(t, self.t, self.amplitude / float(np.max(self.amplitude)))
        return rotating(relative, self.phase(t))


def rotating(size: F8, angle: F8) -> C16:
    """Return size (n,) times :math:`e^{i\\,\\mathrm{angle}}`: a fourth of the time of numpy's complex exponential."""
    wave = np.empty(angle.shape, np.complex128)
    np.multiply(size, np.cos(angle), out=wave.real)
    np.multiply(size, np.sin(angle), out=wave.imag)
    return wave


def _smooth(powers: F8, y: F8) -> F8:
    """Polynomial through points (w,), without those far off, at the points and a node before and after, (w + 2,)."""
    design, most = powers[1:-1], 2 * powers.shape[1]
    values = np.linalg.lstsq(design, y, rcond=None)[0]
    away = np.abs(y - design @ values)
    kept = away <= 5.0 * mad_sigma(away)
    if np.count_nonzero(kept) > most and not kept.all():
        values = np.linalg.lstsq(design[kept], y[kept], rcond=None)[0]
    return np.asarray(powers @ values)
