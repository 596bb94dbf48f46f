"""Amplitude against time with every damping law, and the selected law's residuals."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

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

__all__ = ["amplitude_figure", "amplitude_panel"]

MOST_NAMED = 4
_DASHES = ((0, (5, 2)), (0, (1, 1.5)), (0, (5, 1.5, 1, 1.5)), (0, (3, 1, 1, 1, 1, 1)))


def amplitude_figure(analysis: Analysis) -> Figure:
    """Draw the amplitudes with every law, and beneath them the selected law's residuals over their u.

    Parameters
    ----------
    analysis : Analysis
        Of a record that oscillates.
    """
    motion, factor = moving(analysis), SHOWN[analysis.track.unit].factor
    damping, t, amplitude = motion.damping, motion.demodulated.t, motion.demodulated.amplitude * factor
    u, kept = damping.scatter.u * factor, damping.scatter.kept
    end = float(np.nanmax(analysis.track.t))
    with style():
        figure, (above, below) = panels([(2.7, 0.0), (1.0, 0.08)])
        amplitude_panel(above, analysis)
        residual = (amplitude - damping.best.amplitude(t - damping.t0) * factor) / np.where(u > 0, u, 1.0)
        below.plot(t[kept], residual[kept], "o", ms=2.6, mew=0, color=BLUE)
        finish_residual(below, residual[kept], "residual / u")
        # What was left out lies far off; at the edge it is seen and flattens nothing.
        at_most = np.clip(residual[~kept], *below.get_ylim())
        below.plot(t[~kept], at_most, "o", mfc="none", color=ORANGE, ms=4, clip_on=False, zorder=4)
        below.set_xlabel("time / s")
        share(above, below, damping.t0, end)
        legend_above(above, handle=2.8)
        return figure


def amplitude_panel(panel: Axes, analysis: Analysis, laws: Sequence[str] | None = None) -> None:
    """Draw the amplitudes with laws as curves.

    Parameters
    ----------
    panel : Axes
    analysis : Analysis
        Of a record that oscillates.
    laws : sequence of str, optional
        Names of the laws to draw; left out, all that were fitted, those named that matter: the selected one and the
        best of what the record takes for as good.

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
    error_bars(panel, t[kept], amplitude[kept], u[kept], "amplitude of one window")
    if not kept.all():
        panel.plot(t[~kept], amplitude[~kept], "o", mfc="none", color=ORANGE, ms=4, label="left out of the fits")
    shown = [float(np.min(amplitude - u)), float(np.max(amplitude + u))]
    matter = laws or list(dict.fromkeys((damping.selected, *damping.admissible)))[:MOST_NAMED]
    others = [name for name in damping.fits if name not in matter] if laws is None else []
    for i, name in enumerate(others):
        label = (
            None if i else f"{len(others)} other laws" if len(others) > 1 else f"{name} ({law_status(damping, name)})"
        )
        curve = damping.fits[name].amplitude(grid - damping.t0) * factor
        panel.plot(grid, curve, color=GREY, ls="--", lw=0.7, label=label, zorder=2.5)
    for i, name in enumerate(sorted(matter, key=lambda name: name == damping.selected)):
        chosen = name == damping.selected
        colour = "#000000" if chosen else (GREEN, PURPLE, VERMILLION, ORANGE)[i % 4]
        dashes = "-" if chosen else _DASHES[i % len(_DASHES)]
        curve = damping.fits[name].amplitude(grid - damping.t0) * factor
        panel.plot(
            grid, curve, color=colour, ls=dashes, lw=1.0, label=f"{name} ({law_status(damping, name)})", zorder=3
        )
    margin = 0.12 * max(shown[1] - shown[0], 1e-9 * abs(shown[1])) or 1.0
    panel.set_ylim(shown[0] - margin, shown[1] + margin)
    panel.set_ylabel(value_label("amplitude", analysis.track.unit))
