"""A simulation: the motion that a scene predicts, with its band, its errors, and a measured run beside it."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.bench.scene import Scene
from pipeline.dynamics import Integrator, Problem, Trajectory, get_integrator
from pipeline.dynamics.band import STRONGEST, Band
from pipeline.dynamics.halving import Solution, auto, halved, rounding_error
from pipeline.dynamics.methods import DOP853
from pipeline.dynamics.strang import STRANG
from pipeline.errors import DynamicsError
from pipeline.results.effects import Effect, simulated_effects
from pipeline.track import F8
from springmass.errors import LOG
from springmass.result.run_json import picked, plain
from springmass.simulations.against import Against, compare_with_run, duration_s
from springmass.simulations.solving import (
    DEFAULT_TOLERANCE,
    Prepared,
    SimulationOptions,
    band_of,
    count_of,
    default_tolerance,
    demand_stable,
    prepare,
    solve,
)

if TYPE_CHECKING:
    from springmass.runs.run import Run

DEFAULT_S = 10.0  # length of a simulation without a run
REFERENCE_RTOL = 1e-13
EULERS = (("forward-euler", "forward Euler"), ("symplectic-euler", "symplectic Euler"))
VISIBLE_ERROR, EXACT_ERROR = 1e-3, 1e-9  # errors over the amplitude: one that is visible, and one that is called exact
EFFECT_COLUMNS = ("name", "predicted", "measured", "unit", "included", "why")
GROWTH_COLUMNS = ("method", "predicted", "measured", "fails_above_s")


@dataclass(frozen=True, slots=True, eq=False)
class Check:
    """The errors of a trajectory over amplitude and greatest velocity, measured against a reference."""

    reference: Trajectory
    words: str
    error: float
    velocity_error: float


@dataclass(frozen=True, eq=False)
class Simulation:
    """The solved motion of a scene.

    ``where`` is the path of the scene or run. ``band`` comes from the uncertain inputs, and ``of_band`` says how, or
    why there is none. ``tolerance`` is that of the solution, whose method and step took ``choosing_s`` to choose. The
    error was measured if that was requested, and the run compared if there is one.
    """

    where: str
    ready: Prepared
    band: Band | None
    of_band: str
    tolerance: float | None
    solution: Solution
    choosing_s: float
    check: Check | None
    against: Against | None

    @property
    def problem(self) -> Problem:
        """The equation and its start."""
        return self.solution.problem

    @property
    def trajectory(self) -> Trajectory:
        """The solved motion."""
        return self.solution.trajectory

    @property
    def count(self) -> int:
        """The number of spacings."""
        return len(self.trajectory.y) - 1

    @cached_property
    def effects(self) -> tuple[Effect, ...]:
        """The effects that act on the motion, with their sizes."""
        ready = self.ready
        return simulated_effects(ready.stated, ready.problem, self.trajectory.spacing_s * self.count, ready.drag)

    @cached_property
    def growths(self) -> tuple[Growth, ...]:
        """The growth by both Euler methods with a step of this spacing."""
        turn = self.problem.equation.angular_frequency_per_s * self.trajectory.spacing_s
        period = max(1, round(2.0 * math.pi / turn))
        rows = []
        for name, words in EULERS:
            integrator = get_integrator(name)
            predicted = math.sqrt(1.0 + turn * turn) if name == "forward-euler" else 1.0
            measured = _measured_growth(self, integrator, period)
            rows.append(Growth(name, words, predicted, measured, integrator.stable_step(self.problem)))
        return tuple(rows)


def simulated(scene: Scene, options: SimulationOptions, run: Run | None = None, where: str = "") -> Simulation:
    """Solve the motion of a scene; one of a run is completed from the run, and the motion compared with it.

    Raises SceneError or DynamicsError if the scene describes no motion, UnstableStep, and DynamicsError if the method
    cannot keep the tolerance.
    """
    method, spacing_s, analysis = options.method, options.spacing_s, None if run is None else run.analysis
    longest_s = options.seconds or DEFAULT_S
    if analysis is not None:
        longest_s = max(options.seconds or 0.0, duration_s(analysis))
    count = count_of(options.seconds or longest_s, spacing_s)
    ready = prepare(scene, longest_s, analysis=analysis, where=where or "scene")
    if run is not None:
        LOG.info(f"from {run.loaded.path}: {', '.join(ready.from_run)}")
    band, of_band = band_of(ready, longest_s)
    tolerance = default_tolerance(band) if options.tolerance is None and method == "auto" else options.tolerance
    if not options.force:
        demand_stable(ready.problem, method, spacing_s if options.tolerance is None else None)
    started = time.perf_counter()
    try:
        solution = solve(ready.problem, method, spacing_s, count, tolerance)
        choosing_s = time.perf_counter() - started - solution.running_s
        check = _checked(ready.problem, solution, spacing_s, count) if options.check else None
    except DynamicsError as error:
        raise DynamicsError(error.problem, error.remedy, where=f"{where}: " if where else "") from error
    against = None
    if analysis is not None:
        against = compare_with_run(analysis, ready, replace(options, tolerance=tolerance), band)
    return Simulation(where, ready, band, of_band, tolerance, solution, choosing_s, check, against)


def _checked(problem: Problem, solution: Solution, spacing_s: float, count: int) -> Check:
    parts = solution.parts if solution.integrator is STRANG else None
    other, words, resolution = reference(problem, spacing_s, count, parts)
    start, trajectory = problem.amplitude_m(), solution.trajectory
    if start == 0.0:
        return Check(other, words, 0.0, 0.0)
    velocity = float(np.max(np.abs(trajectory.v - other.v))) / (start * problem.equation.angular_frequency_per_s)
    return Check(other, words, max(_apart(trajectory, other), resolution), max(velocity, resolution))


def reference(
    problem: Problem, spacing_s: float, count: int, strang_parts: int | None = None
) -> tuple[Trajectory, str, float]:
    """Return a highly accurate solution, how it was made, and its possible error.

    The method is DOP853 at a relative tolerance of 1e-13. With friction, or if DOP853 fails, it is Strang splitting
    with a quarter of the step of the run to check, which takes ``strang_parts`` steps a spacing.
    """
    rounding = rounding_error(problem, spacing_s * count)
    if not problem.equation.friction_m_per_s2:
        finest, next_finest = (replace(DOP853, rtol=rtol) for rtol in (REFERENCE_RTOL, 10.0 * REFERENCE_RTOL))
        try:
            run = finest.run(problem, spacing_s, count)
            apart = _apart(run, next_finest.run(problem, spacing_s, count))
        except DynamicsError:
            pass  # the run is too long or too stiff for DOP853
        else:
            return run, f"DOP853 at {REFERENCE_RTOL:g}", apart + rounding
    parts = 4 * (strang_parts or halved(problem, STRANG, spacing_s, count, DEFAULT_TOLERANCE).parts)
    run, coarse = (STRANG.run(problem, spacing_s / each, count * each, every=each) for each in (parts, parts // 2))
    # For a second-order method, the difference from a run with twice the step is three times the finer run's error.
    return run, f"Strang splitting in {parts} steps a sample", _apart(run, coarse) / 3.0 + rounding


def _apart(run: Trajectory, other: Trajectory) -> float:
    """Return the maximum difference between two motions relative to the starting amplitude."""
    start = run.problem.amplitude_m()
    return float(np.max(np.abs(run.y - other.y))) / start if start else 0.0


@dataclass(frozen=True, slots=True)
class Eulers:
    """Both Euler methods with the step of a simulation, and the motion with which they are compared."""

    exact: Trajectory
    words: str
    eulers: tuple[Trajectory, ...]


def beside_exact(solved: Simulation) -> Eulers:
    """Run both Euler methods beside the reference, the run itself, or auto's solution if the run is inaccurate."""
    run, words, error = solved.trajectory, "exact", solved.solution.error
    if solved.check is not None:
        run = solved.check.reference
    else:
        if error is None or not error <= VISIBLE_ERROR:
            better = auto(solved.problem, run.spacing_s, len(run.y) - 1, VISIBLE_ERROR)
            run, error = better.trajectory, better.error
        if error is None or error >= EXACT_ERROR:
            words = f"solved to {error:.0e}"
    return Eulers(run, words, tuple(_euler(solved.problem, run, name) for name, _ in EULERS))


