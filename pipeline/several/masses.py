"""Spring constants beside those of the motion: from a line through squared periods, and by Hooke's law."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.bench.spring import oscillating_mass_kg
from pipeline.errors import AnalysisError
from pipeline.numerics.estimate import Estimate
from pipeline.numerics.levels import FALSE_ALARM, NEGLIGIBLE, SIGNIFICANT, coverage_factor
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
    """A spring constant by Hooke's law from loads, positions in m and their line, each (n,) in the order of the loads.

    Loads are forces in N, or masses in kg: then the line is :math:`y = y_0 \\pm (g/k) m`. ``straight`` (n,) says which
    points the line is fitted to, and ``bend`` why others are not: "" if all are.
    """

    constant: Estimate
    expanded: float  # expanded uncertainty of the constant, N/m; its scatter has n - 2 degrees of freedom
    load: F8
    load_unit: str
    position_m: F8
    line_m: F8
    straight: NDArray[np.bool_]
    bend: str = ""

    def normalised_error(self, other: Estimate) -> float:
        """Return :math:`E_n = |k_1 - k_2| / \\sqrt{U_1^2 + U_2^2}`: at most 1 if two constants agree."""
        expanded = math.hypot(self.expanded, coverage_factor(math.inf) * other.u)
        return abs(self.constant.value - other.value) / expanded


def hooke(load: F8, position_m: F8, unit: str = "kg") -> Hooke:
    """Fit a line to rest positions; its u comes from their scatter, and for masses from that of g, 9.81(2) m/s^2.

    A tightly coiled spring is not stretched by the smallest loads, and one that is stretched too far becomes softer.
    Where two lines with a common corner fit better than one (F test at the shared probability over all corners), k is
    that of the line that stretches the spring in proportion: of the upper one if the lower is flat, else of the lower.
    """
    if len(load) < 3 or np.ptp(load) <= 0.0:
        raise AnalysisError(f"Hooke's law needs three masses at least, got {len(np.unique(load))}", "hang on more")
    order = np.argsort(load, kind="stable")
    load, position_m = load[order], position_m[order]
    straight, bend = _straight(load, position_m)
    middle, slope, u_slope = _line(load[straight], position_m[straight])
    if abs(slope) <= SIGNIFICANT * u_slope:
        raise AnalysisError("the positions do not follow the masses", "check the columns of the table")
    factor = GRAVITY if unit == "kg" else Estimate(1.0, 0.0)
    k, u = factor.value / abs(slope), np.array([u_slope / slope, factor.u / factor.value])
    # Both parts are expanded by themselves: an effective number of degrees of freedom would be large where two or three
    # positions lie on the line by chance.
    free = int(np.count_nonzero(straight)) - 2
    expanded = float(np.linalg.norm(u * [coverage_factor(free), coverage_factor(math.inf)]))
    return Hooke(
        constant=Estimate(k, k * float(np.linalg.norm(u)), "N/m"),
        expanded=k * expanded,
        load=load,
        load_unit=unit,
        position_m=position_m,
        line_m=middle + slope * (load - float(np.mean(load[straight]))),
        straight=straight,
        bend=bend,
    )


def _line(load: F8, position_m: F8) -> tuple[float, float, float]:
    """Return the position at the mean load, the slope and its u from the scatter."""
    about = load - load.mean()
    slope = float(about @ position_m / (about @ about))
    residual = position_m - position_m.mean() - slope * about
    return float(position_m.mean()), slope, math.sqrt(float(residual @ residual / (load.size - 2) / (about @ about)))


def _straight(load: F8, position_m: F8) -> tuple[NDArray[np.bool_], str]:
    """Return which points, by their loads, lie where the spring is stretched in proportion; why others do not."""
    from scipy.special import fdtrc

    every, free = np.ones(load.size, np.bool_), load.size - 4
    corners = np.unique(load)[2:-2]
    if not corners.size:
        return every, ""

    def left(corner: float | None) -> float:
        columns = [np.ones_like(load), load - load.mean()]
        columns += [] if corner is None else [np.maximum(load - corner, 0.0)]
        design = np.column_stack(columns)
        residual = position_m - design @ np.linalg.lstsq(design, position_m, rcond=None)[0]
        return float(residual @ residual)

    tried = np.concatenate([corners, 0.5 * (corners[1:] + corners[:-1])])
    bent = np.array([left(corner) for corner in tried.tolist()])
    corner = float(tried[int(np.argmin(bent))])
    better = (left(None) - float(bent.min())) / 2.0 / (float(bent.min()) / free + 1e-30)
    if float(fdtrc(2.0, free, better)) * tried.size > FALSE_ALARM:
        return every, ""
    below, above = load <= corner, load >= corner
    _, slope, u_slope = _line(load[below], position_m[below])
    _, steeper, _ = _line(load[above], position_m[above])
    if abs(slope) < max(SIGNIFICANT * u_slope, NEGLIGIBLE * abs(steeper)):
        return above, "the spring is not stretched by the smaller loads: it has an initial tension"
    return below, "beyond these the spring is stretched out of proportion"
