"""Charts of several runs: positions, spring constants, masses, Hooke's law, a course and the drag of its discs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from acquisition.errors import visible
from pipeline.analyse import Analysis
from pipeline.bench.disc import STEADY_DISC_DRAG, disc_drag_coefficient
from pipeline.numerics.estimate import Estimate
from pipeline.several.compare import Comparison
from pipeline.several.masses import Hooke, MassLine
from pipeline.track import F8
from pipeline.units import RECORDED_UNITS, noun
from springmass.charts.chart import Chart, Panel, Series, band_of, line_of, value_label
from springmass.charts.run import DETAIL_PERIODS, used_samples
from springmass.typeset import prefixed, pretty

MOST_OVERLAID = 8  # runs: as many as there are colours of other lines


def overlay(names: Sequence[str], analyses: Sequence[Analysis]) -> Chart | None:
    """Displacements of several runs against the time since each first used sample; None for different units."""
    unit = analyses[0].track.unit
    if any(a.track.unit != unit for a in analyses):
        return None
    series, fastest = [], 0.0
    for name, a in list(zip(names, analyses, strict=True))[:MOST_OVERLAID]:
        used = used_samples(a)
        if not used.any():
            continue
        t, y, motion = a.track.t[used], a.track.y[used], a.oscillation
        rest = np.full(t.size, np.mean(y))
        if motion is not None:
            rest, fastest = motion.rest.at(t), max(fastest, motion.windows.cycles.frequency_hz)
        series.append(line_of(visible(name), t - t[0], (y - rest) * RECORDED_UNITS[unit].factor, "other"))
    what = "displacement" if unit == "m" else f"{noun(unit)} from rest"
    panel = Panel(value_label(what, unit), tuple(series), x_label="time since the first sample used / s")
    which = "every run" if len(names) <= MOST_OVERLAID else f"the first {MOST_OVERLAID} of {len(names)} runs"
    caption = f"Displacement of {which} from its rest position."
    return Chart("overlay", "Positions", caption, (panel,), DETAIL_PERIODS / fastest if fastest else None)


def comparison(compared: Comparison) -> Chart:
    """Spring constants with their uncertainties and their mean; below, the difference of each from it over its u."""
    names = tuple(visible(name) for name in compared.names)
    x = np.arange(1.0, len(names) + 1.0)
    k, u = (np.array([getattr(each, of) for each in compared.each]) for of in ("value", "u"))
    exchanged = np.array([name in compared.exchanged for name in compared.names])
    series = [Series("spring constant ± u", x[~exchanged], k[~exchanged], u=u[~exchanged])]
    if exchanged.any():
        series.append(Series("perhaps exchanged", x[exchanged], k[exchanged], "flagged", u=u[exchanged]))
    if compared.agree:  # constants that disagree have no meaningful mean
        series[:0] = _mean(compared.spring_constant, len(names))
    low, high = float(np.min(k - u)), float(np.max(k + u))
    margin = 0.1 * (high - low) or 1.0
    panels = (
        Panel("k / (N/m)", tuple(series), x_label="run", names=names, range=(low - margin, high + margin)),
        Panel("residual / u", (Series("residual", x, np.array(compared.pulls)),), 1.2, "run", zero=True, names=names),
    )
    caption = (
        "Spring constant of every run; below, its difference from the mean divided by its uncertainty, in which errors "
        "common to all runs (clock, mass of the spring) cancel."
    )
    return Chart("comparison", "Comparison", caption, panels)


def _mean(mean: Estimate, places: int) -> list[Series]:
    """Return a mean with its u across all places of an axis of names."""
    ends, value = np.array([0.5, places + 0.5]), np.full(2, mean.value)
    return [band_of("mean ± u", ends, value, np.full(2, mean.u)), line_of("mean", ends, value)]


def masses(line: MassLine) -> Chart:
    """Squared periods against the mass with their line, and what is left over its u, with the exact condition."""
    order = np.argsort(line.mass_kg)
    mass, squared, u, bend = (each[order] for each in (line.mass_kg, line.squared_s2, line.u, line.bend_s2))
    start = min(-line.effective_mass.value, 0.0)
    ends = np.array([start, 1.05 * float(mass[-1])])
    fitted, zero = line_of("line", ends * 1e3, line.at(ends)), line_of("line", ends * 1e3, np.zeros(2))
    exact = line_of("exact condition", mass * 1e3, bend / u, "other")
    residual = (squared - line.at(mass)) / u
    x_label = "mass on the spring / g"
    panels = (
        Panel("T² / s²", (fitted, Series("squared period ± u", mass * 1e3, squared, u=u)), x_label=x_label),
        Panel("residual / u", (zero, exact, Series("residual", mass * 1e3, residual)), 1.4, x_label, zero=True),
    )
    zero_at = pretty(prefixed(line.effective_mass))
    caption = (
        f"Squared period of every bob. The line has the slope 4π²/k with k = {pretty(line.constant)}; the mass that it "
        f"adds to the bob's, the effective mass of the spring, is {zero_at}. Below, the differences from the line, "
        "and those of a spring along which waves run."
    )
    return Chart("masses", "Many masses", caption, panels)


def static(hooke: Hooke) -> Chart:
    """Rest positions against the load, with the line of Hooke's law."""
    by_mass, used = hooke.load_unit == "kg", hooke.straight
    load, position, line = hooke.load * (1e3 if by_mass else 1.0), 1e3 * hooke.position_m, 1e3 * hooke.line_m
    series = [line_of("line", load[used], line[used]), Series("rest position", load[used], position[used])]
    if not used.all():
        series.append(Series("not on the line", load[~used], position[~used], "flagged"))
    slope = "g/k" if by_mass else "1/k"
    bend = f" {hooke.bend[:1].upper()}{hooke.bend[1:]}." if hooke.bend else ""
    caption = f"Rest position of every load. The line has the slope {slope} with k = {pretty(hooke.constant)}.{bend}"
    x_label = "mass on the spring / g" if by_mass else "force on the spring / N"
    return Chart("hooke", "Hooke's law", caption, (Panel("position / mm", tuple(series), x_label=x_label),))


