"""``auto`` on random scenes: within its tolerance or refused, held to references of 80 bits made by other code.

``tests/reference/scenes.py`` drew and solved them once. ``SPRINGMASS_TRIALS=200 pytest -m trials -s
tests/trials/test_scenes.py`` takes all 200; fewer are the first of each kind.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline.dynamics import Equation, Problem
from pipeline.dynamics.choose import choose
from pipeline.errors import DynamicsError

SCENES = min(200, int(os.environ.get("SPRINGMASS_TRIALS", "40")))
LONGEST = 2e4 if SCENES < 200 else np.inf  # radians of a scene that is solved where time is short
STORED = Path(__file__).resolve().parents[1] / "reference" / "scenes.json"

pytestmark = pytest.mark.trials


def scenes() -> list[dict[str, Any]]:
    """Return the stored scenes, those that are too long left out."""
    stored = json.loads(STORED.read_text())["scenes"][:SCENES]
    return [each for each in stored if radians(each) <= LONGEST]


def radians(scene: dict[str, Any]) -> float:
    """Return how long a scene is."""
    return float(scene["equation"]["angular_frequency_per_s"] * scene["spacing_s"] * scene["count"])


def test_every_scene_is_solved_within_its_tolerance_or_refused() -> None:
    """No trajectory that is returned misses its tolerance at the stored times; what is refused is named with why."""
    missed, refused, ratios = [], [], []
    for number, scene in enumerate(scenes()):
        problem = Problem(Equation(**scene["equation"]), *scene["start"])
        size, tolerance = problem.amplitude_m(), scene["tolerance"]
        try:
            choice = choose(problem, scene["spacing_s"], scene["count"], tolerance)
            run = choice.run(scene["count"])
        except DynamicsError as error:
            refused.append((number, scene["kind"], str(error)))
            continue
        off = float(np.max(np.abs(run.y[scene["rows"]] - np.array(scene["y"]))))
        error = off / size if size > 0.0 else off
        if error > tolerance:
            missed.append((number, scene["kind"], choice.integrator.name, error, tolerance))
        if size > 0.0 and error > 1e-13:
            ratios.append(choice.predicted_error / error)
    within = np.mean([0.1 <= each <= 10.0 for each in ratios]) if ratios else 1.0
    print(
        f"{len(scenes())} scenes: missed {missed}; refused {refused}; predicted over true error within 10 on "
        f"{within:.1%} of {len(ratios)} whose error is above rounding"
    )
    assert not missed
