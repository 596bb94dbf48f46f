"""What accuracy costs on this machine: errors over their lower bound and times, of the tiers and of the integrators.

Records are simulated from one motion, clean and spoilt in ways that benches know; each tier evaluates each of them.
The integrators solve the equation of the same motion.
"""

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from pipeline.analyse import Analysis, Oscillation, analyse
from pipeline.damping.laws import LAWS, Law, find_law
from pipeline.errors import DynamicsError, PipelineError
from pipeline.numerics.least_squares import central_differences
from pipeline.options import TIERS, options_for
from pipeline.simulation import Equation, Problem, integrators
from pipeline.simulation.halving import auto
from pipeline.simulation.methods import SolveIvp
from pipeline.track import F8, Track
from springmass.simulations.from_run import SCENE_KEYS
from springmass.simulations.simulation import reference

SCORED_QUANTITIES = ("frequency", "amplitude", "damping_rate")
STEP_PARTS, RTOLS, TOLERANCES = (1, 4, 16), (1e-6, 1e-9, 1e-12), (1e-3, 1e-6, 1e-9, 1e-12)
LONGEST_ADAPTIVE = 2e4  # rad; a longer motion takes adaptive methods minutes


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TrueMotion:
    """A free oscillation as it is sampled: ``theta`` has the law's parameters, the amplitude at t = 0 in m first."""

    frequency_hz: float = 1.3183
    law: Law = field(default_factory=partial(find_law, "linear"))
    theta: F8 = field(default_factory=lambda: np.array([0.05, 0.01463]))
    noise_m: float = 3e-4
    rate_hz: float = 100.0
    seconds: float = 60.0

    @property
    def t(self) -> F8:
        """The times of the samples, s."""
        return np.arange(round(self.seconds * self.rate_hz)) / self.rate_hz

    def truth(self) -> dict[str, float]:
        """Return the true frequency in Hz, amplitude in m and damping rate, both at t = 0, in 1/s."""
        return {
            "frequency": self.frequency_hz,
            "amplitude": float(self.theta[0]),
            "damping_rate": _rate(self.law, self.theta),
        }

    def problem(self) -> Problem | None:
        """Return the equation of the motion and its start; None if its law is no sum of drags."""
        drags = dict(zip([*self.law.parameters][1:], self.theta[1:].tolist(), strict=True))
        if not drags.keys() <= SCENE_KEYS.keys():
            return None
        coefficients = {SCENE_KEYS[name]: max(value, 0.0) for name, value in drags.items()}
        return Problem(Equation.from_laws(2.0 * math.pi * self.frequency_hz, **coefficients), float(self.theta[0]))


def motion_of(analysis: Analysis, oscillation: Oscillation) -> TrueMotion:
    """Return the motion that an analysis found, by the law that it selected."""
    law, t = oscillation.damping.best, analysis.track.t
    seconds = float(t[-1] - t[0])
    return TrueMotion(
        frequency_hz=analysis.estimates["frequency"].value,
        law=find_law(law.name),
        theta=np.asarray(law.joint.values),
        noise_m=analysis.estimates["noise"].value,
        rate_hz=(t.size - 1) / seconds,
        seconds=seconds,
    )


def motion_of_problem(problem: Problem, noise_m: float | None, seconds: float) -> TrueMotion:
    """Return the motion of an equation, released at its greatest displacement."""
    drags = {name: size for name, size in zip(SCENE_KEYS, problem.equation.laws(), strict=True) if size}
    law = next(law for law in LAWS.values() if {*law.parameters} == {"A0", *drags})
    theta = np.array([problem.amplitude_m(), *(drags[each] for each in list(law.parameters)[1:])])
    frequency_hz = problem.equation.angular_frequency_per_s / (2.0 * math.pi)
    return TrueMotion(frequency_hz=frequency_hz, law=law, theta=theta, noise_m=noise_m or 3e-4, seconds=seconds)


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordDefect:
    """What spoils a record; lengths are relative to the amplitude."""

    periods: float | None = None
    noise_db: float | None = None  # power of the noise over that of the motion
    echoes: float = 0.0  # share of false echoes
    clip: float = math.inf  # displacement beyond which crests are cut off
    quantum: float = 0.0
    drift: float = 0.0  # of the rest position
    second: float = 0.0  # amplitude of a mode at six tenths of the frequency