def _euler(problem: Problem, exact: Trajectory, name: str) -> Trajectory:
    """Run a method with the run's spacing; if it diverges, halve the duration until it can be solved."""
    count = len(exact.y) - 1
    while True:
        try:
            return get_integrator(name).run(problem, exact.spacing_s, count)
        except DynamicsError:
            if count < 2:
                raise
            count //= 2


def prediction(solved: Simulation) -> dict[str, float | None] | None:
    """Return what Table 1 gives of a measured run: at the start, and the amplitude at the end; None without swings.

    :math:`\\lambda = \\gamma + \\beta A + \\mu/A`, :math:`Q = \\omega_0/2\\lambda`, and the phase turns by
    :math:`\\sqrt{\\omega_0^2-\\gamma^2} + 3cA^2/8\\omega_0`. The last amplitude is that of the last state.
    """
    eq, start = solved.problem.equation, solved.problem.amplitude_m()
    omega, (gamma, beta, mu) = eq.angular_frequency_per_s, eq.laws()
    if not start or not (rate := gamma + beta * start + mu / start) < STRONGEST * omega:
        return None
    return {
        "period_s": 2.0 * math.pi / (math.sqrt(omega**2 - gamma**2) + 0.375 * eq.cubic_per_m2_s2 * start**2 / omega),
        "damping_rate_per_s": rate,
        "quality_factor": 0.5 * omega / rate if rate else None,
        "amplitude_m": start,
        "last_amplitude_m": _last_amplitude(solved),
    }


