"""Fits of the equation of motion with every drag law to all samples of a strongly damped oscillation.

Amplitude laws are averages over a cycle and correct to first order in the damping ratio. If drag or friction takes a
hundredth of the amplitude per radian, or friction ends the motion within the record, an average over a cycle is no
longer sufficient, and the equation itself is fitted.

The model, :class:`Solved`, is the free motion of a bob at any times and for any law of drag.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from numpy.polynomial import Legendre

from pipeline.damping.law_fit import least_chi2, mean_squared_rate, weigh
from pipeline.damping.laws.drag import COEFFICIENTS, DRAGS, Drag
from pipeline.damping.select import Damping, select_law
from pipeline.dynamics.equation import Equation, Problem
from pipeline.dynamics.integrator import Trajectory
from pipeline.dynamics.strang import STRANG
from pipeline.modes.mode import Modes
from pipeline.motion.by_samples import FEW_WINDOWS
from pipeline.motion.fit import Rows, allowed, clipped, fit
from pipeline.motion.fitted import Oscillation, Phase, RestPosition, Waveform, wrapped
from pipeline.notice import Refusal
from pipeline.numerics.estimate import Estimate
from pipeline.numerics.least_squares import CENTRAL_STEP, Fit, central_differences
from pipeline.numerics.levels import FEWEST_FOR_CURVE, MISFIT
from pipeline.numerics.regression import correlation_length
from pipeline.parts.stopping import stop_row
from pipeline.samples.condition import Samples
from pipeline.track import F8
from pipeline.windows.demodulate import Windows

STATE = ("rest", "displacement", "velocity", "angular_frequency")
# Time step in radians: interpolation errs by 1e-7 of the amplitude, and splitting under weak drag by 1e-6, as measured
# by `python -m benchmarks.dynamics`.
STEP = 0.08
# Maximum ratio, either way, of a frequency to its start value, and of a growing amplitude: beyond it a search has left
# the motion. With 10, nothing changes, as measured by `python -m tests.golden --every 3`.
REACH = 3.0


def envelope(y: float, v: float, omega: float, mu: float, gamma: float, beta: float) -> tuple[float, float, float]:
    """Return amplitude and phase of a damped motion at displacement y and velocity v, and the amplitude's error bound.

    The amplitude A is that of :math:`y = A\\cos\\varphi`: the smooth curve whose law has these coefficients. With
    :math:`\\lambda = \\gamma + \\beta A + \\mu/A` and :math:`\\omega_d^2 = \\omega^2 - \\lambda^2`, linear drag gives

    .. math:: A\\cos\\varphi = y, \\quad A\\sin\\varphi = -(v + \\lambda y)/\\omega_d,

    which is used for all laws. Quadratic drag and friction dissipate at other phases of a swing (N. N. Bogoliubov,
    Y. A. Mitropolsky, "Asymptotic methods in the theory of non-linear oscillations", 1961). To first order,
    with :math:`\\varphi` from 0 to :math:`\\pi` and :math:`h = \\frac12\\sin 2\\varphi`, they increase A by

    .. math:: \\tfrac{\\beta A^2}{\\omega}\\left[\\tfrac{3\\pi}{4}\\left(\\tfrac23 - \\cos\\varphi
              + \\tfrac13\\cos^3\\varphi\\right) - \\varphi + h\\right]
              + \\tfrac{\\mu}{\\omega}\\left[\\tfrac{\\pi}{2}(1 - \\cos\\varphi) - \\varphi + h\\right].

    Compared with the curve through the turning points of adaptive integrations, A has a relative error of up to
    :math:`0.3\\,\\lambda(\\lambda - \\gamma)/\\omega^2`; under linear drag it is exact.
    """
    start = amplitude = math.hypot(y, v / omega) or 1e-300
    turn, rate = 0.0, gamma
    for _ in range(8):
        rate = min(max(gamma + beta * amplitude + mu / amplitude, -0.9 * omega), 0.9 * omega)
        side = -(v + rate * y) / math.sqrt(omega**2 - rate**2)
        turn = math.atan2(side, y)
        angle = turn % math.pi
        cosine, half = math.cos(angle), 0.5 * math.sin(2.0 * angle)
        quadratic = 0.75 * math.pi * (2.0 / 3.0 - cosine + cosine**3 / 3.0) - angle + half
        dry = 0.5 * math.pi * (1.0 - cosine) - angle + half
        found = math.hypot(y, side) + (beta * amplitude**2 * quadratic + mu * dry) / omega
        amplitude = min(max(found, 0.5 * start), 2.0 * start)
    return amplitude, turn, 0.3 * amplitude * abs(rate * (rate - gamma)) / omega**2


@dataclass(frozen=True, slots=True, eq=False)
class FreeMotion:
    """Distances from the sensor for the parameters (o, y0, v0, omega0, mu, gamma, beta), with the start at t = 0.

    A negative coefficient, which an unbounded fit must be able to pass through, drives the motion.
    """

    seconds: float  # the motion is solved up to this time
    omega: float  # approximate angular frequency, from which the integrator's step follows
    amplitude: float  # approximate first amplitude, from which the step of difference quotients follows
    _kept: dict[bytes, Trajectory] = field(default_factory=dict)

    def position(self, t: F8, theta: F8) -> F8:
        """Return the distances (n,); NaN for parameters that are not finite or far from those of a decay."""
        if not (np.all(np.isfinite(theta)) and self.omega / REACH < theta[3] < REACH * self.omega):
            return np.full(t.size, np.nan)
        driving = np.maximum(-theta[len(STATE) :], 0.0) @ (1.0 / self.amplitude, 1.0, self.amplitude)
        if driving * self.seconds > math.log(REACH):
            return np.full(t.size, np.nan)
        return np.asarray(theta[0] + self.trajectory(theta).at(t))

    def derivatives(self, t: F8, theta: F8, slots: list[int]) -> F8:
        """Return the derivatives (n, p) by the parameters with indices ``slots``; coefficients not among them are zero.

        Difference quotients are used for the coefficients only. The other derivatives follow from the invariance of
        the motion under a shift of the start along it and under changes of the units of length and time:

        .. math::
            (\\dot y_0\\,\\partial_{y_0} + \\ddot y_0\\,\\partial_{v_0})\\,y &= \\dot y \\\\
            (y_0\\,\\partial_{y_0} + v_0\\,\\partial_{v_0}
            + \\mu\\,\\partial_\\mu - \\beta\\,\\partial_\\beta)\\,y &= y \\\\
            (\\omega_0\\,\\partial_{\\omega_0} + v_0\\,\\partial_{v_0}
            + \\mu\\,\\partial_\\mu + \\gamma\\,\\partial_\\gamma + \\beta\\,\\partial_\\beta)\\,y &= t\\,\\dot y
        """
        path, amplitude, rate = self.trajectory(theta), self.amplitude, 0.01 * self.omega
        scale = dict(zip(range(len(STATE), theta.size), (rate * amplitude, rate, rate / amplitude), strict=True))
        y, speed = path.at(t), self._velocity(path, t)
        columns: dict[int, F8] = {}
        sized, timed = y.copy(), t * speed
        for slot in (slot for slot in slots if slot >= len(STATE)):
            moved = theta.copy()
            moved[slot] += CENTRAL_STEP * scale[slot]
            columns[slot] = (self.trajectory(moved).at(t) - y) / (moved[slot] - theta[slot])
            power = slot - len(STATE)  # of the amplitude; the unit of the coefficient has the length to 1 - power
            sized -= (1 - power) * theta[slot] * columns[slot]
            timed -= theta[slot] * columns[slot]
        _, y0, v0, omega = theta[: len(STATE)].tolist()
        a0 = path.problem.equation.acceleration(y0, v0)
        determinant = y0 * a0 - v0 * v0
        columns[0] = np.ones(t.size)
        columns[1] = (a0 * sized - v0 * speed) / determinant
        columns[2] = (y0 * speed - v0 * sized) / determinant
        columns[3] = (timed - v0 * columns[2]) / omega
        return np.stack([columns[slot] for slot in slots], axis=1)

    def velocity(self, t: F8, theta: F8) -> F8:
        """Return the velocities (n,)."""
        return self._velocity(self.trajectory(theta), t)

    def _velocity(self, path: Trajectory, t: F8) -> F8:
        pull = path.problem.equation.acceleration(path.y, path.v)
        # A state with zero velocity is taken as held by friction; turning points lie between two states of the path.
        return Trajectory(path.problem, path.spacing_s, path.v, np.where(path.v == 0.0, 0.0, pull)).at(t)

    def trajectory(self, theta: F8) -> Trajectory:
        """Return the solution about the rest position."""
        key = theta[1:].tobytes()
        if key not in self._kept:
            _, y, v, omega, mu, gamma, beta = (float(x) for x in theta)
            equation = Equation.from_laws(omega, gamma_per_s=gamma, beta_per_m_s=beta, mu_m_per_s=mu)
            # A fit evaluates residuals and derivatives at the same point, so the latest trajectories are cached.
            while len(self._kept) > 2 * len(COEFFICIENTS):
                self._kept.pop(next(iter(self._kept)))
            spacing = STEP / self.omega
            self._kept[key] = STRANG.run(Problem(equation, y, v), spacing, max(2, math.ceil(self.seconds / spacing)))
        return self._kept[key]


@dataclass(frozen=True, slots=True, eq=False)
class Solved:
    """The model of samples with the drag of one law: its parameters are the state and the law's coefficients."""

    law: Drag
    motion: FreeMotion

    @property
    def slots(self) -> list[int]:
        """Indices of the parameters among all seven."""
        return [*range(len(STATE)), *(len(STATE) + power for power in self.law.powers)]

    def full(self, values: F8) -> F8:
        """Return all parameters (7,), with zero for absent coefficients."""
        theta = np.zeros(len(STATE) + len(COEFFICIENTS))
        theta[self.slots] = values
        return theta

    def at(self, t: F8, values: F8) -> tuple[F8, Callable[[], F8]]:
        """Return the distances (n,) at t, and a function that gives their derivatives (n, p)."""
        theta = self.full(values)
        return self.motion.position(t, theta), lambda: self.motion.derivatives(t, theta, self.slots)


