"""A simulation: the motion that a scene predicts, with its band, its errors, and a measured run beside it."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from pipeline.analysis import Analysis
from pipeline.bench.disc import DerivedDrag, derive_drag, needs_drag
from pipeline.bench.scene import Scene
from pipeline.dynamics.strang import STRANG
from pipeline.errors import DynamicsError
from pipeline.numerics.estimate import Estimate, Joint
from pipeline.quantities import QUANTITIES
from pipeline.results.effects import Effect, simulated_effects
from pipeline.simulation import Integrator, Problem, Trajectory, get_integrator
from pipeline.simulation.band import STRONGEST, Band, propagated, spread, uncertain
from pipeline.simulation.halving import Solution, auto, halved, rounding_error, solved_once
from pipeline.simulation.methods import DOP853
from pipeline.track import F8
from springmass.errors import LOG, ProgramError
from springmass.result.run_json import picked, plain
from springmass.simulations.against import Against, against_json, compare_with_run, duration_s
from springmass.simulations.from_run import SCENE_KEYS, scene_from_run
from springmass.typeset import prefixed

if TYPE_CHECKING:
    from springmass.runs.run import Run

DEFAULT_S = 10.0  # length of a simulation without a run
DEFAULT_TOLERANCE = 1e-6
FINE = 24.0  # states per radian; interpolation between them has an error of 1e-8 of the amplitude
BAND_SHARE, LARGEST_DEFAULT = 0.01, 1e-3
MOST_SAMPLES = 20_000_000
REFERENCE_RTOL = 1e-13
EULERS = tuple(get_integrator(name) for name in ("forward-euler", "symplectic-euler"))
VISIBLE_ERROR, EXACT_ERROR = 1e-3, 1e-9  # errors over the amplitude: one that is visible, and one that is called exact
EFFECT_COLUMNS = ("name", "predicted", "measured", "unit", "included", "why")
GROWTH_COLUMNS = ("method", "predicted", "measured", "fails_above_s")


@dataclass(frozen=True, kw_only=True)
class SimulationOptions:
    """How a motion is simulated.

    ``method`` is "auto" or an integrator, and ``spacing_s`` the time between two states. The simulation is as long as
    ``seconds``, by default as the run with which it is compared, or 10 s. The ``tolerance`` is relative to the
    amplitude; the default for "auto" follows from the band. With ``check`` the error is measured too, and ``force``
    accepts an unstable step.
    """

    method: str | Integrator = "auto"
    spacing_s: float = 0.01
    seconds: float | None = None
    tolerance: float | None = None
    check: bool = False
    force: bool = False


class UnstableStep(DynamicsError):
    """A step beyond the limit of its method; ``other`` is a method for it.

    ``limit`` is the limit in s, rounded down; empty if no step is stable.
    """

    def __init__(self, problem: str, limit: str, other: str) -> None:
        super().__init__(problem, 'give times with a smaller step, a tolerance, or method="strang"')
        self.limit, self.other = limit, other


@dataclass(frozen=True, slots=True, eq=False)
class Prepared:
    """A scene that is ready to be solved: as stated, completed from a run, and with its derived drag.

    ``measured`` is the joint distribution of what was taken from the run, whose names are ``from_run``, and of the
    derived drag.
    """

    stated: Scene
    solved: Scene
    drag: DerivedDrag | None
    measured: Joint | None
    from_run: tuple[str, ...]
    problem: Problem

    def values(self) -> dict[str, Estimate]:
        """Return the uncertain attributes of the scene by name."""
        joint = uncertain(self.solved, self.measured)
        return {name: joint[name] for name in joint.names}


def prepare(scene: Scene, seconds: float, *, analysis: Analysis | None = None, where: str = "scene") -> Prepared:
    """Return a scene prepared for solving; ``SceneError`` or ``DynamicsError`` if it describes no motion.

    The analysis of a run supplies the start, and spring constant and damping if the scene does not state them. Drag
    that disc and air imply is not taken from the run, for that would be no prediction.
    """
    derived, measured = needs_drag(scene), None
    if analysis is not None:
        scene, measured = scene_from_run(scene, analysis, damping=not derived)
    from_run = () if measured is None else measured.names
    solved, problem, drag = scene, Problem.from_scene(scene, where=where), None
    if derived:
        drag = derive_drag(scene, problem.amplitude_m(), seconds)
        gamma, beta = drag.joint["gamma_per_s"], Estimate.of_variable(drag.joint["beta_per_m_s"], "1/(m s)")
        solved = replace(scene, gamma_per_s=gamma, beta_per_m_s=beta)
        measured = _together(measured, drag.joint)
        problem = Problem.from_scene(solved, where=where)
    return Prepared(scene, solved, drag, measured, from_run, problem)


def _together(first: Joint | None, second: Joint) -> Joint:
    """Return both joint distributions as one, with no correlation between the two."""
    if first is None:
        return second
    size = len(first.names)
    covariance = np.zeros((size + len(second.names),) * 2)
    covariance[:size, :size], covariance[size:, size:] = first.covariance, second.covariance
    values = np.concatenate([first.values, second.values])
    return Joint((*first.names, *second.names), values, covariance, (*first.units, *second.units))


def count_of(seconds: float, spacing_s: float) -> int:
    """Return the number of spacings in a run; refuse none, and more than the memory of a machine holds."""
    count = round(seconds / spacing_s) if spacing_s > 0 else 0
    if not 1 <= count <= MOST_SAMPLES:
        raise ProgramError(
            f"--seconds {seconds:g} at --dt {spacing_s:g} makes {count} steps", f"allowed are 1 to {MOST_SAMPLES}"
        )
    return count


def solve(
    problem: Problem, method: str | Integrator, spacing_s: float, count: int, tolerance: float | None
) -> Solution:
    """Solve a motion with ``auto`` or with a named method; ``DynamicsError`` if that cannot keep the tolerance.

    Without a tolerance a method with a step takes the spacing as its step, and the others keep 1e-6.
    """
    wanted = DEFAULT_TOLERANCE if tolerance is None else tolerance
    if method == "auto":
        return auto(problem, spacing_s, count, wanted, time.perf_counter)
    integrator = get_integrator(method) if isinstance(method, str) else method
    if tolerance is None and integrator.order:
        return solved_once(problem, integrator, spacing_s, count, time.perf_counter)
    return halved(problem, integrator, spacing_s, count, wanted, time.perf_counter)


def band_or_why(ready: Prepared, seconds: float) -> tuple[Band | None, str]:
    """Return the band from the uncertain inputs and how it was computed, or the reason why there is none."""
    if not ready.values():
        return None, "none: the scene states no uncertainties"
    try:
        band = spread(ready.solved, seconds, ready.measured)
    except DynamicsError as error:
        return None, f"none: {error}"
    return band, f"{band.members} motions drawn from the uncertainties of {', '.join(band.quantities)}"


def default_tolerance(band: Band | None) -> float:
    """Return 1 % of the band's relative uncertainty, limited to 1e-6 to 1e-3, in one digit; 1e-6 without a band."""
    if band is None:
        return DEFAULT_TOLERANCE
    return float(f"{min(max(BAND_SHARE * band.relative_u, DEFAULT_TOLERANCE), LARGEST_DEFAULT):.1g}")


