"""A scene prepared for solving, its band, and its motion solved by a method with a tolerance."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace

import numpy as np

from pipeline.analysis import Analysis
from pipeline.bench.disc import DerivedDrag, derive_drag, needs_drag
from pipeline.bench.scene import Scene
from pipeline.dynamics import Integrator, Problem, get_integrator
from pipeline.dynamics.band import Band, spread, uncertain
from pipeline.dynamics.halving import Solution, auto, demand_tolerance, halved, solved_once
from pipeline.dynamics.strang import STRANG
from pipeline.errors import DynamicsError
from pipeline.numerics.estimate import Estimate, Joint
from springmass.errors import ProgramError
from springmass.simulations.from_run import scene_from_run

DEFAULT_TOLERANCE = 1e-6
FINE = 24.0  # states per radian; interpolation between them has an error of 1e-8 of the amplitude
BAND_SHARE, LARGEST_DEFAULT = 0.01, 1e-3
MOST_SAMPLES = 20_000_000


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
        gamma, beta = drag.joint["gamma_per_s"], replace(drag.joint["beta_per_m_s"], unit="1/(m s)")
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
