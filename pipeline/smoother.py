"""Smoother: position, velocity and acceleration of a noisy oscillator at every sample, without differences."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from pipeline.beside import Beside
from pipeline.chain import Chain
from pipeline.demodulate import Demodulated
from pipeline.errors import AnalysisError
from pipeline.lines import Blocks, smooth_density
from pipeline.phase import PhaseFit
from pipeline.rest import Rest
from pipeline.track import F8, UNUSABLE, Track

__all__ = ["Params", "Smoothed", "smooth"]

LONGEST = 100_000  # periods, beyond which noise is taken for white
LEAST_WEIGHT = 0.01  # of the likeliest memory's likelihood, that another must have to count


@dataclass(frozen=True, slots=True, kw_only=True)
class Params:
    """Options of :func:`smooth`.

    Parameters
    ----------
    nodes_per_period : int
        Of the walk; between them it is interpolated.
    most_nodes : int
        Longer records have nodes further apart.
    memories : int
        Trial values of the memory, from one period to thirty times the record, for the likelihood.
    """

    nodes_per_period: int = 4
    most_nodes: int = 100_000
    memories: int = 13


@dataclass(frozen=True, slots=True, eq=False)
class Smoothed:
    """The bob's motion along the line of sight.

    Parameters
    ----------
    t : (n,) float64, s
        The track's times.
    position, u_position : (n,) float64, m
        From the sensor, sideways modes left out.
    velocity, u_velocity : (n,) float64, m/s
        Of the oscillation about the rest position.
    acceleration, u_acceleration : (n,) float64, m/s^2
    noise_m : float
        Standard deviation of one sample about the smoothed motion, m.
    memory_s : float
        How long a stretch, before and after, speaks on a sample at the largest amplitude, s: the likeliest.
    """

    t: F8
    position: F8
    u_position: F8
    velocity: F8
    u_velocity: F8
    acceleration: F8
    u_acceleration: F8
    noise_m: float
    memory_s: float


@dataclass(frozen=True, slots=True, eq=False)
class _Carried:
    """The fitted oscillation at some times: what the walk is a factor of."""

    gain: F8  # amplitude over the largest
    cosine: F8
    sine: F8
    rate: F8  # angular frequency, rad/s
    decay: F8  # logarithmic, 1/s

    @classmethod
    def at(cls, t: F8, phase: PhaseFit, last: float) -> _Carried:
        law = phase.damping.best
        amplitude = law.amplitude(np.clip(t, phase.t0, last) - phase.t0)
        largest = float(np.max(law.amplitude(np.array([0.0, last - phase.t0]))))
        if not largest > 0.0:
            raise AnalysisError("the damping law leaves no amplitude to smooth: record while the bob swings")
        # A law may end at zero; the walk carries on from a thousandth.
        amplitude = np.maximum(amplitude, 1e-3 * largest)
        decay = law.law.rate(amplitude, law.joint.values) / amplitude
        angle = phase.total(t)
        return cls(amplitude / largest, np.cos(angle), np.sin(angle), phase.rate(t), decay)

    def rows(self) -> tuple[F8, F8, F8]:
        """Position, velocity and acceleration of a walk of 1 in either dimension, (2, n) each."""
        position = self.gain * np.array([self.cosine, -self.sine])
        quadrature = self.gain * np.array([self.sine, self.cosine])
        velocity = -self.decay * position - self.rate * quadrature
        acceleration = (self.decay**2 - self.rate**2) * position + 2.0 * self.decay * self.rate * quadrature
        return position, velocity, acceleration


def smooth(
    track: Track,
    demodulated: Demodulated,
    phase: PhaseFit,
    rest: Rest,
    beside: Beside | None = None,
    params: Params | None = None,
) -> Smoothed:
    """Estimate the motion at every sample from all samples, each weighted by what it can know.

    Parameters
    ----------
    track : Track
        As it came. Flagged samples are predicted, not used; times may be irregular.
    demodulated : Demodulated
        For its flags.
    phase : PhaseFit
        Carries the damping law.
    rest : Rest
    beside : Beside, optional
        Modes that were taken out.
    params : Params, optional

    Returns
    -------
    Smoothed
        NaN at samples without a finite time.

    Raises
    ------
    AnalysisError
        If fewer than eight samples are usable, or the law leaves no amplitude.

    Notes
    -----
    The oscillator :math:`\\ddot x + 2\\lambda\\dot x + (\\omega^2 + \\lambda^2) x = f` is driven by white noise f, with
    :math:`\\omega(t)` and :math:`\\lambda(t)` of the fitted phase and law. In the frame that turns and decays with it,
    :math:`x = g(t)\\,\\mathrm{Re}(z e^{i\\varphi(t)})`, its state z is a random walk in two dimensions, over half a
    period the same in both. Kalman filter and Rauch-Tung-Striebel smoother of that walk are solved in one go
    (:class:`pipeline.chain.Chain`); then :math:`\\dot x = g\\,\\mathrm{Re}((i\\omega - \\lambda) z e^{i\\varphi})`, and
    :math:`\\ddot x` has the factor squared. Nothing is differenced: noise at frequencies that an oscillator cannot
    follow never enters.

    The strength of the force, hence the memory, is averaged over by its likelihood, and the noise comes with it. A
    record that follows its law to the end has the memory of all its samples: then this is the global fit. What
    frequency and law are uncertain by is a polynomial in time added to z, one power for each of their parameters, whose
    coefficients are estimated along; so the ends, with one side missing, carry their larger uncertainty.
    Where noise is correlated samples count by its spectral density near the oscillation's frequency.
    Clock and speed of sound, which scale everything alike, are not in these uncertainties.
    """
    params = params or Params()
    known = np.isfinite(track.t)
    used = known & np.isfinite(track.y) & ((demodulated.flags & UNUSABLE) == 0)
    if np.count_nonzero(used) < 8:
        raise AnalysisError(f"a smoother needs eight usable samples at least, got {np.count_nonzero(used)}")
    t = track.t[used]
    swing = track.y[used] - rest.at(t)
    if beside is not None and beside.modelled:
        swing = swing - beside.sideways.position(t)
    used_carrier = _Carried.at(t, phase, float(t[-1]))
    walk = _Walk.of(t, swing, used_carrier, phase.angular_frequency.value, params)
    powers = max(len(phase.damping.best.law.parameters), phase.coefficients.size, 2) - 1
    mean, covariance, noise_m, memory_s = walk.coloured(t, swing, used_carrier, track.rate_hz).smooth(
        track.rate_hz, powers, params
    )
    at = np.where(known, track.t, t[0])
    carried = _Carried.at(at, phase, float(t[-1]))
    rows = carried.rows()
    z = np.array([np.interp(at, walk.t, each) for each in mean])
    spread = {(i, j): np.interp(at, walk.t, covariance[i, j]) for i, j in ((0, 0), (0, 1), (1, 1))}
    values, uncertainties = list[F8](), list[F8]()
    for row in rows:
        variance = row[0] ** 2 * spread[0, 0] + 2.0 * row[0] * row[1] * spread[0, 1] + row[1] ** 2 * spread[1, 1]
        values.append(np.where(known, row[0] * z[0] + row[1] * z[1], np.nan))
        uncertainties.append(np.where(known, np.sqrt(variance), np.nan))
    values[0] = values[0] + np.where(known, rest.at(at), np.nan)
    uncertainties[0] = np.hypot(uncertainties[0], rest.mean.u)
    return Smoothed(
        track.t,
        values[0],
        uncertainties[0],
        values[1],
        uncertainties[1],
        values[2],
        uncertainties[2],
        noise_m,
        memory_s,
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Walk:
    """Samples gathered at the walk's nodes."""

    t: F8
    information: F8
    score: F8
    gain: F8
    squares: float
    samples: int
    period: float
    noise_m: float | None = None

    @classmethod
    def of(cls, t: F8, swing: F8, carried: _Carried, omega: float, params: Params) -> _Walk:
        period = 2.0 * math.pi / omega
        span = float(t[-1] - t[0])
        step = max(period / params.nodes_per_period, span / params.most_nodes)
        _, index = np.unique(np.floor((t - t[0]) / step), return_inverse=True)
        count = np.bincount(index).astype(np.float64)
        h = carried.gain * np.array([carried.cosine, -carried.sine])
        information = np.empty((2, 2, count.size))
        for i, j in ((0, 0), (0, 1), (1, 1)):
            information[i, j] = information[j, i] = np.bincount(index, weights=h[i] * h[j])
        score = np.array([np.bincount(index, weights=row * swing) for row in h])
        middle = t[0] + np.bincount(index, weights=t - t[0]) / count
        gain = np.bincount(index, weights=carried.gain) / count
        return cls(middle, information, score, gain, float(swing @ swing), t.size, period)

    def coloured(self, t: F8, swing: F8, carried: _Carried, rate_hz: float) -> _Walk:
        """Return the walk with what was seen weakened where noise is stronger near the oscillation than on the whole.

        Else intervals would be those of as many independent samples. The density is read off half and
        twice the frequency, on what the shortest memory leaves, so that motion which wanders does not pass for noise.
        """
        if t.size < 64 or float(t[-1] - t[0]) > LONGEST * self.period:
            return self
        trial = _Trial.of(self, self.period, rate_hz, 1)
        z = np.array([np.interp(t, self.t, each) for each in trial.mean])
        residual = swing - carried.gain * (carried.cosine * z[0] - carried.sine * z[1])
        blocks = Blocks.of(t, residual, self.period / 12.0, rate_hz)
        turn = blocks.step / self.period
        density = math.sqrt(smooth_density(blocks.y, 0.5 * turn) * smooth_density(blocks.y, 2.0 * turn))
        excess = max(1.0, density * blocks.samples / max(trial.noise_m**2, 1e-300))
        return replace(self, information=self.information / excess, score=self.score / excess, noise_m=trial.noise_m)

    def smooth(self, rate_hz: float, powers: int, params: Params) -> tuple[F8, F8, float, float]:
        """Smooth with every memory that the record admits and average them by their likelihood.

        Returns means (2, w), m, covariances (2, 2, w), m^2, which hold what memories differ by, the noise of a sample,
        m, and the likeliest memory, s.
        """
        span = max(float(self.t[-1] - self.t[0]), self.period)
        memories = np.geomspace(self.period, 30.0 * span, params.memories)
        trials = [_Trial.of(self, float(memory_s), rate_hz, powers) for memory_s in memories]
        costs = np.array([trial.cost for trial in trials])
        weights = np.exp(-0.5 * (costs - costs.min()))
        believed = np.flatnonzero(weights > LEAST_WEIGHT)
        weights = weights[believed] / weights[believed].sum()
        means = np.array([trials[k].mean for k in believed])
        mean = np.einsum("k,kiw->iw", weights, means)
        covariance = np.einsum("k,kiw,kjw->ijw", weights, means - mean, means - mean)
        for k, weight in zip(believed, weights, strict=True):
            covariance += weight * trials[k].noise_m ** 2 * trials[k].covariance()
        best = int(np.argmin(costs))
        return mean, covariance, trials[best].noise_m, float(memories[best])

    def bond(self, memory_s: float, rate_hz: float) -> F8:
        """Reciprocal variances of the walk's steps, noise of one sample being 1.

        A walk of variance r per second seen with information J per second remembers :math:`1/\\sqrt{rJ}`.
        The force is the same throughout, so that the walk's steps grow as the amplitude falls.
        """
        r = 2.0 / (rate_hz * memory_s**2)
        return np.asarray(self.gain[1:] * self.gain[:-1] / (r * np.diff(self.t)))