def demand_stable(problem: Problem, method: str | Integrator, step_s: float | None) -> None:
    """Raise UnstableStep if a step is beyond the limit of its method; without a step it may be as short as needed."""
    if method == "auto":
        return
    integrator = get_integrator(method) if isinstance(method, str) else method
    limit = integrator.stable_step(problem)
    if limit > 0.0 and (step_s is None or step_s <= limit):
        return
    growth, rounded = "it grows at any step without damping", ""
    if limit > 0.0:
        power = 10.0 ** (math.floor(math.log10(limit)) - 2)
        rounded = f"{math.floor(limit / power) * power:.3g}"
        growth = f"its limit here is {rounded} s"
    step = "a step" if step_s is None else f"a step of {step_s:g} s"
    other = "auto" if integrator is STRANG else STRANG.name
    other += "" if math.isfinite(STRANG.stable_step(problem)) else ", which has no limit"
    raise UnstableStep(f"{integrator.words} is unstable with {step}: {growth}", rounded, other)


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
        for euler in EULERS:
            predicted = math.sqrt(1.0 + turn * turn) if euler.name == "forward-euler" else 1.0
            measured = _measured_growth(self, euler, period)
            rows.append(Growth(euler.name, euler.words, predicted, measured, euler.stable_step(self.problem)))
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
    band, of_band = band_or_why(ready, longest_s)
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
        # The step of ``auto`` is short enough for interpolation.
        omega = ready.problem.equation.angular_frequency_per_s
        step_s = min(spacing_s, 1.0 / (FINE * omega)) if method == "auto" else spacing_s
        beside = count_of(step_s * max(1, math.ceil(duration_s(analysis) / step_s)), step_s)
        trajectory = solve(ready.problem, method, step_s, beside, tolerance).trajectory
        against = compare_with_run(analysis, trajectory, band, ready.values())
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