RECORD_DEFECTS = {
    "clean": RecordDefect(),
    "1.6 periods": RecordDefect(periods=1.6),
    "3 periods": RecordDefect(periods=3.0),
    "noise 10 dB above the motion": RecordDefect(noise_db=10.0),
    "5 % false echoes": RecordDefect(echoes=0.05),
    "20 % false echoes": RecordDefect(echoes=0.2),
    "crests clipped at 80 %": RecordDefect(clip=0.8),
    "quantised to 2 %": RecordDefect(quantum=0.02),
    "rest drifts by 4 %": RecordDefect(drift=0.04),
    "second mode of 2 %": RecordDefect(second=0.02),
}


def spoilt(motion: TrueMotion, kind: RecordDefect) -> TrueMotion:
    """Return the motion with the length and the noise of a kind of records."""
    if kind.periods is not None:
        motion = replace(motion, seconds=kind.periods / motion.frequency_hz)
    if kind.noise_db is not None:
        size = float(np.sqrt(np.mean(motion.law.curve(motion.t, motion.theta)[0] ** 2) / 2.0))
        motion = replace(motion, noise_m=size * 10.0 ** (kind.noise_db / 20.0))
    return motion


def distances_of(motion: TrueMotion, kind: RecordDefect, rng: np.random.Generator) -> F8:
    """Return the distances of one record in m, with a random phase."""
    t, size = motion.t, float(motion.theta[0])
    angle, rest = 2.0 * math.pi * motion.frequency_hz * t, 4.0 * size
    y = motion.law.curve(t, motion.theta)[0] * np.cos(angle + rng.uniform(-math.pi, math.pi))
    y = y + motion.noise_m * rng.standard_normal(t.size)
    y = y + kind.second * size * np.cos(0.6 * angle + rng.uniform(-math.pi, math.pi))
    y = np.minimum(y, kind.clip * size) + kind.drift * size * np.sin(0.5 * math.pi * t / t[-1]) + rest
    if kind.quantum:
        y = np.round(y / (kind.quantum * size)) * kind.quantum * size
    false = rng.random(t.size) < kind.echoes
    y[false] = rng.uniform(0.0, 10.0 * rest, np.count_nonzero(false))
    return np.asarray(y)


def bounds(motion: TrueMotion, kind: RecordDefect) -> dict[str, float]:
    """Return the least standard deviations of unbiased estimates (Cramér-Rao) where the law is known.

    They follow from the inverse Fisher information of frequency, phase, offset and the law's parameters in white noise,
    averaged over the phase; a false echo gives no information. That of the damping rate r follows by
    :math:`g^T C g` with :math:`g = dr/d\\theta`.
    """
    t, theta = motion.t, motion.theta
    size, slopes = motion.law.curve(t, theta)
    (gradient,) = central_differences(lambda at: np.array([_rate(motion.law, at)]), theta)
    variances = []
    for phase in np.linspace(-math.pi, math.pi, 9)[:-1]:
        angle = 2.0 * math.pi * motion.frequency_hz * t + phase
        cosine, sine = np.cos(angle), size * np.sin(angle)
        columns = np.column_stack([-2.0 * math.pi * t * sine, -sine, np.ones(t.size), slopes * cosine[:, None]])
        scale = np.linalg.norm(columns, axis=0)  # makes columns of different units comparable
        covariance = np.linalg.pinv((columns / scale).T @ (columns / scale)) / np.outer(scale, scale)
        variances.append([covariance[0, 0], covariance[3, 3], gradient @ covariance[3:, 3:] @ gradient])
    u = motion.noise_m / math.sqrt(1.0 - kind.echoes) * np.sqrt(np.mean(variances, axis=0))
    return dict(zip(SCORED_QUANTITIES, u.tolist(), strict=True))


