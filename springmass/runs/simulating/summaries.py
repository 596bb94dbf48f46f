"""Return a simulation as the JSON of ``springmass simulate``, and its band as table columns."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from pipeline.dynamics.band import LEVELS, Band
from pipeline.results.effects import Effect
from pipeline.track import F8
from springmass.runs.simulating.simulation import Against, Simulation

__all__ = ["band_columns", "summary"]


def summary(
    simulation: Simulation,
    against: Against | None,
    band: Band | None,
    effects: Sequence[Effect] = (),
    tolerance: float | None = None,
) -> dict[str, Any]:
    """Return a simulation as the JSON of ``springmass simulate``."""
    solution, problem, check = simulation.solution, simulation.problem, simulation.check
    limit = solution.integrator.stable_step(solution.problem)
    return {
        "schema": 1,
        "method": solution.integrator.name,
        "step_s": solution.step_s,
        "steps": solution.parts * (len(simulation.trajectory.y) - 1),
        "samples": len(simulation.trajectory.y),
        "spacing_s": simulation.trajectory.spacing_s,
        "stable_step_s": _finite(limit),
        "predicted_error": _finite(solution.error),
        "predicted_velocity_error": _finite(solution.velocity_error),
        "no_estimate": solution.no_estimate or None,
        "measured_error": None if check is None else check.error,
        "measured_velocity_error": None if check is None else check.velocity_error,
        "reference": None if check is None else check.words,
        "tolerance": tolerance,
        "choosing_s": simulation.choosing_s,
        "running_s": solution.running_s,
        "amplitude_m": problem.amplitude_m(),
        "equation": {name: getattr(problem.equation, name) for name in problem.equation.__slots__},
        "terms": [
            {"name": term.name, "size": term.size, "included": term.included, "why": term.why}
            for term in solution.terms
        ],
        "effects": [
            {key: getattr(effect, key) for key in ("name", "predicted", "measured", "unit", "included", "why")}
            for effect in effects
        ],
        "against": None if against is None else _against_summary(against),
        "band": None if band is None else _band_summary(band, simulation.trajectory.t),
    }


def _finite(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None


def _against_summary(against: Against) -> dict[str, Any]:
    return {
        "rms_m": against.rms_m,
        "noise_m": against.noise_m,
        "inside_95": against.inside,
        "leaves_s": against.leaves_s,
        "moves": [
            {"name": move.name, "from": move.given, "to": move.value, "in_u": move.in_u, "rms_m": move.rms_m}
            for move in against.moves
        ],
    }


def band_columns(band: Band, t: F8, predicted: F8) -> dict[str, F8]:
    """Return quantiles of displacement, amplitude and phase as columns (n,) by name, in the unit that ends the name.

    Parameters
    ----------
    band : Band
    t : (n,) float64
        Times, s.
    predicted : (n,) float64
        Displacement or distance predicted from the scene's values, m.
    """
    amplitude, of_amplitude = band.amplitude_at(t)
    around = predicted + band.displacement_at(t)
    return {
        **{f"displacement_{level}_m": each for level, each in zip(LEVELS, around, strict=True)},
        "amplitude_m": amplitude,
        **{f"amplitude_{level}_m": each for level, each in zip(LEVELS, of_amplitude, strict=True)},
        **{f"phase_{level}_rad": each for level, each in zip(LEVELS, band.phase_at(t), strict=True)},
    }


def _band_summary(band: Band, t: F8) -> dict[str, Any]:
    """Return the band as JSON; each half-width is the maximum over the run."""
    around, (_, of_amplitude) = band.displacement_at(t), band.amplitude_at(t)
    widths = {
        f"{name}_half_width_{share}_m": float(0.5 * np.max(found[high] - found[low]))
        for name, found in (("displacement", around), ("amplitude", of_amplitude))
        for share, low, high in ((68, 1, 2), (95, 0, 3))
    }
    phase = band.phase_at(t)
    widths["phase_half_width_95_rad"] = float(0.5 * np.max(phase[3] - phase[0]))
    return {
        "members": band.members,
        "seed": band.seed,
        "quantities": list(band.quantities),
        **widths,
    }
