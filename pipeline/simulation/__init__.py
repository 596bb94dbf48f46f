"""Simulation: all integrators, the step halving that estimates their error, and bands of uncertain scenes.

Input: an equation with an initial state. Output: a trajectory with its stated error (``halving.py``). To
add an integrator, add one entry to ``methods.py`` and one to ``INTEGRATORS``, or in another package an entry point of
the group ``springmass.integrators``; :func:`springmass.testing.check` tests it.
"""

from __future__ import annotations

from failure.extensions import load_named, names_in
from pipeline.bench.disc import effective_mass_kg as effective_mass_kg
from pipeline.dynamics.equation import Equation as Equation
from pipeline.dynamics.equation import Problem as Problem
from pipeline.dynamics.integrator import Integrator as Integrator
from pipeline.dynamics.integrator import Trajectory as Trajectory
from pipeline.dynamics.strang import EXACT, STRANG
from pipeline.errors import DynamicsError
from pipeline.simulation.methods import DOP853, FORWARD_EULER, RK4, SYMPLECTIC_EULER, VERLET, YOSHIDA4

_EACH = (FORWARD_EULER, SYMPLECTIC_EULER, VERLET, YOSHIDA4, RK4, EXACT, STRANG, DOP853)
INTEGRATORS: dict[str, Integrator] = {each.name: each for each in _EACH}
"""The built-in integrators by name."""

_GROUP = "springmass.integrators"


def integrators() -> tuple[Integrator, ...]:
    """Return the built-in integrators, then those that other packages add."""
    return tuple(map(get_integrator, names_in(_GROUP, INTEGRATORS)))


def get_integrator(name: str) -> Integrator:
    """Return an integrator by name.

    Parameters
    ----------
    name : str
        As on the command line, for example "strang".

    Raises
    ------
    DynamicsError
        For an unknown name; the message lists the allowed names.
    """
    if name in INTEGRATORS:
        return INTEGRATORS[name]
    if name not in (names := names_in(_GROUP, INTEGRATORS)):
        raise DynamicsError(f"unknown method {name!r}", f"allowed are auto, {', '.join(names)}")
    found: Integrator = load_named(_GROUP, name, Integrator, DynamicsError)
    return found
