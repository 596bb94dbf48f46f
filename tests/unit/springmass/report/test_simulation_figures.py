"""The figures of a simulation: the whole run, and its first periods."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.dynamics import Equation, Problem
from springmass.report.figures.trajectories import draw_simulation
from springmass.runs.simulating.simulation import simulate


@pytest.mark.parametrize(("count", "panels"), [(500, 2), (6000, 4)])
@pytest.mark.parametrize("name", ["position", "velocity"])
def test_a_motion_is_drawn_to_its_end(name: str, count: int, panels: int) -> None:
    """Position and velocity of both Euler methods reach the end of the run; a long one shows its beginning as well."""
    problem = Problem(Equation.from_laws(8.0, gamma_per_s=0.01), 0.05)
    simulation = simulate(problem, "strang", 0.01, count, 1e-6, check=False, timer=lambda: 0.0)
    axes = draw_simulation(simulation, 0.2)[name].axes
    assert len(axes) == panels
    for panel in axes[:2]:
        for line in panel.lines:
            assert np.max(line.get_xdata()) == pytest.approx(0.01 * count, rel=0.01)
    assert all(panel.get_xlim()[1] < 12.0 for panel in axes[2:])
