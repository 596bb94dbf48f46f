"""Smoother: position, velocity and acceleration of a noisy oscillator at every sample, without differencing."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from pipeline.damping.select import LawFit
from pipeline.errors import AnalysisError
from pipeline.motion.phase import PhaseFit
from pipeline.motion.waveform import Rest
from pipeline.numerics.random_walk import Chain
from pipeline.numerics.spectrum import Blocks, smooth_density
from pipeline.track import F8, UNUSABLE, Quality, Track
from pipeline.windows.demodulate import Demodulated
from pipeline.windows.disturbances import Disturbances

__all__ = ["Params", "Smoothed", "smooth"]

LONGEST = 100_000  # maximum record length in periods; in longer records the noise is assumed to be white
LEAST_WEIGHT = 0.01  # minimum likelihood, relative to that of the likeliest memory, for a memory to be included


@dataclass(frozen=True, slots=True, kw_only=True)
class Params:
    """Options of :func:`smooth`.

    Parameters
    ----------
    nodes_per_period : int
        Nodes of the random walk per period; the walk is interpolated between them.
    most_nodes : int
        Maximum number of nodes; longer records have nodes further apart.
    memories : int
        Number of trial values of the memory, from one period to thirty times the record length.
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
        Distance from the sensor without sideways modes.
    velocity, u_velocity : (n,) float64, m/s
        Velocity of the oscillation about the rest position.
    acceleration, u_acceleration : (n,) float64, m/s^2
    noise_m : float
        Standard deviation of one sample about the smoothed motion, m.
    memory_s : float
        Time before and after a sample over which other samples contribute to its estimate, at the largest amplitude,
        s. It is the likeliest value with the likeliest law.
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
    """The fitted oscillation at some times, which the random walk multiplies."""

    gain: F8  # amplitude divided by the largest amplitude
    cosine: F8
    sine: F8
    rate: F8  # angular frequency, rad/s
    decay: F8  # logarithmic decay rate of the amplitude, 1/s

    @classmethod
    def at(cls, t: F8, phase: PhaseFit, law: LawFit, last: float) -> _Carried:
        amplitude = law.amplitude(np.clip(t, phase.t0, last) - phase.t0)
        largest = float(np.max(law.amplitude(np.array([0.0, last - phase.t0]))))
        if not largest > 0.0:
            raise AnalysisError("the damping law leaves no amplitude to smooth: record while the bob swings")
        # The law's amplitude may reach zero; the gain is kept at a thousandth of the maximum or more.
        amplitude = np.maximum(amplitude, 1e-3 * largest)
        decay = -law.law.rate(amplitude, law.joint.values) / amplitude
        angle, rate = phase.total(t), phase.rate(phase.damping.best.amplitude(t - phase.t0))
        return cls(amplitude / largest, np.cos(angle), np.sin(angle), rate, decay)

    def rows(self) -> tuple[F8, F8, F8]:
        """Return position, velocity and acceleration for a unit walk in either dimension, shape (2, n) each."""
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
    disturbances: Disturbances | None = None,
    params: Params | None = None,
) -> Smoothed:
    """Estimate the motion at every sample from all samples, each weighted by its information.

    Parameters
    ----------
    track : Track
        The recorded track. Flagged samples are predicted, not used; times may be irregular.
    demodulated : Demodulated
        Provides the flags.
    phase : PhaseFit
        Provides the frequency, the phase and the damping law.
    rest : Rest
    disturbances : Disturbances, optional
        Modes to be subtracted from the record.
    params : Params, optional

    Returns
    -------
    Smoothed
        NaN at samples without a finite time, and outside the part that was analysed.

    Raises
    ------
    AnalysisError
        If fewer than eight samples are usable, or the law leaves no amplitude.

    Notes
    -----
    The oscillator :math:`\\ddot x + 2\\lambda\\dot x + (\\omega^2 + \\lambda^2) x = f` is driven by white noise f.
    Its :math:`\\omega(t)` and :math:`\\lambda(t)` are those of the fitted phase and law. In the frame that rotates and
    decays with it, :math:`x = g(t)\\,\\mathrm{Re}(z e^{i\\varphi(t)})`, the state z is a random walk in two
    dimensions. Averaged over half a period, its steps have the same variance in both dimensions. The Kalman filter and
    the Rauch-Tung-Striebel smoother of this walk are solved together
    (:class:`pipeline.numerics.random_walk.Chain`). Then :math:`\\dot x = g\\,\\mathrm{Re}((i\\omega - \\lambda) z
    e^{i\\varphi})`, and :math:`\\ddot x` has the factor squared. Nothing is differenced, so that noise at frequencies
    that an oscillator cannot follow never enters.

    The result is averaged over the strength of the force, and therefore over the memory, by likelihood; each strength
    has its own noise estimate. In a record that follows its law to the end the memory covers all samples, and the
    result equals the global fit. The uncertainty of frequency and law is added to z as one shape per parameter,
    whose size is estimated too. The ends of the record, which have samples on one side only, therefore have larger
    uncertainties.
    A short record admits several laws, which differ most at its ends. Smoothing is therefore repeated with each
    admissible law that has no more parameters than the selected one, and the results are averaged by likelihood.
    If noise is correlated, samples are weighted by its spectral density near the oscillation's frequency.
    The uncertainties exclude those of clock and speed of sound, which scale all values by a common factor.
    """
    params = params or Params()
    # Outside the analysed part neither law nor phase describes the motion.
    known = np.isfinite(track.t) & ((demodulated.flags & Quality.OUTSIDE) == 0)
    used = known & np.isfinite(track.y) & ((demodulated.flags & UNUSABLE) == 0)
    if np.count_nonzero(used) < 8:
        raise AnalysisError(f"a smoother needs eight usable samples at least, got {np.count_nonzero(used)}")
    t = track.t[used]
    swing = track.y[used] - rest.at(t)
    if disturbances is not None and disturbances.modelled:
        swing = swing - disturbances.sideways.position(t)
    at = np.where(known, track.t, t[0])
    last, best = float(t[-1]), phase.damping.best
    colour, each = None, list[_Followed]()
    for law in phase.damping.considered.values():  # the selected one first
        if len(law.law.parameters) > len(best.law.parameters):
            continue  # it contains the simpler laws, and its spread would only repeat their parameter uncertainties
        carried = _Carried.at(t, phase, law, last)
        walk = _Walk.of(t, swing, carried, phase.angular_frequency.value, params)
        colour = colour or walk.colour(t, swing, carried, track.rate_hz)
        freedom = _freedom(walk.t, phase, law, last)
        each.append(
            walk.seen_through(colour).smooth(freedom, _Carried.at(at, phase, law, last), at, track.rate_hz, params)
        )
    mean, variance = _averaged(each)
    mean[0] += rest.at(at)
    variance[0] += rest.mean.u**2
    x, v, a = np.where(known, mean, np.nan)
    u_x, u_v, u_a = np.where(known, np.sqrt(variance), np.nan)
    likeliest = max(each, key=lambda followed: followed.likelihood)
    return Smoothed(track.t, x, u_x, v, u_v, a, u_a, likeliest.noise_m, likeliest.memory_s)


