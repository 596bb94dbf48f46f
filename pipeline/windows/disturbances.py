"""Disturbances: modes beside the main oscillation, found and subtracted where they would do harm."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from pipeline.numerics.levels import NEGLIGIBLE
from pipeline.samples.condition import Conditioned
from pipeline.track import F8
from pipeline.windows.cycles import Cycles
from pipeline.windows.demodulate import Demodulated, demodulate
from pipeline.windows.modes import Sideways
from pipeline.windows.sideways import find_sideways


@dataclass(frozen=True, slots=True, eq=False)
class Disturbances:
    """The effects found beside the main oscillation."""

    conditioned: Conditioned  # the record without these effects, on which later stages work
    sideways: Sideways  # modes and harmonics
    # Whether ``sideways`` was subtracted, since it would bias the amplitude by over a tenth of its uncertainty.
    modelled: bool
    leak_m: float  # bias of the amplitude that ``sideways`` would cause, m
    position: F8  # (n,) m, sum of the subtracted effects at the record's times

    @classmethod
    def nothing(cls, conditioned: Conditioned) -> Disturbances:
        """Return disturbances of which none was found, or none was searched for."""
        return cls(conditioned, Sideways((), None), False, 0.0, np.zeros(len(conditioned.track)))

    def __bool__(self) -> bool:
        return self.modelled

    def columns(self, t: F8) -> F8:
        """Return (n, k): the subtracted effects at t (n,), as columns of a linear fit."""
        return self.sideways.columns(t) if self.modelled else np.empty((t.size, 0))


def separate(
    conditioned: Conditioned,
    cycles: Cycles,
    demodulated: Demodulated,
    *,
    modes: bool = True,
) -> tuple[Demodulated, Disturbances]:
    """Search for modes, and demodulate again without them.

    A mode of amplitude B at a distance :math:`\\Delta f` from the main frequency leaves up to
    :math:`B/(\\pi\\,\\Delta f\\,T)` in the amplitude of a record of length T. If this is less than a tenth of the
    amplitude's standard uncertainty for every mode, the modes are reported but not subtracted. If they are subtracted,
    the windows' variances are increased, because the modes are estimated from the same samples.
    """
    sideways = find_sideways(conditioned, demodulated) if modes else Sideways((), None)
    leak_m = _leak(sideways)
    modelled = bool(sideways) and leak_m > NEGLIGIBLE * _u_amplitude(demodulated)
    t, taken = conditioned.track.t, np.zeros(len(conditioned.track))
    for again in (False, True) if modelled else ():
        if again:
            # Windows fitted without the modes separate false echoes from the main oscillation better.
            sideways = find_sideways(conditioned, demodulated) or sideways
        taken = sideways.position(t)
        demodulated = demodulate(conditioned.less(taken), cycles)
    if modelled:
        demodulated = replace(demodulated, covariance=demodulated.covariance * _price(sideways))
    return demodulated, Disturbances(conditioned.less(taken), sideways, modelled, leak_m, taken)


def _u_amplitude(demodulated: Demodulated) -> float:
    return 1.0 / math.sqrt(float(np.sum(1.0 / np.maximum(demodulated.covariance[:, 0, 0], 1e-300))))


def _price(sideways: Sideways) -> float:
    """Return the factor by which variances grow because the modes were estimated from the same samples.

    It is the largest of the factors for rest position, amplitude, phase, frequency and decay. They follow from the
    normal equations with and without the modes' columns, at twelve times per period.
    """
    carrier = sideways.carrier
    assert carrier is not None
    start, end = carrier.t[0], carrier.t[-1]
    t = np.linspace(start, end, int(12 * (end - start) * carrier.angular_frequency / (2.0 * math.pi)))
    wave, x = carrier.wave(t), (t - start) / (end - start) - 0.5
    pair = np.array([wave.real, wave.imag])
    main = np.concatenate([np.ones((1, t.size)), pair, x * pair])
    both = np.concatenate([main, sideways.columns(t).T])
    both /= np.linalg.norm(both, axis=1)[:, None]
    alone = np.linalg.pinv(both[:5] @ both[:5].T, hermitian=True)
    together = np.linalg.pinv(both @ both.T, hermitian=True)[:5, :5]
    return max(1.0, float(np.max(np.diag(together) / np.diag(alone))))


def _leak(sideways: Sideways) -> float:
    """Return the maximum bias that any mode would cause in the amplitude of the main oscillation, m."""
    if sideways.carrier is None:
        return 0.0
    carrier = sideways.carrier
    main, seconds = carrier.angular_frequency / (2.0 * math.pi), float(carrier.t[-1] - carrier.t[0])
    return max(
        (mode.amplitude_m / (math.pi * abs(mode.frequency_hz - main) * seconds) for mode in sideways.modes),
        default=0.0,
    )
