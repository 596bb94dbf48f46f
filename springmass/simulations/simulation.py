"""A simulation: the scene prepared, its motion solved, and the error stated and measured."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pipeline.analysis import Analysis
from pipeline.bench.disc import DerivedDrag, derive_drag, needs_drag
from pipeline.bench.scene import Scene
from pipeline.dynamics.strang import STRANG
from pipeline.errors import DynamicsError
from pipeline.numerics.estimate import Estimate, Joint
from pipeline.results.effects import Effect
from pipeline.simulation import Integrator, Problem, Trajectory, get_integrator
from pipeline.simulation.band import STRONGEST, Band, spread, uncertain
from pipeline.simulation.halving import Solution, auto, demand_tolerance, halved, rounding_error, solved_once
from pipeline.simulation.methods import DOP853
from pipeline.track import F8
from springmass.errors import ProgramError
from springmass.result.run_json import picked, plain
from springmass.simulations.from_run import scene_from_run

DEFAULT_TOLERANCE = 1e-6
FINE = 24.0  # states per radian; interpolation between them has an error of 1e-8 of the amplitude
BAND_SHARE, LARGEST_DEFAULT = 0.01, 1e-3
MOST_SAMPLES = 20_000_000
REFERENCE_RTOL = 1e-13
EULERS = (("forward-euler", "forward Euler"), ("symplectic-euler", "symplectic Euler"))
VISIBLE_ERROR, EXACT_ERROR = 1e-3, 1e-9  # errors over the amplitude: one that is visible, and one that is called exact


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


@dataclass(frozen=True, slots=True, eq=False)
class Check:
    """The errors of a trajectory over amplitude and greatest velocity, measured against a reference."""

    reference: Trajectory
    words: str
    error: float
    velocity_error: float


@dataclass(frozen=True, slots=True, eq=False)
class Simulation:
    """A solved problem, its measured error if that was requested, and the time spent on choosing method and step."""

    solution: Solution
    check: Check | None = None
    choosing_s: float = 0.0

    @property
    def problem(self) -> Problem:
        """The equation and its start."""
        return self.solution.problem

    @property
    def trajectory(self) -> Trajectory:
        """The solved motion."""
        return self.solution.trajectory


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
    if tolerance is not None:
        demand_tolerance(problem, spacing_s, count, tolerance)
    return halved(problem, integrator, spacing_s, count, wanted, time.perf_counter)


def band_of(ready: Prepared, seconds: float) -> tuple[Band | None, str]:
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


def instability(problem: Problem, method: str, step_s: float | None) -> tuple[str, str]:
    """Say what is wrong with a step beyond the limit of its method, and return the limit, s, rounded down.

    Both are empty if the step is stable; the limit is empty too if no step is. Without a step it may be as short as
    needed.
    """
    integrator = None if method == "auto" else get_integrator(method)
    limit = math.inf if integrator is None else integrator.stable_step(problem)
    if integrator is None or (limit > 0.0 and (step_s is None or step_s <= limit)):
        return "", ""
    growth, rounded = "it grows at any step without damping", ""
    if limit > 0.0:
        power = 10.0 ** (math.floor(math.log10(limit)) - 2)
        rounded = f"{math.floor(limit / power) * power:.3g}"
        growth = f"its limit here is {rounded} s"
    step = "a step" if step_s is None else f"a step of {step_s:g} s"
    return f"{integrator.words} is unstable with {step}: {growth}", rounded


def simulated(
    problem: Problem, method: str, spacing_s: float, count: int, tolerance: float | None, *, check: bool
) -> Simulation:
    """Solve a motion, and measure its error if that is requested."""
    started = time.perf_counter()
    solution = solve(problem, method, spacing_s, count, tolerance)
    choosing_s = time.perf_counter() - started - solution.running_s
    return Simulation(solution, _checked(problem, solution, spacing_s, count) if check else None, choosing_s)


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


def growths(problem: Problem, step_s: float, count: int) -> tuple[Growth, ...]:
    """Return the growth by both Euler methods with a step."""
    turn = problem.equation.angular_frequency_per_s * step_s
    period = max(1, round(2.0 * math.pi / turn))
    steps = min(10 * period, count)
    rows = []
    for name, words in EULERS:
        integrator = get_integrator(name)
        predicted = math.sqrt(1.0 + turn * turn) if name == "forward-euler" else 1.0
        measured = _measured_growth(problem, integrator, step_s, steps, period)
        rows.append(Growth(name, words, predicted, measured, integrator.stable_step(problem)))
    return tuple(rows)


def _measured_growth(problem: Problem, integrator: Integrator, step_s: float, steps: int, period: int) -> float | None:
    """Return the mean growth of the amplitude a step beyond that of the exact motion, from one period to the last."""
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


def summary(
    solved: Simulation, effects: Sequence[Effect], tolerance: float | None, band: Band | None
) -> dict[str, Any]:
    """Return a simulation as the JSON of ``springmass simulate``, compared with no run."""
    solution, check = solved.solution, solved.check
    content = {
        "schema": 1,
        "method": solution.integrator.name,
        "step_s": solution.step_s,
        "steps": solution.parts * (len(solved.trajectory.y) - 1),
        "samples": len(solved.trajectory.y),
        "spacing_s": solved.trajectory.spacing_s,
        "stable_step_s": solution.integrator.stable_step(solution.problem),
        "predicted_error": solution.error,
        "predicted_velocity_error": solution.velocity_error,
        "no_estimate": solution.no_estimate or None,
        "measured_error": None if check is None else check.error,
        "measured_velocity_error": None if check is None else check.velocity_error,
        "reference": None if check is None else check.words,
        "tolerance": tolerance,
        "choosing_s": solved.choosing_s,
        "running_s": solution.running_s,
        "amplitude_m": solved.problem.amplitude_m(),
        "prediction": prediction(solved),
        "equation": picked(solved.problem.equation, solved.problem.equation.__slots__),
        "effects": [picked(each, ("name", "predicted", "measured", "unit", "included", "why")) for each in effects],
        "against": None,
        "band": None if band is None else _band_summary(band, solved.trajectory.t),
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