def _rate(law: Law, theta: F8) -> float:
    """Return the damping rate at the start, -(dA/dt)/A, 1/s."""
    return float(-law.rate(theta[:1], theta)[0] / theta[0])


def measure_tiers(motion: TrueMotion, seeds: int) -> Iterator[list[dict[str, Any]]]:
    """Yield for each kind of records the errors and the time of every tier; all evaluate the same records in turn."""
    for name, kind in RECORD_DEFECTS.items():
        spoilt_motion = spoilt(motion, kind)
        bound, truth = bounds(spoilt_motion, kind), spoilt_motion.truth()
        asked = [each for each in SCORED_QUANTITIES if bound[each] > 0.0]  # without damping there is no rate to find
        errors: dict[str, list[list[float]]] = {tier: [] for tier in TIERS}
        times = dict.fromkeys(TIERS, math.inf)
        for seed in range(seeds):
            track = Track.from_arrays(
                spoilt_motion.t, distances_of(spoilt_motion, kind, np.random.default_rng(seed)), kind="simulated"
            )
            for tier in TIERS:
                start = time.perf_counter()
                try:
                    estimates = analyse(track, options=options_for(tier)).estimates
                except PipelineError:
                    continue
                times[tier] = min(times[tier], time.perf_counter() - start)
                if all(each in estimates for each in asked):
                    errors[tier].append([(estimates[each].value - truth[each]) / bound[each] for each in asked])
        rows: list[dict[str, Any]] = []
        for tier, each in errors.items():
            rms = np.sqrt(np.mean(np.square(each), axis=0)).tolist() if each else []
            rows.append({"record": name, "tier": tier, "error_over_bound": dict(zip(asked, rms, strict=False))})
            rows[-1] |= {"time_s": times[tier] if each else None, "failed": seeds - len(each)}
        yield rows


def measure_integrators(problem: Problem, spacing_s: float, count: int) -> Iterator[dict[str, Any]]:
    """Yield error over the amplitude, steps and time of every integrator, and of ``auto`` at several tolerances."""
    truth = reference(problem, spacing_s, count, 4 * STEP_PARTS[-1])[0].y
    long = spacing_s * count * problem.equation.angular_frequency_per_s > LONGEST_ADAPTIVE

    def row(method: str, setting: str, y: F8, steps: int, seconds: float, *, unstable: bool = False) -> dict[str, Any]:
        error = float(np.max(np.abs(y - truth))) / problem.amplitude_m()
        facts = {"method": method, "setting": setting, "error": error, "steps": steps, "time_s": seconds}
        return {**facts, "unstable": unstable}

    for integrator in integrators():
        if integrator.refusal(problem) or (long and isinstance(integrator, SolveIvp)):
            continue
        settings: list[tuple[str, Any, int]] = [("", integrator, 1)]
        if integrator.order:
            settings = [(f"step {spacing_s / parts:.3g} s", integrator, parts) for parts in STEP_PARTS]
        elif isinstance(integrator, SolveIvp):
            settings = [(f"rtol {rtol:g}", replace(integrator, rtol=rtol), 1) for rtol in RTOLS]
        for setting, solver, parts in settings:
            start = time.perf_counter()
            try:
                solved = solver.run(problem, spacing_s / parts, count * parts, every=parts)
            except DynamicsError:
                continue  # it diverges at this step
            spent_s = time.perf_counter() - start
            unstable = bool(integrator.order) and spacing_s / parts > integrator.stable_step(problem)
            yield row(integrator.name, setting, solved.y, count * parts, spent_s, unstable=unstable)
    for tolerance in TOLERANCES:
        start = time.perf_counter()
        try:
            best = auto(problem, spacing_s, count, tolerance)
        except DynamicsError:
            break  # beyond double precision over this time; so are smaller tolerances
        spent_s = time.perf_counter() - start
        setting = f"{best.integrator.name}, step {best.step_s:.3g} s"
        yield row(f"auto {tolerance:g}", setting, best.trajectory.y, best.parts * count, spent_s)