def fit_equation(samples: Samples, windows: Windows, damping: Damping) -> Oscillation | Refusal:
    """Fit the equation of motion with each of the :func:`drags`, or refuse it.

    The parameters are the rest position, displacement and velocity at the first sample, :math:`\\omega_0`, and the
    coefficients as defined for the amplitude laws, of :math:`\\ddot y = -\\omega_0^2 y - 2\\gamma\\dot y - b|\\dot
    y|\\dot y - f\\,\\mathrm{sign}(\\dot y)`: :math:`\\gamma`, :math:`\\beta = 4\\omega_0 b/3\\pi` and :math:`\\mu =
    2f/\\pi\\omega_0`.

    The law with most parameters is fitted first: its residual shows the false echoes and the noise. The other laws are
    compared with this noise and selected by the same rules as the amplitude laws.
    """
    laws, ratio = drags(damping), damping.best.rate_at_start() / windows.angular_frequency
    numbers: dict[str, float | str] = {"damping_ratio": ratio, "law": laws[-1].words}
    rows, size = _rows(samples, windows, damping), abs(float(damping.best.joint.values[0]))
    motion, expected = FreeMotion(float(np.max(rows.t)), windows.angular_frequency, size), rows.u
    models = [Solved(law, motion) for law in laws]
    # An average of samples has less noise between neighbours than about a sinusoid, which in turn errs where damping is
    # strongest: the quarter of the windows that it fits best shows the noise.
    every, most = rows, allowed(expected, float(np.quantile(windows.noises, 0.25)))
    ways = [_by_amplitude(models, windows, damping)]
    if windows.t.size < FEW_WINDOWS:
        ways.append(_by_first_samples(models, rows, windows.angular_frequency))
    for starts in ways:
        start = _nearest(models[-1], every, starts)
        found, rows = clipped(models[-1], every, start[models[-1].slots], least=expected, rounds=3)
        left, count = rows.left(models[-1], found.values)[rows.used], found.values.size
        noise = math.sqrt(float(left @ left) / (left.size - count)) if left.size > count else math.inf
        if noise <= most:
            break
    else:
        return Refusal("misfit", {**numbers, "rms_m": noise, "noise_m": most / MISFIT})
    noise = max(noise, 0.01 * expected)
    correlation, rows = correlation_length(left), replace(rows, u=noise)
    chosen = _chosen(models, rows, found.values, correlation, damping, samples.track.unit)
    if chosen is None:
        return Refusal("no_minimum", numbers)
    damping, fits = chosen
    model = next(model for model in models if model.law is damping.best.law)
    if damping.best.rate_at_start() < 0.0:
        return Refusal("driven", {"law": model.law.words})
    return _described(samples, windows, damping, model, rows, fits)