class Eulers(NamedTuple):
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
    return Eulers(run, words, tuple(_euler(solved.problem, run, euler) for euler in EULERS))


def _euler(problem: Problem, exact: Trajectory, euler: Integrator) -> Trajectory:
    """Run a method with the run's spacing; if it diverges, halve the duration until it can be solved."""
    count = len(exact.y) - 1
    while True:
        try:
            return euler.run(problem, exact.spacing_s, count)
        except DynamicsError:
            if count < 2:
                raise
            count //= 2


def prediction(solved: Simulation) -> dict[str, float | None] | None:
    """Return what Table 1 gives of a measured run: at the start, and the amplitude at the end; None without swings.

    :math:`\\lambda = \\gamma + \\beta A + \\mu/A`, :math:`Q = \\omega_0/2\\lambda`, and the phase turns by
    :math:`\\sqrt{\\omega_0^2-\\gamma^2} + 3cA^2/8\\omega_0`. The last amplitude is that of the last state.
    """
    start = solved.problem.amplitude_m()
    if not start or not _rate(solved.problem) < STRONGEST * solved.problem.equation.angular_frequency_per_s:
        return None
    period, rate, quality = _of_problem(solved.problem)
    return {
        "period_s": period,
        "damping_rate_per_s": rate,
        "quality_factor": quality if rate else None,
        "amplitude_m": start,
        "last_amplitude_m": _last_amplitude(solved.trajectory),
    }


def _rate(problem: Problem) -> float:
    start, (gamma, beta, mu) = problem.amplitude_m(), problem.equation.laws()
    return gamma + beta * start + mu / start


def _of_problem(problem: Problem) -> tuple[float, float, float]:
    """Return period, damping rate and quality factor at the start."""
    eq, rate = problem.equation, _rate(problem)
    omega, (gamma, *_) = eq.angular_frequency_per_s, eq.laws()
    turn = math.sqrt(omega**2 - gamma**2) + 0.375 * eq.cubic_per_m2_s2 * problem.amplitude_m() ** 2 / omega
    return 2.0 * math.pi / turn, rate, 0.5 * omega / rate if rate else math.nan


class Predicted(NamedTuple):
    """A result of a run beside its prediction, and their difference over the u of both; None if the run gave both."""

    label: str
    value: Estimate
    measured: Estimate
    apart: float | None


def beside_measured(solved: Simulation) -> list[Predicted]:
    """Return the results of the run that the simulation is compared with, beside their predictions."""
    ready, band, over = solved.ready, solved.band, solved.against
    if over is None or prediction(solved) is None:
        return []
    values, u = [*_of_problem(solved.problem), _last_amplitude(over.trajectory)], [0.0] * 4
    if band is not None:
        quantiles = band.amplitude_at(over.trajectory.t[-1:])[1][:, 0]
        u = [*propagated(ready.solved, ready.measured, _of_problem).tolist(), 0.5 * float(quantiles[2] - quantiles[1])]
    damped = not {*SCENE_KEYS.values()}.isdisjoint(ready.from_run)
    rows, taken = [], ("spring_constant_n_per_m" in ready.from_run, damped, damped, damped)
    names = ("period", "damping_rate", "quality_factor", "last_amplitude")
    for name, value, own, same in zip(names, values, u, taken, strict=True):
        measured = over.estimates.get(name)
        if measured is not None and measured.u > 0.0 and math.isfinite(value):
            label = QUANTITIES[name].label if name in QUANTITIES else f"amplitude after {over.trajectory.t[-1]:.4g} s"
            apart = None if same else (measured.value - value) / math.hypot(measured.u, own)
            rows.append(Predicted(label, prefixed(Estimate(value, own, measured.unit)), prefixed(measured), apart))
    return rows


def _last_amplitude(trajectory: Trajectory) -> float:
    """Return the amplitude of the last state, for which drag tilts the ellipse of states and friction shifts it."""
    eq, y, v = trajectory.problem.equation, float(trajectory.y[-1]), float(trajectory.v[-1])
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


def simulation_json(solved: Simulation) -> dict[str, Any]:
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
        "against": None if solved.against is None else against_json(solved.against),
        "band": None if band is None else _band_json(band, solved.trajectory.t),
        "growth": [picked(each, GROWTH_COLUMNS) for each in solved.growths],
    }
    return {name: plain(value) for name, value in content.items()}


def _band_json(band: Band, t: F8) -> dict[str, Any]:
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