@dataclass(frozen=True, slots=True, eq=False)
class _Trial:
    """The walk smoothed with one memory, and a polynomial in time beside it whose coefficients are not known before.

    The polynomial is eliminated by its Schur complement; ``cost`` is minus twice the logarithm of the likelihood that
    is left, up to a constant, the noise as known before or else at its best value.
    """

    chain: Chain
    mean: F8
    beyond: F8  # (2, 2 powers, w): what a coefficient of 1 does to the walk and itself together
    inverse: F8
    noise_m: float
    cost: float

    @classmethod
    def of(cls, walk: _Walk, memory_s: float, rate_hz: float, powers: int) -> _Trial:
        x = (walk.t - walk.t.mean()) / max(float(np.ptp(walk.t)), 1e-300)
        shapes = np.array([x**power for power in range(1, powers + 1)])
        # One column for either dimension of each power: the walk moved by it, and what is seen of that.
        moved = np.einsum("pw,ij->ijpw", shapes, np.eye(2)).reshape(2, 2 * powers, -1)
        seen = np.einsum("ijw,jaw->iaw", walk.information, moved)
        bond = walk.bond(memory_s, rate_hz)
        chain = Chain(walk.information, np.concatenate([walk.score[:, None], seen], axis=1), bond)
        solved = chain.solve()
        beyond = moved - solved.mean[:, 1:]
        complement = np.einsum("iaw,ibw->ab", seen, beyond)
        values, vectors = np.linalg.eigh(0.5 * (complement + complement.T))
        kept = values > 1e-10 * max(float(values[-1]), 1e-300)
        inverse = (vectors[:, kept] / values[kept]) @ vectors[:, kept].T
        coefficients = inverse @ np.einsum("iaw,iw->a", beyond, walk.score)
        mean = solved.mean[:, 0] + np.einsum("a,iaw->iw", coefficients, beyond)
        explained = float(np.sum(walk.score * mean))
        determinants = solved.log_determinant + float(np.sum(np.log(values[kept]))) - 2.0 * float(np.sum(np.log(bond)))
        if walk.noise_m is not None:
            return cls(chain, mean, beyond, inverse, walk.noise_m, determinants - explained / walk.noise_m**2)
        dof = max(walk.samples - 2 - int(np.count_nonzero(kept)), 1)
        noise_m = math.sqrt(max(walk.squares - explained, 1e-300) / dof)
        return cls(chain, mean, beyond, inverse, noise_m, 2.0 * dof * math.log(noise_m) + determinants)

    def covariance(self) -> F8:
        """Return the covariances of walk and polynomial together, (2, 2, w), in units of the noise squared."""
        spread = self.chain.solve(covariance=True).covariance
        assert spread is not None
        return np.asarray(spread + np.einsum("iaw,ab,jbw->ijw", self.beyond, self.inverse, self.beyond))
