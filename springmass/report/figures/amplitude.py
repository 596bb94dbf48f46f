"""Amplitude against time with every damping law, and the selected law's residuals."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.analyse import Analysis
from pipeline.errors import AnalysisError
from pipeline.numerics.quantity import SHOWN
from springmass.report.figures.canvas import (
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    VERMILLION,
    error_bars,
    finish_residual,
    legend_above,
    moving,
    panels,
    share,
    style,
    value_label,
)
from springmass.report.tables import law_status

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["amplitude_figure", "amplitude_log_figure", "amplitude_panel"]

MOST_NAMED = 4
MANY_WINDOWS = 60  # with more windows, points are smaller, so that the fit is visible between them
EXPONENTIAL = "linear"
"""The law for comparison: linear drag."""
_DASHES = ((0, (5, 2)), (0, (1, 1.5)), (0, (5, 1.5, 1, 1.5)), (0, (3, 1, 1, 1, 1, 1)))


def amplitude_figure(analysis: Analysis) -> Figure:
    """Draw the amplitudes with every law, and below them the selected law's residuals divided by u.

    Parameters
    ----------
    analysis : Analysis
        Analysis of a record that oscillates.
    """
    motion, factor = moving(analysis), SHOWN[analysis.track.unit].factor
    damping, t, amplitude = motion.damping, motion.demodulated.t, motion.demodulated.amplitude * factor
    u, kept = damping.scatter.u * factor, damping.scatter.kept
    end = float(np.nanmax(analysis.track.t))
    with style():
        figure, (above, below) = panels([3.3, 1.4])
        amplitude_panel(above, analysis)
        residual = (amplitude - damping.best.amplitude(t - damping.t0) * factor) / np.where(u > 0, u, 1.0)
        below.plot(t[kept], residual[kept], "o", ms=2.6, mew=0, color=BLUE)
        finish_residual(below, residual[kept], "residual / u")
        # Omitted windows are far off the curve; drawn at the edge of the panel, they do not change its range.
        if not kept.all():
            at_most = np.clip(residual[~kept], *below.get_ylim())
            below.plot(t[~kept], at_most, "o", mfc="none", color=ORANGE, ms=4, clip_on=False, zorder=4)
        below.set_xlabel("time / s")
        share(above, below, damping.t0, end)
        legend_above(above)
        return figure


def amplitude_log_figure(analysis: Analysis) -> Figure:
    """Draw the amplitudes on a logarithmic axis, on which an exponential is a straight line.

    Parameters
    ----------
    analysis : Analysis
        Analysis of a record that oscillates.
    """
    from matplotlib.ticker import LogLocator, NullFormatter

    motion = moving(analysis)
    with style():
        figure, (panel,) = panels([3.2])
        laws = [name for name in dict.fromkeys((motion.damping.selected, EXPONENTIAL)) if name in motion.damping.fits]
        amplitude_panel(panel, analysis, laws)
        low, high = panel.get_ylim()
        least = float(np.min(motion.demodulated.amplitude)) * SHOWN[analysis.track.unit].factor
        panel.set_yscale("log")
        panel.set_ylim(max(low, 0.7 * least, 1e-3 * high), high)
        subs = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0) if high < 30.0 * panel.get_ylim()[0] else (1.0, 2.0, 5.0)
        panel.yaxis.set_major_locator(LogLocator(subs=subs))
        panel.yaxis.set_major_formatter("{x:g}")
        panel.yaxis.set_minor_formatter(NullFormatter())
        panel.set_xlim(motion.damping.t0, float(np.nanmax(analysis.track.t)))
        panel.set_xlabel("time / s")
        legend_above(panel, 2)
        return figure


def _named(law: str) -> str:
    return "exponential, linear drag" if law == EXPONENTIAL else law


def amplitude_panel(panel: Axes, analysis: Analysis, laws: Sequence[str] | None = None) -> None:
    """Draw the amplitudes with laws as curves.

    Parameters
    ----------
    panel : Axes
    analysis : Analysis
        Analysis of a record that oscillates.
    laws : sequence of str, optional
        Names of the laws to draw; default: all fitted laws. By default the legend names the selected law, the
        exponential and the best of the laws that cannot be ruled out.

    Raises
    ------
    AnalysisError
        If a law was not fitted.
    """
    motion, factor = moving(analysis), SHOWN[analysis.track.unit].factor
    damping, t, amplitude = motion.damping, motion.demodulated.t, motion.demodulated.amplitude * factor
    if missing := [name for name in laws or () if name not in damping.fits]:
        raise AnalysisError(f"no law {missing[0]!r} was fitted to this run; there are {', '.join(damping.fits)}")
    u, kept = damping.scatter.u * factor, damping.scatter.kept
    grid = np.linspace(damping.t0, float(np.nanmax(analysis.track.t)), 160)
    size = 3.4 if t.size <= MANY_WINDOWS else 2.0
    error_bars(panel, t[kept], amplitude[kept], u[kept], "amplitude of one window", size=size)
    if not kept.all():
        panel.plot(t[~kept], amplitude[~kept], "o", mfc="none", color=ORANGE, ms=4, label="left out of the fits")
    shown = [float(np.min(amplitude - u)), float(np.max(amplitude + u))]
    matter = list(laws or dict.fromkeys((damping.selected, *damping.admissible)))[: len(laws or ()) or MOST_NAMED]
    if laws is None and EXPONENTIAL in damping.fits and EXPONENTIAL not in matter:
        matter.append(EXPONENTIAL)
    others = [name for name in damping.fits if name not in matter] if laws is None else []
    for i, name in enumerate(others):
        label = (
            None if i else f"{len(others)} other laws" if len(others) > 1 else f"{name} ({law_status(damping, name)})"
        )
        curve = damping.fits[name].amplitude(grid - damping.t0) * factor
        panel.plot(grid, curve, color=GREY, ls=(0, (1, 2)), lw=0.8, label=label, zorder=1.5)
    looks = itertools.cycle(zip((PURPLE, VERMILLION, ORANGE), _DASHES[1:], strict=False))
    for name in sorted(matter, key=lambda name: name != damping.selected):
        chosen = name == damping.selected
        colour, dashes = next(looks) if not chosen and name != EXPONENTIAL else (GREEN, _DASHES[0])
        curve = damping.fits[name].amplitude(grid - damping.t0) * factor
        label = f"{_named(name)} ({law_status(damping, name)})"
        drawn: dict[str, Any] = (
            {"color": "#000000", "lw": 1.5} if chosen else {"color": colour, "ls": dashes, "lw": 1.2}
        )
        # Below the points, because a fit must not hide its data.
        panel.plot(grid, curve, label=label, zorder=1.9 if chosen else 1.7, **drawn)
    margin = 0.12 * max(shown[1] - shown[0], 1e-9 * abs(shown[1])) or 1.0
    panel.set_ylim(shown[0] - margin, shown[1] + margin)
    panel.set_ylabel(value_label("amplitude", analysis.track.unit))
