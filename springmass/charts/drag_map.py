"""Drag coefficients of many runs against Reynolds and Keulegan-Carpenter number, beside lines from the literature."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from acquisition.errors import visible
from pipeline.analyse import Analysis, Oscillation
from pipeline.bench.disc import STEADY_DISC_DRAG, disc_drag_coefficient
from pipeline.track import F8
from springmass.charts.chart import Chart, Panel, Series, line_of

POINTS = 8  # of one run
LARGEST = 1e100  # whose square is still finite


def drag_points(analysis: Analysis) -> list[list[float]]:
    """Return Re, KC, drag coefficient and its u at amplitudes spaced evenly on a logarithmic scale."""
    motion, diameter, estimates = analysis.motion, analysis.scene.disc_diameter_m, analysis.estimates
    if not isinstance(motion, Oscillation):
        return []
    derived = motion.derived
    curve = derived.drag_curve(motion.damping, motion.demodulated)
    if curve is None or diameter is None or derived.displacement is None or "reynolds_number" not in estimates:
        return []
    lengths: F8 = curve.x * derived.displacement.value
    order = np.argsort(lengths)
    if not lengths[order[0]] > 0:
        return []
    at = np.geomspace(lengths[order[0]], lengths[order[-1]], POINTS)
    value, u = (np.interp(at, lengths[order], each[order]) for each in (curve.y, curve.u))
    # The Re estimate uses the rms velocity of the whole run; at amplitude A the rms velocity is omega A / sqrt 2.
    per_velocity = estimates["reynolds_number"].value / estimates["velocity_rms"].value
    reynolds = per_velocity * estimates["angular_frequency"].value * at / np.sqrt(2.0)
    points = np.column_stack([reynolds, 2.0 * np.pi * at / diameter.value, value, u])
    kept = np.isfinite(points).all(axis=1) & (np.abs(points).max(axis=1) <= LARGEST)
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
        shown = (0.7 * min(low, float(line.min())), 1.4 * max(high, STEADY_DISC_DRAG))
        panels.append(Panel("effective drag coefficient", tuple(series), 3.6, label, log=True, log_x=True, range=shown))
    caption = (
        "Effective drag coefficient of every run from its first to its last amplitude, with bands of u. It counts all "
        "damping as drag of the disc, that of spring and hook too."
    )
    return Chart("drag-map", "Drag of discs", caption, tuple(panels))
