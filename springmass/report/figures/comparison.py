"""Spring constants of several runs with their intervals, and what each differs from the mean."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from acquisition.errors import visible
from pipeline.results.compare import Comparison
from springmass.report.figures.canvas import (
    BLUE,
    BOTTOM,
    RIGHT,
    SKY,
    VERMILLION,
    WIDTH,
    blank,
    escaped,
    legend_row,
    style,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["comparison_figure"]

NAME_COLUMN, GAP, ROW, TOP = 2.1, 0.25, 0.34, 0.42  # inches
LONGEST_NAME, SHORTEST_NAME = 30, 8


def comparison_figure(comparison: Comparison) -> Figure:
    """Draw the spring constant of every run with its interval, and beside it the pulls.

    Parameters
    ----------
    comparison : Comparison

    Notes
    -----
    The thin bar is the whole standard uncertainty, the thick one what the run does not share with others. Runs that
    were found exchanged stand out.
    """
    count = len(comparison.names)
    rows = np.arange(count)[::-1].astype(float)
    k = np.array([each.value for each in comparison.each])
    u = np.array([each.u for each in comparison.each])
    mean = comparison.spring_constant
    colours = [VERMILLION if name in comparison.exchanged else BLUE for name in comparison.names]
    tall = ROW * (count + 0.6)
    width, height = (WIDTH - NAME_COLUMN - GAP - RIGHT) / WIDTH, BOTTOM + tall + TOP
    with style():
        figure = blank(WIDTH, height)
        left = figure.add_axes((NAME_COLUMN / WIDTH, BOTTOM / height, 0.6 * width, tall / height))
        start = NAME_COLUMN / WIDTH + 0.6 * width + GAP / WIDTH
        right = figure.add_axes((start, BOTTOM / height, 0.4 * width, tall / height))
        if comparison.agree:  # of constants that disagree there is no mean to draw
            left.axvspan(mean.value - mean.u, mean.value + mean.u, color=SKY, alpha=0.45, lw=0, label="mean ± u")
            left.axvline(mean.value, color="#000000", lw=0.8)
        left.hlines(rows, k - u, k + u, colors=colours, lw=0.9, label="u of the run")
        left.hlines(rows, k - comparison.own_u, k + comparison.own_u, colors=colours, lw=3.2, label="not shared")
        left.scatter(k, rows, s=22, c=colours, zorder=3)
        for most in range(LONGEST_NAME, SHORTEST_NAME, -2):
            left.set_yticks(rows, [_short(name, most) for name in comparison.names])
            if min(label.get_window_extent().x0 for label in left.get_yticklabels()) > 0:
                break
        left.set_xlabel("spring constant / (N/m)")
        left.ticklabel_format(axis="x", useOffset=False)
        left.locator_params(axis="x", nbins=5)
        legend_row(left, 3, handlelength=1.5)
        pulls = np.array(comparison.pulls)
        right.axvline(0.0, color="#000000", lw=0.8)
        right.hlines(rows, 0.0, pulls, colors=colours, lw=1.2)
        right.scatter(pulls, rows, s=22, c=colours, zorder=3)
        right.set_yticks(rows, [""] * count)
        reach = max(3.5, 1.15 * float(np.max(np.abs(pulls))))
        right.set_xlim(-reach, reach)
        right.set_xlabel("residual / u")
        for panel in (left, right):
            panel.set_ylim(-0.8, count - 0.2)
        return figure


def _short(name: str, most: int) -> str:
    name = visible(name)
    # Names of one experiment differ at their ends as often as at their beginnings: keep both.
    half = most // 2
    shown = name if len(name) <= most else f"{name[: half - 1]}…{name[-half:]}"
    return escaped(shown)