def _freedom(t: F8, phase: PhaseFit, law: LawFit, last: float) -> F8:
    """Return the common shifts of the walk's nodes, (2, a, w), that uncertain law and frequency parameters cause.

    The in-phase shapes are the derivatives of the law's amplitude by its parameters. The quadrature shapes are powers
    of time, one for each coefficient of the phase. Shapes that only rotate or scale the whole motion are left out,
    because the starting value of the walk is free.
    """
    x = _centred(t)
    turning = np.array([x**power for power in range(1, max(phase.coefficients.size, 2))])
    gain = _Carried.at(t, phase, law, last).gain
    _, slopes = law.law.curve(np.clip(t, phase.t0, last) - phase.t0, law.joint.values)
    slopes = slopes / np.maximum(np.linalg.norm(slopes, axis=0), 1e-300)
    # A law is independent of the unit of length, so that a change of scale is a linear combination of its slopes.
    slopes -= np.outer(gain, gain @ slopes) / (gain @ gain)
    growing = (np.linalg.svd(slopes, full_matrices=False)[0] / gain[:, None])[:, : slopes.shape[1] - 1].T
    growing = growing if len(growing) else x[None, :]
    moved = np.zeros((2, len(growing) + len(turning), t.size))
    moved[0, : len(growing)], moved[1, len(growing) :] = growing, turning
    return moved


def _centred(t: F8) -> F8:
    """Return the times centred on their mean and scaled to a range of 1."""
    return np.asarray((t - t.mean()) / max(float(np.ptp(t)), 1e-300))


@dataclass(frozen=True, slots=True, eq=False)
class _Followed:
    """Result of smoothing with one law: position about rest, velocity and acceleration (3, n), and their variances.

    ``likelihood`` is the logarithm of the law's likelihood, up to a constant common to all laws.
    """

    mean: F8
    variance: F8
    likelihood: float
    noise_m: float
    memory_s: float


def _averaged(each: list[_Followed]) -> tuple[F8, F8]:
    """Return means and variances averaged over the laws by likelihood."""
    likelihoods = np.array([followed.likelihood for followed in each])
    weights = np.exp(likelihoods - likelihoods.max())
    weights /= weights.sum()
    means = np.array([followed.mean for followed in each])
    variances = np.array([followed.variance for followed in each])
    mean = np.einsum("k,kin->in", weights, means)
    return mean, np.einsum("k,kin->in", weights, variances + (means - mean) ** 2)