class CourseValue(NamedTuple):
    """One quantity of a run: its place on the axis is that of its group."""

    run: str
    group: str
    value: float
    u: float


def course(
    label: str, x_label: str, rows: Sequence[CourseValue], differing: Mapping[str, str], mean: Estimate | None = None
) -> Chart:
    """One quantity of all runs of a course, with their mean, the runs of a group beside one another.

    Runs that differ from the others are given by name with a sentence each; those beyond the axis stand at its edge.
    """
    groups: dict[str, list[CourseValue]] = {}
    for row in rows:
        groups.setdefault(row.group, []).append(row)
    x, ordered = [], []
    for place, group in enumerate(groups.values(), 1):
        x += [place + GROUP_WIDTH * ((i + 0.5) / len(group) - 0.5) for i in range(len(group))]
        ordered += group
    at, values, us = np.array(x), np.array([row.value for row in ordered]), np.array([row.u for row in ordered])
    apart = np.array([row.run in differing for row in ordered])
    good, why = ~apart, tuple(f"{row.run}: {differing[row.run]}" for row in ordered if row.run in differing)
    names = tuple(row.run for row in ordered if row.run not in differing)
    series = [Series("value ± u", at[good], values[good], u=us[good], why=names)]
    if mean is not None:
        series[:0] = _mean(mean, len(groups))
    if apart.any():
        series.append(Series("differs from its course", at[apart], values[apart], "flagged", u=us[apart], why=why))
    panel = Panel(label, tuple(series), x_label=x_label, names=tuple(groups))
    caption = "Point at a run to read its name, click to find it in the table."
    return Chart("course", "All runs", caption, (panel,))


GROUP_WIDTH = 0.6  # width of the place of a group, of the distance between two groups
MOST_BINS, FEWEST_BINS = 60, 8


def outline(analysis: Analysis) -> str:
    """Return an outline of the recording as an SVG path in a box of 120 by 30; empty if nothing was measured."""
    t, y = analysis.track.t, analysis.track.y
    there = np.isfinite(t) & np.isfinite(y)
    order = np.argsort(t[there], kind="stable")
    t, y = t[there][order], y[there][order]
    if t.size < 2 or not np.ptp(t) > 0:
        return ""
    span = t[-1] - t[0]
    # A bin shorter than a period would not show the outline.
    period = analysis.estimates.get("period")
    count = MOST_BINS if period is None else int(np.clip(span / period.value, FEWEST_BINS, MOST_BINS))
    ends = np.searchsorted(t, t[0] + span * np.arange(count + 1) / count)
    filled = np.flatnonzero(np.diff(ends))
    low, high = (edge.reduceat(y, ends[filled]) for edge in (np.minimum, np.maximum))
    beyond = y.size // 200  # the extreme 0.5 % are ignored, so that false echoes do not flatten the outline
    bottom, top = np.partition(y, (beyond, -1 - beyond))[[beyond, -1 - beyond]]
    scale = 28.0 / max(top - bottom, 1e-300)
    above, below = (np.clip(29.0 - (edge - bottom) * scale, 0.0, 30.0).round() for edge in (high, low))
    x = ((filled + 0.5) * 120.0 / count).round(1).tolist()
    edge = [*zip(x, above.tolist(), strict=True), *reversed([*zip(x, below.tolist(), strict=True)])]
    return "M" + "L".join(f"{a:g} {b:g}" for a, b in edge) + "Z"


POINTS_OF_RUN = 8  # of one run
LARGEST_DRAWN = 1e100  # maximum magnitude of a number in a row, whose square is still finite; larger ones are left out


