"""Smoother: position, velocity and acceleration of a noisy oscillator at every sample, without differences."""

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

LONGEST = 100_000  # periods, beyond which noise is taken for white
LEAST_WEIGHT = 0.01  # of the likeliest memory's (or law's) likelihood, that another must have to count


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
        How long a stretch, before and after, speaks on a sample at the largest amplitude, s: the likeliest, with the
        likeliest law.
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
    def at(cls, t: F8, phase: PhaseFit, law: LawFit, last: float) -> _Carried:
        amplitude = law.amplitude(np.clip(t, phase.t0, last) - phase.t0)
        largest = float(np.max(law.amplitude(np.array([0.0, last - phase.t0]))))
        if not largest > 0.0:
            raise AnalysisError("the damping law leaves no amplitude to smooth: record while the bob swings")
        # A law may end at zero; the walk carries on from a thousandth.
        amplitude = np.maximum(amplitude, 1e-3 * largest)
        decay = -law.law.rate(amplitude, law.joint.values) / amplitude
        angle, rate = phase.total(t), phase.rate(phase.damping.best.amplitude(t - phase.t0))
        return cls(amplitude / largest, np.cos(angle), np.sin(angle), rate, decay)

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
    disturbances: Disturbances | None = None,
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
    disturbances : Disturbances, optional
        Modes that were taken out.
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
    The oscillator :math:`\\ddot x + 2\\lambda\\dot x + (\\omega^2 + \\lambda^2) x = f` is driven by white noise f, with
    :math:`\\omega(t)` and :math:`\\lambda(t)` of the fitted phase and law. In the frame that turns and decays with it,
    :math:`x = g(t)\\,\\mathrm{Re}(z e^{i\\varphi(t)})`, its state z is a random walk in two dimensions, over half a
    period the same in both. Kalman filter and Rauch-Tung-Striebel smoother of that walk are solved in one go
    (:class:`pipeline.numerics.random_walk.Chain`); then :math:`\\dot x = g\\,\\mathrm{Re}((i\\omega - \\lambda) z
    e^{i\\varphi})`, and
    :math:`\\ddot x` has the factor squared. Nothing is differenced: noise at frequencies that an oscillator cannot
    follow never enters.

    The strength of the force, hence the memory, is averaged over by its likelihood, and the noise comes with it. A
    record that follows its law to the end has the memory of all its samples: then this is the global fit. What
    frequency and law are uncertain by is added to z, a shape for each of their parameters, whose sizes are estimated
    along; so the ends, with one side missing, carry their larger uncertainty.
    A short record admits several laws, which part most at its ends. So each of them, up to the selected one's number
    of parameters, is smoothed about, and they too are averaged by their likelihood.
    Where noise is correlated samples count by its spectral density near the oscillation's frequency.
    Clock and speed of sound, which scale everything alike, are not in these uncertainties.
    """
    params = params or Params()
    # Beyond the part that was analysed neither law nor phase says anything about the motion.
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
            continue  # it holds simpler ones, and would only say again what these leave open
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
    """Return how the walk's nodes may move together (2, a, w), since law and frequency are not known exactly.

    In phase as the law's amplitude moves with its parameters, at right angles to that by powers of time, one for each
    coefficient of the phase. What only turns or scales the motion is left out: any walk may begin where it likes.
    """
    x = _centred(t)
    turning = np.array([x**power for power in range(1, max(phase.coefficients.size, 2))])
    gain = _Carried.at(t, phase, law, last).gain
    _, slopes = law.law.curve(np.clip(t, phase.t0, last) - phase.t0, law.joint.values)
    slopes = slopes / np.maximum(np.linalg.norm(slopes, axis=0), 1e-300)
    # A law says the same in any unit of length: the plain scale is a sum of its slopes.
    slopes -= np.outer(gain, gain @ slopes) / (gain @ gain)
    growing = (np.linalg.svd(slopes, full_matrices=False)[0] / gain[:, None])[:, : slopes.shape[1] - 1].T
    growing = growing if len(growing) else x[None, :]
    moved = np.zeros((2, len(growing) + len(turning), t.size))
    moved[0, : len(growing)], moved[1, len(growing) :] = growing, turning
    return moved


def _centred(t: F8) -> F8:
    """Return times from -1/2 to 1/2."""
    return np.asarray((t - t.mean()) / max(float(np.ptp(t)), 1e-300))


@dataclass(frozen=True, slots=True, eq=False)
class _Followed:
    """What smoothing about one law gave: position about rest, velocity and acceleration (3, n), and their variances.

    ``likelihood`` is its logarithm, up to a constant that laws share.
    """

    mean: F8
    variance: F8
    likelihood: float
    noise_m: float
    memory_s: float


def _averaged(each: list[_Followed]) -> tuple[F8, F8]:
    """Return means and variances over the laws."""
    likelihoods = np.array([followed.likelihood for followed in each])
    weights = np.exp(likelihoods - likelihoods.max())
    weights /= weights.sum()
    means = np.array([followed.mean for followed in each])
    variances = np.array([followed.variance for followed in each])
    mean = np.einsum("k,kin->in", weights, means)
    return mean, np.einsum("k,kin->in", weights, variances + (means - mean) ** 2)


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

    def colour(self, t: F8, swing: F8, carried: _Carried, rate_hz: float) -> tuple[float, float | None]:
        """Return by how much noise is stronger near the oscillation than on the whole, in variance, and the noise, m.

        The density is read off half and twice the frequency, on what the shortest memory leaves, so that motion which
        wanders does not pass for noise. Records too short or too long to show it give 1 and None.
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
        """Return the walk with what was seen weakened by coloured noise.

        Else intervals would be those of as many independent samples.
        """
        excess, noise_m = colour
        return replace(self, information=self.information / excess, score=self.score / excess, noise_m=noise_m)

    def smooth(self, freedom: F8, carried: _Carried, at: F8, rate_hz: float, params: Params) -> _Followed:
        """Smooth with every memory that the record admits and average them by their likelihood.

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
        """Reciprocal variances of the walk's steps, noise of one sample being 1.

        A walk of variance r per second seen with information J per second remembers :math:`1/\\sqrt{rJ}`.
        The force is the same throughout, so that the walk's steps grow as the amplitude falls.
        """
        r = 2.0 / (rate_hz * memory_s**2)
        return np.asarray(self.gain[1:] * self.gain[:-1] / (r * np.diff(self.t)))


@dataclass(frozen=True, slots=True, eq=False)
class _Trial:
    """The walk smoothed with one memory, and moves of all its nodes together, of sizes that are not known before.

    These are eliminated by their Schur complement; ``cost`` is minus twice the logarithm of the likelihood that
    is left, up to a constant, the noise as known before or else at its best value.
    """

    chain: Chain
    mean: F8
    beyond: F8  # (2, a, w): what a move of size 1 does to the walk and itself together
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
        """Return the covariances of walk and moves together, (2, 2, w), in units of the noise squared."""
        spread = self.chain.solve(covariance=True).covariance
        assert spread is not None
        return np.asarray(spread + np.einsum("iaw,ab,jbw->ijw", self.beyond, self.inverse, self.beyond))
