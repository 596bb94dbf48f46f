"""Search for the solution of the equation of motion that a record follows: start values, false echoes, law.

1. :func:`samples_of` collects the samples with which a solution is compared.
2. :func:`first_solution` fits the law with most parameters from several start values until a solution is acceptable.
3. :func:`without_echoes` repeats this fit until the set of false echoes is stable; the residual gives the noise.
4. :func:`choose_law` fits the other laws to the same samples and selects one law.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pipeline.damping.evidence import NEGATIVE, least_chi2, weigh
from pipeline.damping.law_fit import LawFit, Minimum
from pipeline.damping.laws.drag import COEFFICIENTS, Drag
from pipeline.damping.select import REJECTION, Damping, select_law
from pipeline.motion.equation_model import STATE, FreeMotion, envelope
from pipeline.numerics import least_squares
from pipeline.numerics.least_squares import Fit
from pipeline.numerics.regression import correlation_length
from pipeline.numerics.robust import mad_sigma
from pipeline.samples.condition import Conditioned
from pipeline.track import F8, UNUSABLE
from pipeline.windows.demodulate import Demodulated

COUNT = len(STATE) + len(COEFFICIENTS)


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """The samples with which a solution is compared.

    Parameters
    ----------
    conditioned : Conditioned
    elapsed : (n,) float64, s
        Time since the first sample used, limited to the range of the samples used.
    within : (n,) bool
        True for usable samples of the moving bob. Samples at rest show only noise, and many of them would hide a
        misfit of the moving samples.
    used : (n,) bool
        True for the samples of ``within`` that the windows used; false echoes that the solution explains return later.
    stopped : bool
        Whether the bob stops within the record and remains at rest.
    omega : float
        Approximate angular frequency, rad/s.
    size_m, expected_m : float
        Approximate first amplitude and expected noise of one sample, m.
    """

    conditioned: Conditioned
    elapsed: F8
    within: NDArray[np.bool_]
    used: NDArray[np.bool_]
    stopped: bool
    omega: float
    size_m: float
    expected_m: float

    def model(self, rows: NDArray[np.bool_] | slice = slice(None)) -> FreeMotion:
        """Return the model of the motion at selected samples, all by default."""
        return FreeMotion(self.elapsed[rows], self.omega, self.size_m)

    def fit(
        self,
        law: Drag,
        start: F8,
        rows: NDArray[np.bool_],
        noise_m: float,
    ) -> Fit:
        """Fit one law to selected samples in units of their noise, from start values of all parameters (7,)."""
        model, own, y = self.model(rows), slots(law), self.conditioned.track.y[rows]

        def residuals(values: F8) -> F8:
            return np.asarray((model.position(full(law, values)) - y) / noise_m)

        def jacobian(values: F8) -> F8:
            return np.asarray(model.derivatives(full(law, values), own) / noise_m)

        return least_squares.minimise(residuals, start[own], jacobian)


@dataclass(frozen=True, slots=True, eq=False)
class Cleaned:
    """The solution of the law with most parameters, and the samples to which it was fitted.

    Parameters
    ----------
    theta : (7,) float64
        Rest position, displacement, velocity, angular frequency and the coefficients.
    used : (n,) bool
        True for the samples of the fit.
    noise_m, correlation : float
        Root mean square of the residual, and its correlation length as a number of samples.
    """

    theta: F8
    used: NDArray[np.bool_]
    noise_m: float
    correlation: float


def slots(law: Drag) -> list[int]:
    """Return the indices of a law's state and coefficients among all parameters."""
    return [*range(len(STATE)), *(len(STATE) + power for power in law.powers)]


def full(law: Drag, values: F8) -> F8:
    """Return all parameters (7,) from those of a law, with zero for absent coefficients."""
    theta = np.zeros(COUNT)
    theta[slots(law)] = values
    return theta


