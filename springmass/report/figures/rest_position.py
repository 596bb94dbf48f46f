"""A moving rest position, window by window; a tenth of a millimetre is invisible in the plot of the position."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pipeline.analyse import Analysis, Oscillation
from pipeline.numerics.quantity import SHOWN
from springmass.report.figures.canvas import error_bars, value_label

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["draw_rest", "rest_moves"]


def rest_moves(analysis: Analysis) -> bool:
    """Return whether the rest position drifts, and therefore has its own panel."""
    return isinstance(analysis.motion, Oscillation) and analysis.motion.rest.drifts


def draw_rest(panel: Axes, motion: Oscillation, unit: str, start: float, end: float) -> None:
    """Draw the windows' rest positions minus their mean, with u, and the curve that was fitted to them.

    Parameters
    ----------
    panel : Axes
    motion : Oscillation
    unit : str
        Unit of the record's values.
    start, end : float, s
    """
    factor, rest, windows = SHOWN[unit].factor, motion.rest, motion.demodulated
    mean = rest.mean.value
    own = windows.offset - mean
    error_bars(panel, windows.t, own * factor, np.sqrt(windows.covariance[:, 2, 2]) * factor, None, size=2.6)
    grid = np.linspace(start, end, 800)
    panel.plot(grid, (rest.at(grid) - mean) * factor, color="#000000", lw=0.9)
    panel.margins(y=0.15)
    panel.set_xlim(start, end)
    panel.set_ylabel(value_label("rest", unit))
