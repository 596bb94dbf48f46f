"""The grid of a panel, lines across it at the numbers of its axes: all of them one path.

matplotlib's grid and marks are artists of their own, three a number: drawing them took a fifth of a report's time.
"""

from __future__ import annotations

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backend_bases import RendererBase
from matplotlib.path import Path
from matplotlib.transforms import IdentityTransform

__all__ = ["draw_grid"]


def draw_grid(panel: Axes, *, colour: str, width: float) -> None:
    """Draw lines at a panel's major numbers below all else, wherever those are when it is drawn."""
    panel.add_artist(_Grid(colour, width))


class _Grid(Artist):
    """The lines, laid anew at each drawing: where an axis has its numbers shows only then."""

    zorder = 0.4

    def __init__(self, colour: str, width: float) -> None:
        super().__init__()
        self._colour, self._width = colour, width
        self.set_in_layout(False)

    def draw(self, renderer: RendererBase) -> None:
        """Draw the lines."""
        panel = self.axes
        assert isinstance(panel, Axes)
        low, high = panel.bbox.get_points()
        lines = []
        for own, axis in enumerate((panel.xaxis, panel.yaxis)):
            numbers = np.asarray(axis.get_majorticklocs(), float)
            at = panel.transData.transform(np.column_stack([numbers, numbers]))[:, own]
            ends = np.tile((low, high), (at.size, 1, 1))
            ends[:, :, own] = at[:, np.newaxis]
            lines.append(ends[(at > low[own]) & (at < high[own])])
        vertices = np.concatenate(lines).reshape(-1, 2)
        gc = renderer.new_gc()
        gc.set_foreground(self._colour)
        gc.set_linewidth(self._width * float(panel.figure.dpi) / 72.0)
        gc.set_snap(True)
        codes = np.tile([Path.MOVETO, Path.LINETO], len(vertices) // 2)
        renderer.draw_path(gc, Path(vertices, codes), IdentityTransform())
        gc.restore()
