"""Charts of several runs: positions over one another, spring constants side by side, a course at a glance."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from acquisition.errors import visible
from pipeline.analyse import Analysis, Oscillation
from pipeline.numerics.quantity import SHOWN, noun
from pipeline.results.compare import Comparison
from pipeline.track import UNUSABLE
from springmass.charts.chart import Chart, Panel, Series, band_of, line_of, value_label

DETAIL_PERIODS = 8


def overlay(names: Sequence[str], analyses: Sequence[Analysis]) -> Chart | None:
    """Displacements of several runs against the time since each first used sample; None for different units."""
    unit = analyses[0].track.unit
    if any(a.track.unit != unit for a in analyses):
        return None
    series, fastest = [], 0.0
    for name, a in zip(names, analyses, strict=True):
        used = ((a.flags & UNUSABLE) == 0) & np.isfinite(a.track.y)
        if not used.any():
            continue
        t, y, motion = a.track.t[used], a.track.y[used], a.motion
        rest = np.mean(y)
        if isinstance(motion, Oscillation):
            rest, fastest = motion.rest.at(t), max(fastest, motion.cycles.frequency_hz)
        series.append(line_of(visible(name), t - t[0], (y - rest) * SHOWN[unit].factor, "other"))
    what = "displacement" if unit == "m" else f"{noun(unit)} from rest"
    panel = Panel(value_label(what, unit), tuple(series), x_label="time since the first sample used / s")
    caption = "Displacement of every run from its rest position."
    return Chart("overlay", "Positions", caption, (panel,), DETAIL_PERIODS / fastest if fastest else None)


def comparison(found: Comparison) -> Chart:
    """Spring constants with their uncertainties and their mean; below, the difference of each from it over its u."""
    names = tuple(visible(name) for name in found.names)
    x = np.arange(1.0, len(names) + 1.0)
    k, u = (np.array([getattr(each, of) for each in found.each]) for of in ("value", "u"))
    exchanged = np.array([name in found.exchanged for name in found.names])
    series = [Series("spring constant ± u", x[~exchanged], k[~exchanged], u=u[~exchanged])]
    if exchanged.any():
        series.append(Series("perhaps exchanged", x[exchanged], k[exchanged], "flagged", u=u[exchanged]))
    if found.agree:  # constants that disagree have no meaningful mean
        mean, ends = found.spring_constant, np.array([0.5, len(names) + 0.5])
        series[:0] = [
            band_of("mean ± u", ends, np.full(2, mean.value), np.full(2, mean.u)),
            line_of("mean", ends, np.full(2, mean.value)),
        ]
    low, high = float(np.min(k - u)), float(np.max(k + u))
    margin = 0.1 * (high - low) or 1.0
    panels = (
        Panel("k / (N/m)", tuple(series), x_label="run", names=names, range=(low - margin, high + margin)),
        Panel("residual / u", (Series("residual", x, np.array(found.pulls)),), 1.2, "run", zero=True, names=names),
    )
    caption = (
        "Spring constant of every run; below, its difference from the mean divided by its uncertainty, in which errors "
        "common to all runs (clock, mass of the spring) cancel."
    )
    return Chart("comparison", "Comparison", caption, panels)


def course(label: str, rows: Sequence[tuple[str, float, float]], differing: Mapping[str, str]) -> Chart:
    """One quantity of all runs of a course, each row a name with value and uncertainty.

    Runs that differ from the others are given by name with a sentence each; those beyond the axis stand at its edge.
    """
    names, y, u = zip(*rows, strict=True)
    x, values, us = np.arange(1.0, len(rows) + 1.0), np.array(y), np.array(u)
    apart = np.array([name in differing for name in names])
    good, why = ~apart, tuple(f"{name}: {differing[name]}" for name in names if name in differing)
    series = [Series("value ± u", x[good], values[good], u=us[good])]
    if apart.any():
        series.append(Series("differs from its course", x[apart], values[apart], "flagged", u=us[apart], why=why))
    panel = Panel(label, tuple(series), x_label="run", names=names)
    return Chart("course", "All runs", "Point at a run to read its name.", (panel,))
