"""The equation of motion, the integrators that solve it, their limits, and the cheapest one for a tolerance.

In comes a scene or an equation with a start; out goes a trajectory, with the error to expect of it beforehand. A
newcomer adds an integrator: one file in ``integrators``, one entry in ``INTEGRATORS``, and it must pass
tests/conformance/test_integrators.py by its name; a sixth that ``auto`` may take needs its cost in ``choose`` too.

Examples
--------
>>> from pipeline.dynamics import Equation, Problem, get_integrator
>>> problem = Problem(Equation.from_laws(8.66, gamma_per_s=0.0073, beta_per_m_s=0.235), 0.05)
>>> trajectory = get_integrator("strang").run(problem, 0.01, 12000)
>>> trajectory.y.shape, f"{trajectory.relative_energy()[-1]:.4f}"
((12001,), '0.0461')
"""

from __future__ import annotations

from pipeline.dynamics.equation import Equation
from pipeline.dynamics.integrator import Integrator, Trajectory
from pipeline.dynamics.integrators.averaged import AVERAGED
from pipeline.dynamics.integrators.euler import FORWARD_EULER, SYMPLECTIC_EULER
from pipeline.dynamics.integrators.exact import EXACT
from pipeline.dynamics.integrators.runge_kutta import RK4
from pipeline.dynamics.integrators.solve_ivp import DOP853, LSODA
from pipeline.dynamics.integrators.strang import STRANG
from pipeline.dynamics.integrators.taylor import TAYLOR
from pipeline.dynamics.integrators.verlet import VERLET, YOSHIDA4
from pipeline.dynamics.problem import Problem, effective_mass_kg
from pipeline.errors import DynamicsError

__all__ = [
    "INTEGRATORS",
    "Equation",
    "Integrator",
    "Problem",
    "Trajectory",
    "effective_mass_kg",
    "get_integrator",
]

_EACH = (FORWARD_EULER, SYMPLECTIC_EULER, VERLET, YOSHIDA4, RK4, EXACT, STRANG, TAYLOR, LSODA, DOP853, AVERAGED)
INTEGRATORS: dict[str, Integrator] = {each.name: each for each in _EACH}


def get_integrator(name: str) -> Integrator:
    """Return an integrator by name.

    Raises
    ------
    DynamicsError
        For a name that none has; the message lists them.
    """
    if name not in INTEGRATORS:
        raise DynamicsError(f"unknown method {name!r}; allowed are auto, {', '.join(INTEGRATORS)}")
    return INTEGRATORS[name]
