"""Velocity and acceleration at every sample, with their uncertainty bands."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pipeline.analyse import Analysis, Oscillation
from pipeline.numerics.quantity import SHOWN
from pipeline.results.kinematics import Smoothed
from pipeline.track import F8
from springmass.report.figures.canvas import (
    BLUE,
    RASTER_POINTS,
    SKY,
    VERMILLION,
    derivative_label,
    legend_above,
    model_phase,
    moving,
    panels,
    share,
    style,
    thinned,
)
from springmass.report.figures.phase_plot import measured_phase
from springmass.report.figures.position import ZOOM_PERIODS, is_long

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["motion_figure"]

BINS = 250  # of a dense series; the minimum and maximum of each bin are drawn


def motion_figure(analysis: Analysis, smoothed: Smoothed | None = None) -> Figure:
    """Draw velocity and acceleration, the difference from the fitted law, and the uncertainties.

    For a long record, the whole velocity is at the top, then the first periods, and below them the lower panels again
    show the whole record.

    Parameters
    ----------
    analysis : Analysis
        Analysis of a record that oscillates.
    smoothed : Smoothed, optional
        Smoothed motion; calculated if omitted.
    """
    motion, unit = moving(analysis), analysis.track.unit
    factor = SHOWN[unit].factor
    smoothed = analysis.smoothed() if smoothed is None else smoothed
    rows = np.flatnonzero(np.isfinite(smoothed.position))
    rows = rows[np.argsort(smoothed.t[rows], kind="stable")]
    t, velocity, u_velocity = smoothed.t[rows], smoothed.velocity[rows], smoothed.u_velocity[rows]
    start, end = float(t[0]), float(t[-1])
    long = is_long(analysis)
    detail = start + ZOOM_PERIODS / motion.cycles.frequency_hz if long else end
    with style():
        heights = [2.2, 1.6, 1.4, 1.5]
        figure, axes = panels([1.5, *heights] if long else heights)
        label = derivative_label(("velocity v", "derivative"), 1, unit)
        if long:
            whole, *axes = axes
            keep = thinned(velocity, 2 * BINS)
            whole.plot(t[keep], velocity[keep], color="#000000", lw=0.4)
            whole.set_xlim(start, end)
            whole.set_ylabel(label)
            whole.axvspan(start, detail, color="#000000", alpha=0.07, lw=0)
        _draw_samples(axes[0], analysis, motion, start, detail)
        inside = t <= detail
        _draw_value(axes[0], t[inside], velocity[inside], u_velocity[inside], labelled=True)
        axes[0].set_ylabel(label)
        acceleration, u_acceleration = smoothed.acceleration[rows], smoothed.u_acceleration[rows]
        _draw_value(axes[1], t[inside], acceleration[inside], u_acceleration[inside])
        axes[1].set_ylabel(derivative_label(("acceleration a", "2nd derivative"), 2, unit))
        _draw_difference(axes[2], t, factor * (velocity - model_phase(motion, t)[1]), factor * u_velocity)
        axes[2].set_ylabel("v − law / (mm/s)" if unit == "m" else derivative_label(("", "− law"), 1, unit))
        _draw_uncertainties(axes[3], t, factor * u_velocity, factor * u_acceleration, unit)
        axes[3].set_xlabel("time / s")
        share(axes[0], axes[1], start, detail)
        share(axes[2], axes[3], start, end)
        if long:
            axes[2].axvspan(start, detail, color="#000000", alpha=0.07, lw=0)
        else:
            axes[1].tick_params(labelbottom=False)
        legend_above(axes[0])
        return figure


def _draw_samples(panel: Axes, analysis: Analysis, motion: Oscillation, start: float, end: float) -> None:
    """Draw, behind the velocity, its values from single samples."""
    t = analysis.track.t
    _, velocity, label = measured_phase(analysis, motion)
    drawn = np.isfinite(velocity) & (t >= start) & (t <= end)
    fastest = 1.3 * float(np.nanmax(np.abs(motion.waveform.velocity)))
    beyond = int(np.count_nonzero(np.abs(velocity[drawn]) > fastest))
    label += f" ({beyond} off the axis)" if beyond else ""
    dense = bool(np.count_nonzero(drawn) > RASTER_POINTS)
    panel.plot(t[drawn], velocity[drawn], ".", ms=4.0, mew=0, color="#a0a0a0", label=label, rasterized=dense)
    panel.set_ylim(-fastest, fastest)


def _draw_value(panel: Axes, t: F8, value: F8, u: F8, *, labelled: bool = False) -> None:
    keep = thinned(value, BINS)
    band, line = ("± u", "fitted motion") if labelled else (None, None)
    panel.fill_between(t[keep], (value - u)[keep], (value + u)[keep], color=SKY, alpha=0.6, lw=0, label=band)
    panel.plot(t[keep], value[keep], color="#000000", lw=0.8, label=line)


def _draw_difference(panel: Axes, t: F8, difference: F8, u: F8) -> None:
    """Draw the band around zero, and the difference."""
    keep = thinned(u, BINS)
    panel.fill_between(t[keep], -u[keep], u[keep], color=SKY, alpha=0.45, lw=0)
    keep = thinned(difference, BINS)
    panel.plot(t[keep], difference[keep], color="#000000", lw=0.6)
    reach = 1.1 * max(float(np.max(u)), float(np.max(np.abs(difference))))
    panel.set_ylim(-reach, reach)


def _draw_uncertainties(panel: Axes, t: F8, u_velocity: F8, u_acceleration: F8, unit: str) -> None:
    """Draw both standard uncertainties, that of the acceleration on an axis on the right."""
    beside = panel.twinx()
    beside.grid(visible=False)
    labels = ("u(v) / (mm/s)", "u(a) / (mm/s²)")
    if unit != "m":
        labels = derivative_label(("", "its u"), 1, unit), derivative_label(("", "its u"), 2, unit)
    for axes, u, colour, dashes, label in (
        (panel, u_velocity, BLUE, "-", labels[0]),
        (beside, u_acceleration, VERMILLION, (0, (3, 1.5)), labels[1]),
    ):
        keep = thinned(u, BINS)
        axes.plot(t[keep], u[keep], color=colour, ls=dashes, lw=0.9)
        axes.set_ylim(0.0, 1.15 * float(np.max(u)))
        axes.set_ylabel(label, color=colour)
        axes.tick_params(axis="y", labelcolor=colour)