@dataclass(frozen=True, slots=True, eq=False)
class _Walk:
    """Samples summed into the nodes of the random walk."""

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

    def colour(self, t: F8, swing: F8, carried: _Carried, rate_hz: float) -> tuple[float, float | None]:
        """Return the noise density near the oscillation relative to the mean density, and the noise in m.

        The density is the geometric mean of those at half and twice the frequency. It is estimated from the residual
        with the shortest memory, so that a wandering motion is not mistaken for noise. Records too short or too long
        for this estimate give 1 and None.
        """
        if t.size < 64 or float(t[-1] - t[0]) > LONGEST * self.period:
            return 1.0, None
        trial = _Trial.of(self, self.period, rate_hz, _centred(self.t) * np.eye(2)[:, :, None])
        z = np.array([np.interp(t, self.t, each) for each in trial.mean])
        residual = swing - carried.gain * (carried.cosine * z[0] - carried.sine * z[1])
        blocks = Blocks.of(t, residual, self.period / 12.0, rate_hz)
        turn = blocks.step / self.period
        density = math.sqrt(smooth_density(blocks.y, 0.5 * turn) * smooth_density(blocks.y, 2.0 * turn))
        return max(1.0, density * blocks.samples / max(trial.noise_m**2, 1e-300)), trial.noise_m

    def seen_through(self, colour: tuple[float, float | None]) -> _Walk:
        """Return the walk with its information reduced for coloured noise.

        Otherwise the intervals would be those of as many independent samples.
        """
        excess, noise_m = colour
        return replace(self, information=self.information / excess, score=self.score / excess, noise_m=noise_m)

    def smooth(self, freedom: F8, carried: _Carried, at: F8, rate_hz: float, params: Params) -> _Followed:
        """Smooth with every trial memory and average the likely ones by their likelihood.

        ``carried`` is the fitted oscillation at the times ``at`` of the result.
        """
        span = max(float(self.t[-1] - self.t[0]), self.period)
        memories = np.geomspace(self.period, 30.0 * span, params.memories)
        trials = [_Trial.of(self, float(memory_s), rate_hz, freedom) for memory_s in memories]
        costs = np.array([trial.cost for trial in trials])
        weights = np.exp(-0.5 * (costs - costs.min()))
        likelihood = math.log(float(np.sum(weights))) - 0.5 * float(costs.min())
        believed = np.flatnonzero(weights > LEAST_WEIGHT)
        weights = weights[believed] / weights[believed].sum()
        means = np.array([trials[k].mean for k in believed])
        mean = np.einsum("k,kiw->iw", weights, means)
        covariance = np.einsum("k,kiw,kjw->ijw", weights, means - mean, means - mean)
        for k, weight in zip(believed, weights, strict=True):
            covariance += weight * trials[k].noise_m ** 2 * trials[k].covariance()
        rows = np.array(carried.rows())
        z = np.array([np.interp(at, self.t, each) for each in mean])
        spread = np.array([[np.interp(at, self.t, each) for each in row] for row in covariance])
        best = int(np.argmin(costs))
        return _Followed(
            np.einsum("kin,in->kn", rows, z),
            np.einsum("kin,ijn,kjn->kn", rows, spread, rows),
            likelihood,
            trials[best].noise_m,
            float(memories[best]),
        )

    def bond(self, memory_s: float, rate_hz: float) -> F8:
        """Return the reciprocal variances of the walk's steps in units of the noise of one sample.

        A walk with variance r per second, observed with information J per second, has the memory
        :math:`1/\\sqrt{rJ}`. The force has constant strength, so that the walk's steps grow as the amplitude decays.
        """
        r = 2.0 / (rate_hz * memory_s**2)
        return np.asarray(self.gain[1:] * self.gain[:-1] / (r * np.diff(self.t)))


@dataclass(frozen=True, slots=True, eq=False)
class _Trial:
    """The walk smoothed with one memory, together with common shifts of all its nodes by unknown coefficients.

    The coefficients are eliminated by their Schur complement. ``cost`` is minus twice the logarithm of the remaining
    likelihood, up to a constant, at the given noise or, without one, at its best value.
    """

    chain: Chain
    mean: F8
    beyond: F8  # (2, a, w): a unit shift plus the walk's response to it
    inverse: F8
    noise_m: float
    cost: float

    @classmethod
    def of(cls, walk: _Walk, memory_s: float, rate_hz: float, moved: F8) -> _Trial:
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
        """Return the covariances of the walk and the shifts combined, (2, 2, w), in units of the noise squared."""
        spread = self.chain.solve(covariance=True).covariance
        assert spread is not None
        return np.asarray(spread + np.einsum("iaw,ab,jbw->ijw", self.beyond, self.inverse, self.beyond))