def _last_amplitude(solved: Simulation) -> float:
    """Return the amplitude of the last state, for which drag tilts the ellipse of states and friction shifts it."""
    eq, y, v = solved.problem.equation, float(solved.trajectory.y[-1]), float(solved.trajectory.v[-1])
    omega, (gamma, beta, _) = eq.angular_frequency_per_s, eq.laws()
    y += math.copysign(eq.friction_m_per_s2, v) / omega**2 if v else 0.0
    rate = min(gamma + beta * math.hypot(y, v / omega), STRONGEST * omega)
    hard = 0.5 * eq.cubic_per_m2_s2 / omega**2
    square = y**2 + (v + rate * y) ** 2 / (omega**2 - rate**2) + hard * y**4
    return math.sqrt(2.0 * square / (1.0 + math.sqrt(max(1.0 + 4.0 * hard * square, 0.0))))


@dataclass(frozen=True, slots=True)
class Growth:
    """The factor by which each step of an Euler method multiplies an amplitude, relative to the exact motion.

    For :math:`y'' = -\\omega^2 y` a step h has the eigenvalues :math:`1 \\pm i\\omega h` by forward Euler, of modulus
    :math:`\\sqrt{1 + \\omega^2 h^2}`, and eigenvalues of modulus 1 by symplectic Euler. ``measured`` is the mean factor
    over ten periods of this motion, None if the run is too short. Above ``fails_above_s`` any motion grows.
    """

    method: str
    words: str
    predicted: float
    measured: float | None
    fails_above_s: float


def _measured_growth(solved: Simulation, integrator: Integrator, period: int) -> float | None:
    """Return the mean growth of the amplitude a step beyond that of the exact motion, from one period to the last."""
    problem, step_s, steps = solved.problem, solved.trajectory.spacing_s, min(10 * period, solved.count)
    if steps < 2 * period or problem.amplitude_m() == 0.0:
        return None
    try:
        both = [integrator.run(problem, step_s, steps), auto(problem, step_s, steps, VISIBLE_ERROR).trajectory]
    except DynamicsError:
        return None  # a step that is far too large, or a bob that comes to rest
    with np.errstate(divide="ignore"):
        logs = 0.5 * np.log([each.relative_energy() for each in both])
    gains = np.mean(logs[:, -period:], axis=1) - np.mean(logs[:, :period], axis=1)
    grown = float(gains[0] - gains[1]) / (steps + 1 - period)
    return math.exp(grown) if math.isfinite(grown) and grown < 1.0 else None


def summary(solved: Simulation) -> dict[str, Any]:
    """Return a simulation as the JSON of ``springmass simulate``."""
    solution, check, band = solved.solution, solved.check, solved.band
    content = {
        "schema": 1,
        "method": solution.integrator.name,
        "step_s": solution.step_s,
        "steps": solution.parts * solved.count,
        "samples": len(solved.trajectory.y),
        "spacing_s": solved.trajectory.spacing_s,
        "stable_step_s": solution.integrator.stable_step(solution.problem),
        "predicted_error": solution.error,
        "predicted_velocity_error": solution.velocity_error,
        "no_estimate": solution.no_estimate or None,
        "measured_error": None if check is None else check.error,
        "measured_velocity_error": None if check is None else check.velocity_error,
        "reference": None if check is None else check.words,
        "tolerance": solved.tolerance,
        "choosing_s": solved.choosing_s,
        "running_s": solution.running_s,
        "amplitude_m": solved.problem.amplitude_m(),
        "prediction": prediction(solved),
        "equation": picked(solved.problem.equation, solved.problem.equation.__slots__),
        "effects": [picked(each, EFFECT_COLUMNS) for each in solved.effects],
        "against": None if solved.against is None else solved.against.summary(),
        "band": None if band is None else _band_summary(band, solved.trajectory.t),
        "growth": [picked(each, GROWTH_COLUMNS) for each in solved.growths],
    }
    return {name: plain(value) for name, value in content.items()}


def _band_summary(band: Band, t: F8) -> dict[str, Any]:
    """Return the band as JSON; each half-width is the largest of the run."""
    around, (_, of_amplitude) = band.displacement_at(t), band.amplitude_at(t)
    widths = {
        f"{name}_half_width_{share}_m": float(0.5 * np.max(quantiles[high] - quantiles[low]))
        for name, quantiles in (("displacement", around), ("amplitude", of_amplitude))
        for share, low, high in ((68, 1, 2), (95, 0, 3))
    }
    phase = band.phase_at(t)
    widths["phase_half_width_95_rad"] = float(0.5 * np.max(phase[3] - phase[0]))
    return {"members": band.members, "seed": band.seed, "quantities": list(band.quantities), **widths}
