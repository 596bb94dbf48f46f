"""Spring constants of several runs with their intervals, and the deviation of each from the mean."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from acquisition.errors import visible
from pipeline.results.compare import Comparison
from springmass.report.figures.canvas import (
    BLUE,
    SKY,
    VERMILLION,
    escaped,
    panels,
    style,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["comparison_figure"]

ROW, AROUND = 0.34, 1.1
"""Heights of a run's row, and of everything above and below the rows, inches."""
LONGEST_NAME = 30
"""Maximum length of a name in characters, about a third of the figure's width."""


def comparison_figure(comparison: Comparison) -> Figure:
    """Draw the spring constant of every run with its interval, and beside it the pull of every run.

    Parameters
    ----------
    comparison : Comparison

    Notes
    -----
    The thin bar is the whole standard uncertainty; the thick bar is the part that the run does not share with others.
    Runs that seem to have been exchanged have a different colour.
    """
    count = len(comparison.names)
    rows = np.arange(count)[::-1].astype(float)
    k = np.array([each.value for each in comparison.each])
    u = np.array([each.u for each in comparison.each])
    mean = comparison.spring_constant
    colours = [VERMILLION if name in comparison.exchanged else BLUE for name in comparison.names]
    with style():
        figure, (left, right) = panels([ROW * count + AROUND], columns=2)
        if comparison.agree:  # constants that disagree have no meaningful mean
            left.axvspan(mean.value - mean.u, mean.value + mean.u, color=SKY, alpha=0.45, lw=0, label="mean ± u")
            left.axvline(mean.value, color="#000000", lw=0.8)
        left.hlines(rows, k - u, k + u, colors=colours, lw=0.9, label="u of the run")
        left.hlines(rows, k - comparison.own_u, k + comparison.own_u, colors=colours, lw=3.2, label="not shared")
        left.scatter(k, rows, s=22, c=colours, zorder=3)
        left.set_yticks(rows, [_short(name) for name in comparison.names])
        left.set_xlabel("spring constant / (N/m)")
        left.ticklabel_format(axis="x", useOffset=False)
        left.locator_params(axis="x", nbins=5)
        pulls = np.array(comparison.pulls)
        right.axvline(0.0, color="#000000", lw=0.8)
        right.hlines(rows, 0.0, pulls, colors=colours, lw=1.2)
        right.scatter(pulls, rows, s=22, c=colours, zorder=3)
        right.set_yticks(rows, [""] * count)
        reach = max(3.5, 1.15 * float(np.max(np.abs(pulls))))
        right.set_xlim(-reach, reach)
        right.set_xlabel("residual / u")
        figure.legend(loc="outside upper left", ncols=3)
        for panel in (left, right):
            panel.set_ylim(-0.8, count - 0.2)
        return figure


def _short(name: str) -> str:
    name = visible(name)
    # Names of one experiment differ at their ends as often as at their beginnings: keep both.
    half = LONGEST_NAME // 2
    shown = name if len(name) <= LONGEST_NAME else f"{name[: half - 1]}…{name[-half:]}"
    return escaped(shown)
