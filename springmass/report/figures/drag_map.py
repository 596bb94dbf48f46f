"""Drag coefficients of many runs against Reynolds and Keulegan-Carpenter number, beside lines from the literature."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pipeline.bench.derived_drag import STEADY_DISC_DRAG, disc_drag_coefficient
from pipeline.track import F8
from springmass.report.figures.canvas import (
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    RASTER_POINTS,
    SKY,
    VERMILLION,
    WIDTH,
    escaped,
    panels,
    style,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["DragRun", "drag_map_figure", "drag_of_disc_at_rest", "drag_of_plate"]

COLOURS = ((BLUE, "-"), (VERMILLION, "--"), (GREEN, "-."), (PURPLE, ":"), (ORANGE, "-"), (SKY, "--"))
HEIGHT = 3.6
"""Height of a row of panels, inches."""
NARROW = 5.0
"""Width in inches below which the panels are placed one above the other."""


@dataclass(frozen=True, slots=True, eq=False)
class DragRun:
    """One run's drag coefficient at several of its amplitudes.

    Parameters
    ----------
    disc : str
        Label of the disc.
    points : (n, 4) float64
        Columns: Re, KC, drag coefficient and its standard uncertainty.
    """

    disc: str
    points: F8


def drag_of_disc_at_rest(reynolds: F8) -> F8:
    """Return the drag coefficient of a disc perpendicular to a steady stream, at Reynolds numbers (n,).

    Notes
    -----
    :math:`64/(\\pi Re)` for creeping flow [1]_, up to the intersection with the constant 1.17 for high Reynolds numbers
    [2]_. These are the two limits; the transition between them is not modelled.

    References
    ----------
    .. [1] A. Oberbeck, J. reine angew. Math. 81 (1876) 62; H. Lamb, Hydrodynamics, art. 339.
    .. [2] S. F. Hoerner, Fluid-Dynamic Drag, 1965, section III.
    """
    return np.maximum(64.0 / (np.pi * reynolds), STEADY_DISC_DRAG)


def drag_of_plate(keulegan_carpenter: F8) -> F8:
    """Return the drag coefficient of a long flat plate that oscillates broadside on, at KC numbers (n,).

    Notes
    -----
    :math:`\\max(10\\,KC^{-1/3}, 1.95)`, fitted [1]_ to measured coefficients [2]_ [3]_.

    References
    ----------
    .. [1] M. Luhar, H. M. Nepf, J. Fluids Struct. 61 (2016) 20, arXiv:1510.01237.
    .. [2] G. H. Keulegan, L. H. Carpenter, J. Res. Natl. Bur. Stand. 60 (1958) 423.
    .. [3] T. Sarpkaya, J. L. O'Keefe, J. Offshore Mech. Arct. Eng. 118 (1996) 64.
    """
    return np.maximum(10.0 * keulegan_carpenter ** (-1.0 / 3.0), 1.95)


def drag_map_figure(runs: Sequence[DragRun], *, width: float = WIDTH) -> Figure:
    """Draw the map: one line per run with a band of one standard uncertainty, one colour and line style per disc.

    Parameters
    ----------
    runs : sequence of DragRun
        At least one run.
    width : float
        Width in inches; in a narrow figure, the panels are placed one above the other.

    Raises
    ------
    ValueError
        If no run has a positive drag coefficient.
    """
    if not any((run.points[:, 2] > 0).any() for run in runs):
        raise ValueError("a map of drag needs a run with a positive drag coefficient")
    discs = list(dict.fromkeys(run.disc for run in runs))
    with style():
        side = width >= NARROW
        figure, axes = panels([HEIGHT] if side else [HEIGHT, HEIGHT], width=width, columns=2 if side else 1)
        for column, panel in enumerate(axes):
            _draw(panel, runs, discs, column)
            panel.set_ylabel("effective drag coefficient" if column == 0 or not side else "")
            panel.set_xlabel(("Reynolds number", "Keulegan-Carpenter number")[column])
        low, top = np.log([np.min([p.get_ylim()[0] for p in axes]), np.max([p.get_ylim()[1] for p in axes])])
        for panel in axes:
            panel.set_ylim(math.exp(low), math.exp(top))
        handles = {label: h for p in axes for h, label in zip(*p.get_legend_handles_labels(), strict=True)}
        figure.legend(handles.values(), handles.keys(), loc="outside upper left", ncols=2 if side else 1)
        return figure


def _draw(panel: Axes, runs: Sequence[DragRun], discs: Sequence[str], column: int) -> None:
    from matplotlib.ticker import LogLocator, NullFormatter

    panel.set_xscale("log")
    panel.set_yscale("log")
    flat = len(runs) * 8 > 8 * RASTER_POINTS  # rasterize more than RASTER_POINTS runs
    seen: set[str] = set()
    ends, heights = [], []
    for run in runs:
        points = run.points[run.points[:, 2] > 0]
        if not len(points):
            continue
        colour, dashes = COLOURS[discs.index(run.disc) % len(COLOURS)]
        x, c, u = points[:, column], points[:, 2], points[:, 3]
        label = None if run.disc in seen else f"disc {escaped(run.disc)}" if run.disc else "runs"
        seen.add(run.disc)
        panel.fill_between(x, np.maximum(c - u, 1e-3 * c), c + u, color=colour, alpha=0.12, lw=0, rasterized=flat)
        panel.plot(x, c, color=colour, ls=dashes, lw=0.8, alpha=0.8, label=label, rasterized=flat)
        ends += [x.min(), x.max()]
        heights += [c.min(), c.max()]
    low, high = 0.8 * min(ends), 1.25 * max(ends)
    grid = np.geomspace(low, high, 200)
    if column == 0:
        line, words = drag_of_disc_at_rest(grid), "disc, steady stream (limits)"
    else:
        line, words = drag_of_plate(grid), "oscillating flat plate, Luhar and Nepf 2016"
        assumed = np.array([disc_drag_coefficient(x) for x in grid.tolist()])
        panel.plot(grid, assumed, color=GREY, lw=1.1, ls=(0, (1, 1)), label="oscillating disc, as simulate assumes")
    panel.plot(grid, line, color="#000000" if column else GREY, lw=1.1, ls=(0, (5, 2)), label=words)
    panel.set_xlim(low, high)
    panel.set_ylim(
        0.7 * min(*np.quantile(heights, (0.01,)), line.min()),
        1.4 * max(*np.quantile(heights, (0.99,)), STEADY_DISC_DRAG),
    )
    for axis in (panel.xaxis, panel.yaxis):
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_major_formatter("{x:g}")
        axis.set_minor_formatter(NullFormatter())