def samples_of(conditioned: Conditioned, demodulated: Demodulated, damping: Damping, stop: int | None) -> Samples:
    """Collect the samples; ``stop`` is the index of the first sample at which the bob is at rest."""
    track, size_m = conditioned.track, abs(float(damping.best.joint.values[0]))
    within = conditioned.used & (np.arange(track.t.size) < (track.t.size if stop is None else stop))
    last = float(np.max(track.t[conditioned.used]))
    elapsed: F8 = np.clip(np.where(np.isfinite(track.t), track.t, damping.t0), damping.t0, last) - damping.t0
    quantum = (conditioned.quantum_m or 0.0) / math.sqrt(12.0)
    return Samples(
        conditioned,
        elapsed,
        within,
        within & ((demodulated.flags & UNUSABLE) == 0),
        stop is not None,
        demodulated.angular_frequency,
        size_m,
        max(conditioned.noise_m, quantum, 1e-9 * size_m),
    )


def first_solution(
    samples: Samples, demodulated: Demodulated, damping: Damping, laws: Sequence[Drag], misfit: float
) -> F8:
    """Return the solution (7,) of the law with most parameters: the first acceptable one, or else the best.

    Parameters
    ----------
    samples : Samples
    demodulated : Demodulated
    damping : Damping
    laws : sequence of Drag
        The laws, the one with most parameters last.
    misfit : float
        Maximum root mean square of an acceptable solution's residual, in units of the noise.

    Notes
    -----
    If friction ends the motion, chi-square has a separate minimum for each whole number of swings. A solution is
    unacceptable if its residual exceeds the noise or if a coefficient is negative. The first start is the best of
    those from the amplitude laws. Each further start is the fit of one kind of damping alone, itself started from the
    best point of a grid.
    """
    model, y = samples.model(samples.used), samples.conditioned.track.y[samples.used]

    def cost(theta: F8) -> float:
        squares = float(np.sum((model.position(theta) - y) ** 2))
        return squares if math.isfinite(squares) else math.inf

    ends: list[Fit] = []
    alone = [law for law in laws if len(law.powers) == 1]
    for law in (None, *alone):
        if law is None:
            start = min(_by_amplitude(demodulated, damping, laws), key=cost)
        else:
            first = min(_by_first_samples(samples, law), key=cost)
            start = full(law, samples.fit(law, first, samples.used, samples.expected_m).values)
        end = samples.fit(laws[-1], start, samples.used, samples.expected_m)
        ends.append(end)
        u = np.sqrt(np.diag(end.covariance))
        if end.cost <= misfit**2 * y.size and np.all((end.values >= -NEGATIVE * u)[len(STATE) :]):
            break
    return full(laws[-1], min(ends, key=lambda end: end.cost).values)


def _by_amplitude(demodulated: Demodulated, damping: Damping, laws: Sequence[Drag]) -> list[F8]:
    """Return start values without damping and with the coefficients of the amplitude laws."""
    omega, first = demodulated.angular_frequency, damping.best.joint.values[0]
    angle = float(demodulated.phase[0]) - omega * (float(demodulated.t[0]) - damping.t0)
    rest = float(np.average(demodulated.offset, weights=np.maximum(demodulated.amplitude, 0.0) ** 2))
    state = [rest, first * math.cos(angle), -first * omega * math.sin(angle), omega]
    starts = [np.array([*state, 0.0, 0.0, 0.0])]
    for law in laws:
        fit = damping.fits.get(law.name)
        if fit is not None:
            values = fit.joint.values
        elif demodulated.t.size >= len(law.parameters):
            values = law.guess(demodulated.t - damping.t0, demodulated.amplitude)
        else:
            continue
        starts.append(full(law, np.array([*state, *np.maximum(values[1:], 0.0)])))
    return starts


