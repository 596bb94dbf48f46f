"""Spring constants beside those of the motion: from a line through squared periods, and by Hooke's law."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.bench.spring import oscillating_mass_kg
from pipeline.errors import AnalysisError
from pipeline.numerics.estimate import Estimate
from pipeline.numerics.levels import COVERAGE, NEGLIGIBLE, SIGNIFICANT, normal_quantile
from pipeline.results.compare import SpringRun
from pipeline.track import F8

GRAVITY = Estimate(9.81, 0.015, "m/s^2")  # 9.780 at the equator to 9.832 at the poles, uniformly distributed


@dataclass(frozen=True, slots=True, eq=False)
class MassLine:
    """A line through the squared periods of one spring, :math:`T^2 = (4\\pi^2/k)(m + m_e)`.

    ``effective_mass`` is :math:`m_e`, a third of the spring's mass. The exact squared periods are longer by
    ``bend_s2`` (n,), about :math:`(4\\pi^2/k)\\,m_s^2/(45 m)`, which is taken off before the fit. ``mass_kg`` (n,),
    ``squared_s2`` (n,) and its ``u`` (n,), which contains that of the mass, are the points.
    """

    constant: Estimate
    effective_mass: Estimate
    chi2: float
    dof: int
    mass_kg: F8
    squared_s2: F8
    u: F8
    bend_s2: F8

    def at(self, mass_kg: F8) -> F8:
        """Return the squared periods of the line, s^2."""
        return 4.0 * math.pi**2 / self.constant.value * (mass_kg + self.effective_mass.value)


def mass_line(runs: Sequence[SpringRun], mass_correlation: float = 0.0) -> MassLine | None:
    """Fit the line by generalised least squares; None for fewer than three runs or bobs of nearly one mass.

    The uncertainty of a mass counts as one of the squared period, by the slope. A common clock changes the slope alone.
    """
    mass = np.array([run.mass_kg.value for run in runs])
    if len(runs) < 3 or mass.max() < (1.0 + NEGLIGIBLE) * mass.min():
        return None
    omega = np.array([run.angular_frequency.value for run in runs])
    squared = (2.0 * math.pi / omega) ** 2
    of_period = 2.0 * squared * np.array([run.angular_frequency.u for run in runs]) / omega
    of_clock = 2.0 * squared * np.array([run.u_clock for run in runs])
    one_clock = np.array([[a.clock == b.clock for b in runs] for a in runs])
    of_mass = np.polyfit(mass, squared, 1)[0] * np.array([run.mass_kg.u for run in runs])
    shared = one_clock * np.outer(of_clock, of_clock) + mass_correlation * np.outer(of_mass, of_mass)
    own = of_period**2 + (1.0 - mass_correlation) * of_mass**2
    covariance = np.diag(np.maximum(own, 1e-24 * squared**2)) + shared
    design = np.column_stack([np.ones_like(mass), mass])
    weighted = np.linalg.solve(covariance, design)
    state = np.linalg.inv(design.T @ weighted)
    bend = np.zeros_like(mass)
    for _ in range(4):  # the bend depends on the mass of the spring, which the line gives
        start, slope = state @ (weighted.T @ (squared - bend))
        spring_kg = max(3.0 * start / slope, 0.0)
        swinging = np.array([oscillating_mass_kg(spring_kg, load) for load in mass.tolist()])
        bend = slope * (swinging - mass - spring_kg / 3.0)
    residual = squared - bend - design @ np.array([start, slope])
    ratio = start / slope
    gradient = np.array([1.0, -ratio]) / slope
    return MassLine(
        Estimate(4.0 * math.pi**2 / slope, 4.0 * math.pi**2 / slope**2 * math.sqrt(state[1, 1]), "N/m"),
        Estimate(float(ratio), math.sqrt(gradient @ state @ gradient), "kg"),
        float(residual @ np.linalg.solve(covariance, residual)),
        len(runs) - 2,
        mass,
        squared,
        np.sqrt(np.diag(covariance)),
        bend,
    )


@dataclass(frozen=True, slots=True, eq=False)
class Hooke:
    """A spring constant by Hooke's law, :math:`y = y_0 \\pm (g/k) m`, with the points in kg and m and their line."""

    constant: Estimate
    mass_kg: F8
    position_m: F8
    line_m: F8

    def normalised_error(self, other: Estimate) -> float:
        """Return :math:`E_n = |k_1 - k_2| / \\sqrt{U_1^2 + U_2^2}`: at most 1 if two constants agree."""
        expanded = normal_quantile(COVERAGE) * math.hypot(self.constant.u, other.u)
        return abs(self.constant.value - other.value) / expanded


def hooke(mass_kg: F8, position_m: F8) -> Hooke:
    """Fit a line to rest positions; its u comes from their scatter, and from that of g, 9.81(2) m/s^2."""
    if len(mass_kg) < 3 or np.ptp(mass_kg) <= 0.0:
        raise AnalysisError(f"Hooke's law needs three masses at least, got {len(np.unique(mass_kg))}; hang on more")
    design = np.column_stack([np.ones_like(mass_kg), mass_kg - mass_kg.mean()])
    (middle, slope), *_ = np.linalg.lstsq(design, position_m, rcond=None)
    line = design @ np.array([middle, slope])
    u_slope = math.sqrt(float(np.sum((position_m - line) ** 2)) / (len(mass_kg) - 2) / float(np.sum(design[:, 1] ** 2)))
    if abs(slope) <= SIGNIFICANT * u_slope:
        raise AnalysisError("the positions do not follow the masses; check the columns of the table")
    k = GRAVITY.value / abs(slope)
    return Hooke(
        Estimate(k, k * math.hypot(u_slope / slope, GRAVITY.u / GRAVITY.value), "N/m"), mass_kg, position_m, line
    )
