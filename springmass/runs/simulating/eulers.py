"""Forward and symplectic Euler beside the exact motion of a simulation, as the lab report compares them."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.dynamics import Trajectory, get_integrator
from pipeline.dynamics.halving import auto
from pipeline.errors import DynamicsError
from springmass.runs.simulating.simulation import Simulation

EULERS = (("forward-euler", "forward Euler"), ("symplectic-euler", "symplectic Euler"))
ROUGH, EXACT = 1e-3, 1e-9  # errors over the amplitude: one that is visible, and one that is called exact


@dataclass(frozen=True, slots=True)
class Eulers:
    """The motion with which both methods are compared, its name in a legend, and the run of each method."""

    exact: Trajectory
    words: str
    eulers: tuple[Trajectory, ...]


def beside_exact(found: Simulation) -> Eulers:
    """Run both methods with the step of a simulation, beside its exact motion."""
    exact, words = _exact(found)
    return Eulers(exact, words, tuple(_euler(found, exact, name) for name, _ in EULERS))


def _exact(found: Simulation) -> tuple[Trajectory, str]:
    """Return the reference if the error was measured, else the run, or auto's solution if the run is inaccurate."""
    if found.check is not None:
        return found.check.reference, "exact"
    run, error = found.trajectory, found.solution.error
    if error is None or not error <= ROUGH:
        better = auto(found.problem, run.spacing_s, len(run.y) - 1, ROUGH)
        run, error = better.trajectory, better.error
    assert error is not None
    return run, "exact" if error < EXACT else f"solved to {error:.0e}"


def _euler(found: Simulation, exact: Trajectory, name: str) -> Trajectory:
    """Run a method with the run's spacing; if it diverges, halve the duration until it can be solved."""
    count = len(exact.y) - 1
    while True:
        try:
            return get_integrator(name).run(found.problem, exact.spacing_s, count)
        except DynamicsError:
            if count < 2:
                raise
            count //= 2