def drag_points(analysis: Analysis) -> list[list[float]]:
    """Return Re, KC, drag coefficient and its u at amplitudes spaced evenly on a logarithmic scale."""
    diameter, estimates = analysis.scene.disc_diameter_m, analysis.estimates
    curve, displacement = analysis.drag_curve(), analysis.derived.displacement
    if curve is None or diameter is None or displacement is None or "reynolds_number" not in estimates:
        return []
    lengths: F8 = curve.x * displacement.value
    order = np.argsort(lengths)
    if not lengths[order[0]] > 0:
        return []
    at = np.geomspace(lengths[order[0]], lengths[order[-1]], POINTS_OF_RUN)
    value, u = (np.interp(at, lengths[order], each[order]) for each in (curve.y, curve.u))
    # The Re estimate uses the rms velocity of the whole run; at amplitude A the rms velocity is omega A / sqrt 2.
    per_velocity = estimates["reynolds_number"].value / estimates["velocity_rms"].value
    reynolds = per_velocity * estimates["angular_frequency"].value * at / np.sqrt(2.0)
    points = np.column_stack([reynolds, 2.0 * np.pi * at / diameter.value, value, u])
    kept = np.isfinite(points).all(axis=1) & (np.abs(points).max(axis=1) <= LARGEST_DRAWN)
    return [[float(f"{x:.6g}") for x in point] for point in points[kept].tolist()]


def drag_of_disc_at_rest(reynolds: F8) -> F8:
    """Return the drag coefficient of a disc perpendicular to a steady stream, at Reynolds numbers (n,).

    :math:`64/(\\pi Re)` for creeping flow (A. Oberbeck, J. reine angew. Math. 81 (1876) 62; H. Lamb, Hydrodynamics,
    art. 339), up to the intersection with 1.17 for high Reynolds numbers (S. F. Hoerner, Fluid-Dynamic Drag, 1965,
    section III). These are the two limits; the transition between them is not modelled.
    """
    return np.maximum(64.0 / (np.pi * reynolds), STEADY_DISC_DRAG)


def drag_of_plate(keulegan_carpenter: F8) -> F8:
    """Return the drag coefficient of a long flat plate that oscillates broadside on, at KC numbers (n,).

    :math:`\\max(10\\,KC^{-1/3}, 1.95)`, fitted (M. Luhar, H. M. Nepf, J. Fluids Struct. 61 (2016) 20) to coefficients
    measured by Keulegan and Carpenter (1958) and by Sarpkaya and O'Keefe (1996).
    """
    return np.maximum(10.0 * keulegan_carpenter ** (-1.0 / 3.0), 1.95)


def drag_map(runs: Sequence[tuple[str, F8]]) -> Chart | None:
    """Return the map of runs, each the name of its disc and (n, 4) of Re, KC, the drag coefficient and its u.

    It has one line per disc and the band of each run; None without a positive coefficient.
    """
    runs = [(disc, points[points[:, 2] > 0.0]) for disc, points in runs if len(points) and (points[:, 2] > 0.0).any()]
    if not runs:
        return None
    panels = []
    for column, label in enumerate(("Reynolds number", "Keulegan-Carpenter number")):
        series, ends, heights = [], [], []
        for disc in dict.fromkeys(name for name, _ in runs):
            parts = [points[:, [column, 2, 3]] for name, points in runs if name == disc]
            rows = np.concatenate([np.vstack([part, np.full((1, 3), np.nan)]) for part in parts])
            words = f"disc {visible(disc)}" if disc else "runs"
            series.append(Series(words, rows[:, 0], rows[:, 1], "other", line=True, u=rows[:, 2]))
            ends += [np.nanmin(rows[:, 0]), np.nanmax(rows[:, 0])]
            heights.append(rows[:, 1])
        grid = np.geomspace(0.8 * min(ends), 1.25 * max(ends), 200)
        if column == 0:
            line, words = drag_of_disc_at_rest(grid), "disc, steady stream (limits)"
        else:
            line, words = drag_of_plate(grid), "oscillating flat plate, Luhar and Nepf 2016"
            assumed = np.array([disc_drag_coefficient(x) for x in grid.tolist()])
            series.append(line_of("oscillating disc, as simulate assumes", grid, assumed, "rest"))
        series.append(line_of(words, grid, line))
        low, high = np.nanquantile(np.concatenate(heights), (0.01, 0.99)).tolist()
        least = float(line.min())
        shown = (0.7 * min(low, least), 1.4 * max(high, STEADY_DISC_DRAG, least))
        panels.append(Panel("effective drag coefficient", tuple(series), 3.6, label, log=True, log_x=True, range=shown))
    caption = (
        "Effective drag coefficient of every run from its first to its last amplitude, with bands of u. It counts all "
        "damping as drag of the disc, that of spring and hook too."
    )
    return Chart("drag-map", "Drag of discs", caption, tuple(panels))
