"""Modes: oscillations beside the main one, as functions of time and as columns of a linear fit."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pipeline.numerics.estimate import Estimate
from pipeline.oscillation.carrier import Carrier
from pipeline.track import F8

__all__ = ["Mode", "Sideways"]


@dataclass(frozen=True, slots=True, eq=False)
class Mode:
    """One oscillation beside the main one: :math:`\\mathrm{Re}\\,E(t) e^{i\\theta(t)}`.

    Parameters
    ----------
    kind : {"mode", "harmonic", "product"}
        Of its own frequency; a multiple of the main one's; or a sum or difference of turns of both.
    turns : (int, int)
        Of the first mode and of the main oscillation; (1, 0) is a mode by itself.
    frequency : Estimate
        Mean, Hz.
    amplitude : Estimate
        Root mean square of the envelope :math:`|E|` over the record, m.
    decay : Estimate
        Logarithmic rate of the envelope, 1/s; 0 for harmonics and products.
    false_alarm : float
        Probability that a record without it shows it.
    carrier : Carrier
    base : Mode or None
        The mode that a product is made of.
    degree : int
        Of the polynomial that the envelope is beside its exponential.
    coefficients : (2 (degree + 1),) float64, m
        Of :meth:`columns`.
    """

    kind: Literal["mode", "harmonic", "product"]
    turns: tuple[int, int]
    frequency: Estimate
    amplitude: Estimate
    decay: Estimate
    false_alarm: float
    carrier: Carrier
    base: Mode | None
    degree: int
    coefficients: F8

    def columns(self, t: F8) -> F8:
        """Return the basis (n, 2 (degree + 1)) at times t (n,): cosines, then sines, times the envelope's powers."""
        a, b = self.turns
        if self.kind == "mode":
            angle, shape = self.angle(t), self.fall(t)
        else:
            angle, shape = b * self.carrier.phase(t), self.carrier.relative(t) ** abs(b)
            if self.base is not None:
                envelope = self.base.envelope(t)
                angle = angle + a * np.angle(envelope) + a * self.base.angle(t)
                shape = shape * (np.abs(envelope) / self.base.amplitude.value) ** abs(a)
        powers = np.polynomial.legendre.legvander(self._x(t), self.degree) * shape[:, None]
        return np.concatenate([powers * np.cos(angle)[:, None], powers * np.sin(angle)[:, None]], axis=1)

    def position(self, t: F8) -> F8:
        """Return what the mode adds to the distance at t (n,), m."""
        return np.asarray(self.columns(t) @ self.coefficients)

    def angle(self, t: F8) -> F8:
        """Return the phase of a mode of its own at t (n,) less its envelope's, rad."""
        return np.asarray(2.0 * math.pi * self.frequency.value * (t - self.carrier.t[0]))

    def fall(self, t: F8) -> F8:
        """Return the exponential that a mode of its own follows, 1 in the middle of the record."""
        middle = 0.5 * (self.carrier.t[0] + self.carrier.t[-1])
        reach = np.clip(t, self.carrier.t[0], self.carrier.t[-1]) - middle
        return np.asarray(np.exp(-self.decay.value * reach))

    def envelope(self, t: F8) -> NDArray[np.complex128]:
        """Return the complex envelope E at t (n,), m."""
        powers = np.polynomial.legendre.legvander(self._x(t), self.degree) * self.fall(t)[:, None]
        half = self.degree + 1
        return np.asarray(powers @ (self.coefficients[:half] - 1j * self.coefficients[half:]))

    def _x(self, t: F8) -> F8:
        start, end = self.carrier.t[0], self.carrier.t[-1]
        return np.asarray(np.clip(2.0 * (t - start) / (end - start) - 1.0, -1.0, 1.0))


@dataclass(frozen=True, slots=True, eq=False)
class Sideways:
    """Every mode found, the strongest of its own frequency first.

    Parameters
    ----------
    modes : tuple of Mode
    carrier : Carrier or None
        None where the record is too short to look.
    """

    modes: tuple[Mode, ...]
    carrier: Carrier | None

    def __bool__(self) -> bool:
        return bool(self.modes)

    def columns(self, t: F8) -> F8:
        """Return the basis (n, k) of all modes at times t (n,) for a fit that is linear in them."""
        return np.concatenate([np.empty((t.size, 0)), *(mode.columns(t) for mode in self.modes)], axis=1)

    def position(self, t: F8) -> F8:
        """Return what all modes add to the distance at t (n,), m."""
        total = np.zeros(t.size)
        for mode in self.modes:
            total += mode.position(t)
        return total
