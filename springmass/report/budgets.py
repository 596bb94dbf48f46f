"""Uncertainty budgets for readers: which input contributes what share, in words and as CSV."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass

from pipeline.analyse import Analysis, Oscillation
from pipeline.results.budget import Budget, Contribution
from springmass.report.tables import QUANTITIES, cell

__all__ = ["INPUTS", "BudgetRow", "budget_csv", "budget_text", "budgets_of", "correlations_of"]

INPUTS = {
    "angular_frequency": "scatter of the phases",
    "clock_rate": "rate of the clock",
    "damping_law": "scatter of the amplitudes",
    "choice_of_law": "choice among admissible laws",
    "rest_position": "scatter of the rest position",
    "phase": "scatter of the phases",
    "noise": "scatter of the samples",
    "bob_mass": "mass of the bob",
    "spring_mass": "mass of the spring",
    "unstated_spring_mass": "mass of the spring, not stated",
    "disc_diameter": "diameter of the disc",
    "air_temperature": "air temperature",
    "air_pressure": "air pressure",
    "relative_humidity": "relative humidity",
    "density_formula": "formula of the air's density",
    "viscosity_formula": "formula of the air's viscosity",
    "speed_of_sound_formula": "formula of the speed of sound",
    "recorded_speed_of_sound": "speed of sound of the record",
    "calibrated_scale": "calibration of the scale",
    "sensor_zero": "calibration of the zero",
    "model_misfit": "what differs from a sinusoid in every period",
    "sensor_smoothing": "smoothing by the sensor",
    "sensor_mean_samples": "running mean of the sensor",
    "sensor_median_samples": "running median of the sensor",
    "sensor_median_cut": "crests cut by a running median",
    "sensor_lag": "lag of the sensor",
    "choice_of_fit": "fit of windows against fit of the whole waveform",
    "held_samples": "distances held by the sensor",
}
"""Every input of :mod:`pipeline.results.derive` in words."""
SAME = ("frequency", "angular_frequency")  # one number with the period
CORRELATED = frozenset({"period", "spring_constant", "amplitude", "damping_rate", "gamma", "beta", "mu", "c", "n"})
"""Results whose correlations the page tells: as many as a phone is wide."""
LEAST_SHARE = 1e-3  # of the variance; what is less does not reach a printed digit of u


@dataclass(frozen=True, slots=True)
class BudgetRow:
    """One quantity of the budget table.

    Parameters
    ----------
    name, quantity : str
        As in ``Derived.budgets``, and in words.
    budget : Budget
    contributions : tuple of Contribution
        Those of more than a thousandth of the variance.
    rest : float
        Share of all others together.
    """

    name: str
    quantity: str
    budget: Budget
    contributions: tuple[Contribution, ...]
    rest: float


def budgets_of(analysis: Analysis) -> tuple[BudgetRow, ...]:
    """Return the budget table of a run, in the order of Table 1; empty where nothing oscillates.

    Frequencies are left out: they share the period's budget.

    Parameters
    ----------
    analysis : Analysis
    """
    if not isinstance(analysis.motion, Oscillation):
        return ()
    budgets = analysis.motion.derived.budgets
    rows = []
    for name, quantity in QUANTITIES.items():
        if name in budgets and name not in SAME and budgets[name].contributions:
            every = budgets[name].contributions
            told = tuple(c for c in every if c.share >= LEAST_SHARE)
            rows.append(BudgetRow(name, quantity, budgets[name], told, sum(c.share for c in every[len(told) :])))
    return tuple(rows)


def correlations_of(analysis: Analysis) -> tuple[tuple[str, ...], list[list[float]]]:
    """Return the correlations between the results that others are calculated from; empty where nothing oscillates.

    ``results.json`` holds those between all results.

    Parameters
    ----------
    analysis : Analysis

    Returns
    -------
    names : tuple of str
        Of the results, in the order of Table 1.
    matrix : list of list of float
        Between -1 and 1.
    """
    if not isinstance(analysis.motion, Oscillation):
        return (), []
    joint = analysis.motion.derived.joint
    names = tuple(name for name in QUANTITIES if name in CORRELATED and name in joint.names)
    rows = [joint.names.index(name) for name in names]
    return names, [[float(joint.correlation[i, j]) for j in rows] for i in rows]


def budget_text(analysis: Analysis) -> str:
    """Return the budget in brief: a line a quantity with its two greatest inputs, in ASCII.

    Quantities with one input alone are left out: their line would say nothing.

    Parameters
    ----------
    analysis : Analysis
    """
    told = {row: [c for c in row.contributions if c.share >= 0.01] for row in budgets_of(analysis)}
    rows = [row for row, inputs in told.items() if len(inputs) > 1]
    if not rows:
        return ""
    left = max(len(row.quantity) for row in rows) + 2
    lines = ["Where the uncertainty comes from (share of the variance; A: the record's scatter, B: anything else):"]
    for row in rows:
        greatest = [f"{INPUTS[c.name]} ({c.kind}) {100 * c.share:.0f} %" for c in told[row][:2]]
        lines.append(f"  {row.quantity:<{left}}{', '.join(greatest)}")
    return "\n".join(lines)


def budget_csv(names: Sequence[str], analyses: Sequence[Analysis]) -> str:
    """Return every budget as CSV, one line an input; numbers keep all their digits.

    Parameters
    ----------
    names : sequence of str
    analyses : sequence of Analysis
    """
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    heads = ["run", "quantity", "input", "type", "value", "u", "unit", "sensitivity", "contribution", "share"]
    writer.writerow(heads)
    for run, analysis in zip(names, analyses, strict=True):
        if not isinstance(analysis.motion, Oscillation):
            continue
        for quantity, budget in analysis.motion.derived.budgets.items():
            for c in budget.contributions:
                given = ["", "", ""] if c.input is None else [repr(c.input.value), repr(c.input.u), c.input.unit]
                slope = "" if c.sensitivity is None else repr(c.sensitivity)
                writer.writerow([cell(run), quantity, c.name, c.kind, *given, slope, repr(c.u), repr(c.share)])
    return out.getvalue()
