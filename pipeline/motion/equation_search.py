"""Search for the solution of the equation of motion that a record follows: starts, false echoes, laws."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pipeline.damping.evidence import choose, least_chi2, weigh
from pipeline.damping.law_fit import Minimum
from pipeline.damping.laws import LAWS
from pipeline.damping.select import Damping, LawFit
from pipeline.damping.select import Params as DampingParams
from pipeline.motion.equation_model import COEFFICIENTS, STATE, STEP, FreeMotion, envelope
from pipeline.numerics import least_squares
from pipeline.numerics.regression import correlation_length
from pipeline.numerics.robust import mad_sigma
from pipeline.oscillation.condition import Conditioned
from pipeline.oscillation.demodulate import Demodulated
from pipeline.track import F8, UNUSABLE

__all__ = ["Search"]

NAMES = (*STATE, *COEFFICIENTS)
PRECISION = 0.01  # of the standard uncertainties, at which a fit stops
FEW = 6  # windows under which the laws of the amplitude say too little to start from
COARSE, ROUGH, FIRST_STEPS = 0.2, 0.1, 30  # step in rad, precision and most steps while a start is looked for
SETTLED = 1.05  # times the noise: what a fit of the richest law may leave and need no other start
HOPELESS = 1000.0  # rise of chi-square, to first order, from which a law is not fitted any more


class Search:
    """One record: what is compared, and with which samples.

    Parameters
    ----------
    conditioned : Conditioned
    used : (n,) bool
        The samples to begin with.
    damping : Damping
        The laws of the amplitude.
    theta : (7,) float64
        Rest position, displacement, velocity, angular frequency and the coefficients to begin with.
    laws : list of str
        Names of the laws to be fitted, the richest last.
    stop : int or None
        Index of the sample by which the bob has stopped for good.
    """

    def __init__(
        self,
        conditioned: Conditioned,
        used: NDArray[np.bool_],
        damping: Damping,
        theta: F8,
        laws: list[str],
        stop: int | None,
    ) -> None:
        self.conditioned, self.damping, self.laws = conditioned, damping, laws
        self.richest = laws[-1]
        self.theta = theta
        quantum = (conditioned.quantum_m or 0.0) / math.sqrt(12.0)
        floor = 1e-9 * float(np.hypot(theta[1], theta[2] / theta[3]))
        self.expected_m = self.noise_m = max(conditioned.noise_m, quantum, floor)
        self.clip_sigmas, self.step = 4.0, STEP
        # Samples of a bob at rest show noise alone, and in their number hide what the moving ones do not fit.
        self.stopped = stop is not None
        self.within = conditioned.used & (np.arange(used.size) < (used.size if stop is None else stop))
        self.used = used & self.within
        track = conditioned.track
        last = float(np.max(track.t[conditioned.used]))
        inside = np.clip(np.where(np.isfinite(track.t), track.t, damping.t0), damping.t0, last) - damping.t0
        self.elapsed: F8 = inside
        self.size_m = float(np.hypot(theta[1], theta[2] / theta[3]))

    @classmethod
    def of(
        cls,
        conditioned: Conditioned,
        demodulated: Demodulated,
        damping: Damping,
        laws: list[str],
        stop: int | None,
        clip_sigmas: float,
    ) -> Search:
        """Start from the windows: of their false echoes, those that the model explains come back later."""
        omega, first = demodulated.angular_frequency, damping.best.joint.values[0]
        angle = float(demodulated.phase[0]) - omega * (float(demodulated.t[0]) - damping.t0)
        rest = float(np.average(demodulated.offset, weights=np.maximum(demodulated.amplitude, 0.0) ** 2))
        task = cls(
            conditioned,
            (demodulated.flags & UNUSABLE) == 0,
            damping,
            np.array([rest, first * math.cos(angle), -first * omega * math.sin(angle), omega, 0.0, 0.0, 0.0]),
            laws,
            stop,
        )
        task.clip_sigmas = clip_sigmas
        task.step = COARSE
        task.theta = task.first(demodulated)
        task.step = STEP
        return task

    def first(self, demodulated: Demodulated) -> F8:
        """Return the richest law's fit from the best two of what the amplitude's laws, or a grid of them, say."""
        starts = []
        for name in self.laws:
            law, fit = LAWS[name], self.damping.fits.get(name)
            if fit is None and demodulated.t.size < len(law.parameters):
                continue
            values = (
                law.guess(demodulated.t - self.damping.t0, demodulated.amplitude) if fit is None else fit.joint.values
            )
            theta = self.theta.copy()
            theta[self.slots(name)[len(STATE) :]] = np.maximum(values[1:], 0.0)
            starts.append(theta)
        if demodulated.t.size < FEW or self.stopped:
            starts += self.grid()
        model, y = self.model(), self.conditioned.track.y[self.used]
        costs = [float(np.sum((model.position(theta) - y) ** 2)) for theta in starts]
        best = np.argsort(np.where(np.isfinite(costs), costs, np.inf))[
            : 4 if self.stopped or demodulated.t.size < FEW else 1
        ]
        ends = [self.fit(self.richest, starts[i], ROUGH, FIRST_STEPS) for i in best]
        end = min(ends, key=lambda end: end.cost)
        if self.stopped and not self.settled(end):
            # Where friction ends the motion the number of swings is whole, and each number has a minimum of its own.
            others = self.exchanged(self.full(self.richest, end.values)) + self.by_friction(starts[int(best[0])])
            tried = [self.fit(self.richest, start, ROUGH, FIRST_STEPS) for start in others]
            end = min([end, *tried], key=lambda end: end.cost)
        return self.full(self.richest, end.values)

    def settled(self, end: least_squares.Fit) -> bool:
        """Whether a fit leaves noise alone with no term that drives: no other minimum can be better."""
        rms = math.sqrt(end.cost / max(int(np.count_nonzero(self.used)) - len(NAMES), 1))
        least = -2.0 * np.sqrt(np.diag(end.covariance))
        return rms < SETTLED and bool(np.all((end.values > least)[len(STATE) :]))

    def by_friction(self, theta: F8) -> list[F8]:
        """Return where the simpler laws with friction end: none of their terms hides in another's negative."""
        slot = NAMES.index("mu")
        # Friction alone that takes as much as all terms do, at half the first amplitude.
        share = (0.5 * self.size_m) ** np.array([0.0, 1.0, 2.0])
        start = theta.copy()
        start[len(STATE) :] = 0.0
        start[slot] = float(np.maximum(theta[len(STATE) :], 0.0) @ share)
        names = [n for n in self.laws if "mu" in LAWS[n].parameters and n != self.richest]
        return [self.full(name, self.fit(name, start, ROUGH, FIRST_STEPS).values) for name in names]

    def exchanged(self, theta: F8) -> list[F8]:
        """Return starts with one kind of damping put in place of another, alike at half the first amplitude."""
        share = (0.5 * self.size_m) ** np.array([-1.0, 0.0, 1.0])
        rates = np.maximum(theta[len(STATE) :], 0.0) * share
        found = []
        present = [NAMES.index(c) - len(STATE) for c in LAWS[self.richest].parameters[1:]]
        for one in present:
            others = [j for j in present if j != one]
            for weights in ((1.0, 0.0), (0.0, 1.0), (0.5, 0.5))[: 3 if len(others) == 2 else 1]:
                moved = rates.copy()
                moved[one] = 0.0
                for other, weight in zip(others, weights, strict=False):
                    moved[other] += weight * rates[one]
                start = theta.copy()
                start[len(STATE) :] = moved / share
                found.append(start)
        return found

    def grid(self) -> list[F8]:
        """Return starts from the first samples' parabola, for each kind of damping and a range of its strength."""
        y = self.conditioned.track.y[self.used]
        tau = self.elapsed[self.used]
        rest = float(np.median(y[-max(y.size // 10, 5) :]))
        omega = float(self.theta[3])
        early = tau < 0.8 / omega
        found: list[F8] = []
        if np.count_nonzero(early) < 5:
            return found
        speed, level = np.polynomial.polynomial.polyfit(tau[early], y[early] - rest, 2)[1::-1]
        scale = np.array([np.hypot(level, speed / omega) * omega, omega, omega / np.hypot(level, speed / omega)])
        for near in (0.9, 1.0, 1.1):
            for ratio in (0.03, 0.06, 0.1, 0.15, 0.25):
                for kind in range(3):
                    theta = np.array([rest, level, speed, near * omega, 0.0, 0.0, 0.0])
                    theta[len(STATE) + kind] = ratio * scale[kind]
                    found.append(theta)
        return found

    def model(self, rows: NDArray[np.bool_] | None = None) -> FreeMotion:
        """Return the motion at the samples used, or at others."""
        return FreeMotion(
            self.elapsed[self.used if rows is None else rows], float(self.theta[3]), self.size_m, self.step
        )

    def clean(self, rounds: int = 3) -> None:
        """Fit the richest law until the set of false echoes stays; its residual is the noise, infinite without any."""
        every = np.ones(self.used.size, np.bool_)
        for _ in range(rounds):
            fit = self.fit(self.richest, self.theta)
            self.theta = self.full(self.richest, fit.values)
            whole = self.model(every).position(self.theta)
            residual = self.conditioned.track.y - whole
            candidates = self.within & ~self.conditioned.near_plateau(whole, self.noise_m)
            spread = max(mad_sigma(residual[candidates]), self.expected_m)
            kept = candidates & (np.abs(residual) <= self.clip_sigmas * spread)
            if np.count_nonzero(kept) <= len(NAMES):
                # It explains no sample: no motion that these laws know.
                self.noise_m = math.inf
                return
            same = np.array_equal(kept, self.used)
            self.used = kept
            if same:
                break
        free = max(int(np.count_nonzero(self.used)) - len(NAMES), 1)
        self.noise_m = max(math.sqrt(float(np.sum(residual[self.used] ** 2)) / free), 0.01 * self.expected_m)
        self.correlation = correlation_length(residual[self.used])

    def slots(self, name: str) -> list[int]:
        """Places of a law's parameters among all."""
        return [*range(len(STATE)), *(NAMES.index(c) for c in LAWS[name].parameters[1:])]

    def full(self, name: str, values: F8) -> F8:
        """All parameters, absent coefficients zero."""
        theta = np.zeros(len(NAMES))
        theta[self.slots(name)] = values
        return theta

    def fit(self, name: str, start: F8, precision: float = PRECISION, steps: int = 60) -> least_squares.Fit:
        """Fit one law to the samples used, in units of their noise."""
        model, slots = self.model(), self.slots(name)
        y = self.conditioned.track.y[self.used]

        def residuals(values: F8) -> F8:
            return np.asarray((model.position(self.full(name, values)) - y) / self.noise_m)

        def jacobian(values: F8) -> F8:
            return np.asarray(model.derivatives(self.full(name, values), slots) / self.noise_m)

        options = least_squares.Params(precision=precision, steps=steps)
        return least_squares.minimise(residuals, start[slots], jacobian, options)

    def choose(self, laws: DampingParams) -> tuple[Damping, least_squares.Fit] | None:
        """Fit every law and choose among them; None where no fit converged."""
        unfitted = {n: "it has no equation of motion" for n in self.damping.fits if n not in self.laws}
        whole = self.fit(self.richest, self.theta)
        # Where the richest law ended at a term that drives, say, the way from there to the others is no straight one.
        own = self.weigh({self.richest: whole}, laws) if np.all(np.isfinite(whole.covariance)) else {}
        holds = bool(own) and not own[self.richest].rejected
        fits: dict[str, least_squares.Fit] = {}
        for name in reversed(self.laws):
            start, rise = self.without(name, whole) if holds else (self.full(self.richest, whole.values), 0.0)
            if rise > HOPELESS * self.correlation:
                unfitted[name] = f"in the equation of motion it would raise chi-square by about {rise:.2g}"
                continue
            fit = whole if name == self.richest else self.fit(name, start)
            if np.all(np.isfinite(fit.covariance)):
                fits[name] = fit
            else:
                unfitted[name] = f"its equation of motion was not solved for its coefficients: {fit.tried}"
        weighed = self.weigh(fits, laws)
        if not weighed:
            return None
        last = float(np.max(self.elapsed))
        selected, admissible = choose(
            weighed, laws.evidence, lambda name: weighed[name].amplitude(np.array([0.0, last]))
        )
        scatter = replace(self.damping.scatter, correlation=self.correlation)
        damping = Damping(self.damping.t0, weighed, selected, admissible, scatter, unfitted)
        return damping, fits[selected]

    def without(self, name: str, whole: least_squares.Fit) -> tuple[F8, float]:
        """Return where a special case of the richest law should end, and the rise of chi-square, to first order."""
        slots = self.slots(self.richest)
        absent = [i for i, slot in enumerate(slots) if slot not in self.slots(name)]
        if not absent:
            return self.full(self.richest, whole.values), 0.0
        pull = np.linalg.solve(whole.covariance[np.ix_(absent, absent)], whole.values[absent])
        values = whole.values - whole.covariance[:, absent] @ pull
        return self.full(self.richest, values), float(whole.values[absent] @ pull)

    def weigh(self, fits: Mapping[str, least_squares.Fit], laws: DampingParams) -> dict[str, LawFit]:
        """Hold each law to the noise, with the amplitude at the start in place of displacement and velocity."""
        found = {}
        for name, fit in fits.items():

            def start(values: F8, name: str = name) -> F8:
                return np.array([envelope(*self.full(name, values)[1:].tolist())[0]])

            *_, u_envelope = envelope(*self.full(name, fit.values)[1:].tolist())
            turn = np.zeros((len(LAWS[name].parameters), fit.values.size))
            turn[0] = least_squares.central_differences(start, fit.values)[0]
            turn[1:, len(STATE) :] = np.eye(len(LAWS[name].parameters) - 1)
            covariance = turn @ fit.covariance @ turn.T
            covariance[0, 0] += u_envelope**2
            theta = np.concatenate([start(fit.values), fit.values[len(STATE) :]])
            found[name] = Minimum(theta, covariance, fit.cost, fit.converged, fit.tried)
        least = least_chi2(found)
        points = int(np.count_nonzero(self.used)) - len(STATE) + 1
        return {n: weigh(LAWS[n], fit, least[n], points, self.correlation, laws.rejection) for n, fit in found.items()}
