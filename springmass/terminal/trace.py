"""Draw the last seconds of a motion in a few lines of braille, with two by four dots per character."""

from __future__ import annotations

import numpy as np

from pipeline.track import F8

__all__ = ["ROWS", "trace_of"]

ROWS = 4
LABEL = 10
_DOTS = np.array([[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]])  # dot bits, added to U+2800


def trace_of(t: F8, y: F8, columns: int, seconds: float) -> list[str]:
    """Return ROWS lines that show the last seconds, with the limits of the distance scale at the right.

    Parameters
    ----------
    t, y : (n,) float64
        Times in s and distances in m. An unmeasured distance is NaN and leaves a gap.
    columns : int
        Width of the lines including their labels.
    seconds : float
        Duration to show, s.

    Notes
    -----
    The scale covers the middle 96 % of the distances, so a false echo does not flatten the motion but is drawn at the
    edge. Samples are dots without lines between them.
    """
    wide = columns - LABEL
    known = np.isfinite(y) & (t > t[-1] - seconds) if t.size else np.zeros(0, bool)
    if wide < 1 or not known.any():
        return [""] * ROWS
    low, high = np.quantile(y[known], (0.02, 0.98))
    low, high = (low - 5e-4, high + 5e-4) if high - low < 1e-3 else (low, high)
    across = np.clip(((t[known] - t[-1]) / seconds + 1.0) * 2 * wide, 0, 2 * wide - 1).astype(int)
    down = np.clip((high - y[known]) / (high - low) * (4 * ROWS - 1), 0, 4 * ROWS - 1).round().astype(int)
    cells = np.zeros((ROWS, wide), int)
    np.bitwise_or.at(cells, (down // 4, across // 2), _DOTS[down % 4, across % 2])
    labels = [f" {high * 1e3:.1f} mm", *[""] * (ROWS - 2), f" {low * 1e3:.1f} mm"]
    return ["".join(chr(0x2800 + cell) for cell in row) + label for row, label in zip(cells, labels, strict=True)]