def drags(damping: Damping) -> list[Drag]:
    """Return the laws to be fitted that have an equation of motion with damping, in order of their parameters."""
    wanted = [law for law in DRAGS if law.powers and (law.name in damping.fits or law.name in damping.unfitted)]
    return sorted(wanted, key=lambda law: len(law.powers))


def _rows(samples: Samples, windows: Windows, damping: Damping) -> Rows:
    """Return the samples of the moving bob, with times since the first of them.

    Samples at rest show only noise, and many of them would hide a misfit of the moving samples.
    """
    track, stop, used = samples.track, stop_row(samples), samples.used
    within = used & (np.arange(track.t.size) < (track.t.size if stop is None else stop))
    last, first = float(np.max(track.t[used])), damping.t0
    t = np.clip(np.where(np.isfinite(track.t), track.t, first), first, last) - first
    expected = max(samples.noise_of_reading, 1e-9 * abs(float(damping.best.joint.values[0])))
    plateau = partial(samples.near_plateau, noise=expected)
    # False echoes of the windows that the solution explains return later.
    return Rows(t, track.y, candidates=within, used=within & windows.used, u=expected, near_plateau=plateau)


def _nearest(model: Solved, rows: Rows, starts: Iterator[F8]) -> F8:
    """Return the start values (7,) whose motion comes nearest to the samples."""
    t, y = rows.t[rows.used], rows.y[rows.used]

    def cost(theta: F8) -> float:
        squares = float(np.sum((model.motion.position(t, theta) - y) ** 2))
        return squares if math.isfinite(squares) else math.inf

    return min(starts, key=cost)


