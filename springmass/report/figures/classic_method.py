"""The lab report's own method on the same axes as this analysis: the values it picks, and why it differs."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pipeline.analyse import Analysis
from pipeline.numerics.quantity import SHOWN
from pipeline.results.classic import CYCLES, Classic
from springmass.report.figures.amplitude import amplitude_panel
from springmass.report.figures.canvas import (
    ORANGE,
    VERMILLION,
    legend_above,
    moving,
    panels,
    style,
    thinned,
)
from springmass.report.figures.position import position_panel

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["classic_figure"]

BINS = 300


def classic_figure(analysis: Analysis, classic: Classic) -> Figure:
    """Draw the lab report's choices over this analysis: two maxima, two extremes, windows and their exponential.

    Parameters
    ----------
    analysis : Analysis
        Analysis of a record that oscillates.
    classic : Classic
        The lab report's method on the same record.
    """
    motion, factor = moving(analysis), SHOWN[analysis.track.unit].factor
    with style():
        figure, (above, below) = panels([2.7, 3.3])
        period = classic.estimates["period"].value
        start = max(float(np.nanmin(analysis.track.t)), float(classic.crests_t[0]) - 0.75 * period)
        end = min(float(np.nanmax(analysis.track.t)), float(classic.crests_t[-1]) + 0.75 * period)
        position_panel(above, analysis, start, end)
        _draw_picks(above, classic, factor)
        above.set_xlim(start, end)
        above.set_xlabel("time / s")
        amplitude_panel(below, analysis, [motion.damping.selected])
        keep = thinned(classic.window_amplitude, BINS)
        t, windows = classic.window_t[keep], factor * classic.window_amplitude[keep]
        below.plot(t, windows, color=ORANGE, lw=0.8, label="half the range in 1.5 s", zorder=2.2)
        curve = factor * classic.exponential()[keep]
        below.plot(t, curve, color=VERMILLION, ls=(0, (5, 2)), lw=1.2, label="its exponential", zorder=3.5)
        low, high = below.get_ylim()
        below.set_ylim(min(low, 0.9 * float(curve.min())), max(high, 1.05 * float(curve.max())))
        below.set_xlim(motion.damping.t0, float(np.nanmax(analysis.track.t)))
        below.set_xlabel("time / s")
        legend_above(below, 2)
        legend_above(above)
        return figure


def _draw_picks(panel: Axes, classic: Classic, factor: float) -> None:
    """Mark the maxima that give the period, and the extremes that give the amplitude."""
    low, high = panel.get_ylim()
    ends = np.array([0, CYCLES])
    crests = factor * classic.crests_y[ends]
    panel.plot(
        classic.crests_t[ends],
        np.clip(crests, low, high),
        "D",
        ms=5,
        mfc="none",
        color=VERMILLION,
        label=f"picked maxima, {CYCLES} periods apart",
        zorder=5,
        clip_on=False,
    )
    least, greatest = (factor * y for _, y in classic.extremes)
    for i, y in enumerate((least, greatest)):
        label = None if i else f"extremes of the whole record, {least:.1f} and {greatest:.1f}"
        panel.axhline(float(np.clip(y, low, high)), color=ORANGE, lw=1.0, ls=(0, (3, 1.5)), label=label)
