"""Spring constants beside those of the motion: from a line through squared periods, and by Hooke's law."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.bench.spring import oscillating_mass_kg
from pipeline.errors import AnalysisError
from pipeline.numerics.estimate import Estimate
from pipeline.numerics.levels import NEGLIGIBLE, SIGNIFICANT, coverage_factor
from pipeline.several.compare import SpringRun, shared_covariance, spring_line
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
    """Fit the line as in a comparison, but without a prior mass; None for fewer than three runs or nearly one mass."""
    masses = [run.mass_kg for run in runs]
    mass = np.array([each.value for each in masses])
    if len(runs) < 3 or mass.max() < (1.0 + NEGLIGIBLE) * mass.min():
        return None
    stiffness = np.array([run.angular_frequency.value**2 for run in runs])
    squared = 4.0 * math.pi**2 / stiffness
    about = np.full_like(mass, 4.0 * math.pi**2 / np.polyfit(mass, squared, 1)[0])  # N/m
    covariance, _ = shared_covariance(runs, masses, about, mass_correlation)
    line = spring_line(stiffness, mass, covariance, Estimate(0.0, 1e6 * float(mass.max()), "kg"))
    slope, spring_kg = 4.0 * math.pi**2 / line.constant.value, line.spring.value
    swinging = np.array([oscillating_mass_kg(spring_kg, load) for load in mass.tolist()])
    bend = slope * (swinging - mass - spring_kg / 3.0)
    return MassLine(
        constant=line.constant,
        effective_mass=Estimate(spring_kg / 3.0, line.spring.u / 3.0, "kg"),
        chi2=float(line.residual @ np.linalg.solve(covariance, line.residual)),
        dof=len(runs) - 2,
        mass_kg=mass,
        squared_s2=squared,
        u=np.sqrt(np.diag(covariance)) * squared / line.constant.value,
        bend_s2=bend,
    )


@dataclass(frozen=True, slots=True, eq=False)
class Hooke:
    """A spring constant by Hooke's law, :math:`y = y_0 \\pm (g/k) m`, with the points in kg and m and their line."""

    constant: Estimate
    expanded: float  # expanded uncertainty of the constant, N/m; its scatter has n - 2 degrees of freedom
    mass_kg: F8
    position_m: F8
    line_m: F8

    def normalised_error(self, other: Estimate) -> float:
        """Return :math:`E_n = |k_1 - k_2| / \\sqrt{U_1^2 + U_2^2}`: at most 1 if two constants agree."""
        expanded = math.hypot(self.expanded, coverage_factor(math.inf) * other.u)
        return abs(self.constant.value - other.value) / expanded


def hooke(mass_kg: F8, position_m: F8) -> Hooke:
    """Fit a line to rest positions; its u comes from their scatter, and from that of g, 9.81(2) m/s^2."""
    if len(mass_kg) < 3 or np.ptp(mass_kg) <= 0.0:
        raise AnalysisError(f"Hooke's law needs three masses at least, got {len(np.unique(mass_kg))}", "hang on more")
    design = np.column_stack([np.ones_like(mass_kg), mass_kg - mass_kg.mean()])
    (middle, slope), *_ = np.linalg.lstsq(design, position_m, rcond=None)
    line = design @ np.array([middle, slope])
    u_slope = math.sqrt(float(np.sum((position_m - line) ** 2)) / (len(mass_kg) - 2) / float(np.sum(design[:, 1] ** 2)))
    if abs(slope) <= SIGNIFICANT * u_slope:
        raise AnalysisError("the positions do not follow the masses", "check the columns of the table")
    k, u = GRAVITY.value / abs(slope), np.array([u_slope / slope, GRAVITY.u / GRAVITY.value])
    # Both parts are expanded by themselves: an effective number of degrees of freedom would be large where two or three
    # positions lie on the line by chance.
    expanded = float(np.linalg.norm(u * [coverage_factor(len(mass_kg) - 2), coverage_factor(math.inf)]))
    return Hooke(Estimate(k, k * float(np.linalg.norm(u)), "N/m"), k * expanded, mass_kg, position_m, line)