def _by_amplitude(models: Sequence[Solved], windows: Windows, damping: Damping) -> Iterator[F8]:
    """Yield start values without damping and with the coefficients of the amplitude laws."""
    omega, first = windows.angular_frequency, damping.best.joint.values[0]
    angle = float(windows.phase[0]) - omega * (float(windows.t[0]) - damping.t0)
    rest = float(np.average(windows.offset, weights=np.maximum(windows.amplitude, 0.0) ** 2))
    state = [rest, first * math.cos(angle), -first * omega * math.sin(angle), omega]
    yield np.array([*state, 0.0, 0.0, 0.0])
    for model in models:
        own = damping.fits.get(model.law.name)
        if own is not None:
            values = own.joint.values
        elif windows.t.size >= len(model.law.parameters):
            values = model.law.guess(windows.t - damping.t0, windows.amplitude)
        else:
            continue
        yield model.full(np.array([*state, *np.maximum(values[1:], 0.0)]))


def _by_first_samples(models: Sequence[Solved], rows: Rows, omega: float) -> Iterator[F8]:
    """Yield start values from a parabola through the first samples, with a range of strengths of one damping term.

    Friction that stops the bob within two periods leaves no amplitudes of windows from which a fit could start.
    """
    y, t = rows.y[rows.used], rows.t[rows.used]
    rest = float(np.median(y[-max(y.size // 10, 5) :]))
    # The parabola is fitted to the samples of the first 0.8 rad, but to at least five.
    early = slice(max(int(np.count_nonzero(t < 0.8 / omega)), 5))
    speed, level = np.polynomial.polynomial.polyfit(t[early], y[early] - rest, 2)[1::-1]
    size = np.hypot(level, speed / omega)
    for model in (model for model in models if len(model.law.powers) == 1):
        for near in (0.9, 1.0, 1.1):
            for ratio in (0.03, 0.06, 0.1, 0.15, 0.25):
                term = ratio * omega * size ** (1 - model.law.powers[0])
                yield model.full(np.array([rest, level, speed, near * omega, term]))


def _chosen(
    models: Sequence[Solved], rows: Rows, start: F8, correlation: float, damping: Damping, unit: str
) -> tuple[Damping, dict[str, Fit]] | None:
    """Fit the laws from the solution of the last, and select among them; None if no fit has a finite covariance.

    The other laws are restrictions of the last, from whose minimum theirs follow to first order. Then only the selected
    law is fitted, and those that chi-square does not clearly reject.
    """
    richest, by_name = models[-1], {model.law.name: model for model in reversed(models)}
    unfitted = {name: "it has no equation of motion" for name in damping.fits if name not in by_name}
    whole, fits, exact = fit(richest, rows, start), dict[str, Fit](), set[str]()
    for name, model in by_name.items():
        if np.isfinite(whole.covariance).all():
            fits[name] = _restricted(whole, richest, model)
            exact = {richest.law.name}
        else:
            fits[name] = fit(model, rows, richest.full(whole.values)[model.slots])
            exact.add(name)
    points = int(np.count_nonzero(rows.used)) - len(STATE) + 1
    # The amplitude changes from period to period, so that a record of any rate shows as many values of it.
    periods = richest.motion.omega * float(np.max(rows.t[rows.used])) / (2.0 * math.pi)
    while True:
        for name in [name for name, own in fits.items() if not np.isfinite(own.covariance).all()]:
            unfitted[name] = f"its equation of motion was not solved for its coefficients: {fits.pop(name).tried}"
        if not fits:
            return None
        # The start amplitude replaces displacement and velocity as a parameter.
        minima = {name: _by_envelope(by_name[name], own) for name, own in fits.items()}
        laws = {name: by_name[name].law for name in fits}
        least, independent = least_chi2(minima, laws), max(periods, FEWEST_FOR_CURVE)
        weighed = {n: weigh(laws[n], minima[n], least[n], points, correlation, independent, unit) for n in fits}
        choice = select_law(weighed, damping.stated, float(np.max(rows.t)))
        near = {name for name, own in weighed.items() if own.reduced_chi2 <= MISFIT**2 * own.limit}
        todo = (near | {choice.selected}) - exact
        if not todo:
            break
        fits |= {name: fit(by_name[name], rows, fits[name].values) for name in fits if name in todo}
        exact |= todo
    every = Damping(
        **choice._asdict(),
        t0=damping.t0,
        fits=weighed,
        scatter=replace(damping.scatter, correlation=correlation),
        unfitted=unfitted,
        stated=damping.stated,
    )
    return every, {name: replace(own, covariance=own.covariance * correlation) for name, own in fits.items()}


def _restricted(whole: Fit, richest: Solved, model: Solved) -> Fit:
    """Return the minimum of a law within that of one with more coefficients, to first order in the missing ones."""
    kept = [richest.slots.index(slot) for slot in model.slots]
    missing = [i for i in range(whole.values.size) if i not in kept]
    covariance, size = whole.covariance, whole.values[missing]
    share = np.linalg.solve(covariance[np.ix_(missing, missing)], np.column_stack([size, covariance[missing]]))
    values = whole.values - covariance[:, missing] @ share[:, 0]
    return replace(
        whole,
        values=values[kept],
        covariance=(covariance - covariance[:, missing] @ share[:, 1:])[np.ix_(kept, kept)],
        cost=whole.cost + float(size @ share[:, 0]),
    )


def _by_envelope(model: Solved, own: Fit) -> Fit:
    """Return a fit with the parameters of the amplitude law."""

    def start(values: F8) -> F8:
        return np.array([envelope(*model.full(values)[1:].tolist())[0]])

    count = len(STATE)
    *_, u_envelope = envelope(*model.full(own.values)[1:].tolist())
    turn = np.zeros((own.values.size - count + 1, own.values.size))
    turn[0] = central_differences(start, own.values)[0]
    turn[1:, count:] = np.eye(own.values.size - count)
    covariance = turn @ own.covariance @ turn.T
    covariance[0, 0] += u_envelope**2
    return replace(own, values=np.concatenate([start(own.values), own.values[count:]]), covariance=covariance)


def _described(
    samples: Samples, windows: Windows, damping: Damping, model: Solved, rows: Rows, fits: Mapping[str, Fit]
) -> Oscillation | Refusal:
    """Return the oscillation by the solution, unless its drag leaves none.

    Its squared frequency is :math:`\\omega_0^2` minus the mean decrease by drag over the whole time: to second order,
    that of a line through the turning points. Its u includes the scatter of this frequency over the admissible laws.
    """
    own = fits[damping.selected]
    theta, best, unit = model.full(own.values), damping.best, samples.track.unit
    still, y, v, natural = theta[: len(STATE)].tolist()
    position = model.motion.position(rows.t, theta)
    residual = samples.track.y - position
    rms = math.sqrt(float(np.mean(residual[rows.used] ** 2)))
    flags = rows.marked(samples.flags, rows.candidates, position)
    t, t0, u = windows.t, damping.t0, np.sqrt(np.diag(own.covariance))
    rates = {n: mean_squared_rate(x, x.amplitude(t - t0), np.ones(t.size)) for n, x in damping.considered.items()}
    if not (squared_rate := rates[damping.selected]) < natural**2:
        return Refusal("no_frequency", {"damping_ratio": best.rate_at_start() / natural, "law": model.law.words})
    omega = math.sqrt(natural**2 - squared_rate)
    away = np.array([fits[n].values[3] ** 2 - rate - omega**2 for n, rate in rates.items()]) / (2.0 * omega)
    odds = np.array([math.exp(0.5 * min(best.bic - x.bic, 0.0)) for x in damping.considered.values()])
    u_omega = math.hypot(float(u[3]) * natural / omega, math.sqrt(float(odds @ away**2) / float(odds.sum())))
    slope = np.array([0.0, v * natural, -y * natural, y * v]) / (v**2 + (y * natural) ** 2)
    u_phase = math.sqrt(float(slope @ own.covariance[: len(STATE), : len(STATE)] @ slope))
    _, start, _ = envelope(*theta[1:].tolist())
    middle = float(np.mean(t))
    # The total phase continues the windows' count of whole turns.
    turns = round((float(windows.phase[0]) - start - omega * float(t[0] - t0)) / (2.0 * math.pi))
    centre = start + 2.0 * math.pi * turns + omega * (middle - t0)
    phase = Phase(
        t0=t0,
        angular_frequency=Estimate(omega, u_omega, "rad/s"),
        phase=Estimate(wrapped(start), u_phase, "rad"),
        reduced_chi2=best.reduced_chi2,
        correlation=damping.scatter.correlation,
        residual=windows.phase - centre - omega * (t - middle),
        coefficients=np.array([centre, omega]),
        middle=middle,
        squared_rate=squared_rate,
    )
    # The residuals of the windows become those of the solution, as sinusoids fail where the bob stops.
    noises = np.full(windows.noises.shape, rms)
    windows = replace(windows, flags=flags, residual=residual, noises=noises)
    # The rest position is the constant one of the record; the place where friction holds the bob may differ.
    rest = RestPosition(Estimate(still, float(u[0]), unit), Legendre([still]))
    waveform = Waveform(position, partial(np.asarray, model.motion.velocity(rows.t, theta)), residual, rms)
    return Oscillation(
        windows=windows,
        modes=Modes(samples),
        damping=damping,
        phase=phase,
        rest=rest,
        waveform=waveform,
        method="equation",
    )