def _by_first_samples(samples: Samples, law: Drag) -> list[F8]:
    """Return start values from a parabola through the first samples, with a range of strengths of one damping term."""
    y, tau, omega = samples.conditioned.track.y[samples.used], samples.elapsed[samples.used], samples.omega
    rest = float(np.median(y[-max(y.size // 10, 5) :]))
    # The parabola is fitted to the samples of the first 0.8 rad, but to at least five.
    early = slice(max(int(np.count_nonzero(tau < 0.8 / omega)), 5))
    speed, level = np.polynomial.polynomial.polyfit(tau[early], y[early] - rest, 2)[1::-1]
    size = np.hypot(level, speed / omega)
    (power,) = law.powers
    return [
        full(law, np.array([rest, level, speed, near * omega, ratio * omega * size ** (1 - power)]))
        for near in (0.9, 1.0, 1.1)
        for ratio in (0.03, 0.06, 0.1, 0.15, 0.25)
    ]


def without_echoes(samples: Samples, law: Drag, start: F8, clip_sigmas: float, rounds: int = 3) -> Cleaned | None:
    """Fit a law until the set of false echoes is stable; return None if too few samples lie on the solution.

    Parameters
    ----------
    samples : Samples
    law : Drag
        The law with most parameters.
    start : (7,) float64
        Start values of all parameters.
    clip_sigmas : float
        Samples whose residuals exceed this many standard deviations are false echoes.
    rounds : int
        Maximum number of fits.
    """
    theta, used, y = start, samples.used, samples.conditioned.track.y
    for _ in range(rounds):
        theta = full(law, samples.fit(law, theta, used, samples.expected_m).values)
        whole = samples.model().position(theta)
        residual = y - whole
        candidates = samples.within
        spread = max(mad_sigma(residual[candidates]), samples.expected_m)
        kept = candidates & (np.abs(residual) <= clip_sigmas * spread)
        if np.count_nonzero(kept) <= COUNT:
            return None
        same, used = np.array_equal(kept, used), kept
        if same:
            break
    left = residual[used]
    noise_m = max(math.sqrt(float(left @ left) / max(left.size - COUNT, 1)), 0.01 * samples.expected_m)
    return Cleaned(theta, used, noise_m, correlation_length(left))


def choose_law(
    samples: Samples, cleaned: Cleaned, damping: Damping, laws: Sequence[Drag]
) -> tuple[Damping, Fit] | None:
    """Fit every law and select one; return None if no fit has a finite covariance.

    Parameters
    ----------
    samples : Samples
    cleaned : Cleaned
    damping : Damping
        The fits of the amplitude laws.
    laws : sequence of Drag
        The laws, the one with most parameters last.
    """
    richest = laws[-1]
    unfitted = {n: "it has no equation of motion" for n in damping.fits if n not in [law.name for law in laws]}
    whole = samples.fit(richest, cleaned.theta, cleaned.used, cleaned.noise_m)
    fits: dict[str, Fit] = {}
    for law in reversed(laws):
        fit = whole if law is richest else samples.fit(law, full(richest, whole.values), cleaned.used, cleaned.noise_m)
        if np.isfinite(fit.covariance).all():
            fits[law.name] = fit
        else:
            unfitted[law.name] = f"its equation of motion was not solved for its coefficients: {fit.tried}"
    if not fits:
        return None
    weighed = _weighed(cleaned, laws, fits)
    selected, admissible = select_law(weighed, damping.stated, float(np.max(samples.elapsed)))
    scatter = replace(damping.scatter, correlation=cleaned.correlation)
    return Damping(damping.t0, weighed, selected, admissible, scatter, unfitted, damping.stated), fits[selected]


def _weighed(cleaned: Cleaned, laws: Sequence[Drag], fits: Mapping[str, Fit]) -> dict[str, LawFit]:
    """Compare each law with the noise; the start amplitude replaces displacement and velocity as a parameter."""
    by_name = {law.name: law for law in laws if law.name in fits}
    minima = {name: _minimum(law, fits[name]) for name, law in by_name.items()}
    least = least_chi2(minima, by_name)
    points = int(np.count_nonzero(cleaned.used)) - len(STATE) + 1
    return {
        name: weigh(by_name[name], minima[name], least[name], points, cleaned.correlation, REJECTION) for name in fits
    }


def _minimum(law: Drag, fit: Fit) -> Minimum:
    """Return a law's fit, converted to the parameters of the amplitude law."""

    def start(values: F8) -> F8:
        return np.array([envelope(*full(law, values)[1:].tolist())[0]])

    *_, u_envelope = envelope(*full(law, fit.values)[1:].tolist())
    turn = np.zeros((len(law.parameters), fit.values.size))
    turn[0] = least_squares.central_differences(start, fit.values)[0]
    turn[1:, len(STATE) :] = np.eye(len(law.powers))
    covariance = turn @ fit.covariance @ turn.T
    covariance[0, 0] += u_envelope**2
    theta = np.concatenate([start(fit.values), fit.values[len(STATE) :]])
    return Minimum(theta, covariance, fit.cost, fit.converged, fit.tried)
