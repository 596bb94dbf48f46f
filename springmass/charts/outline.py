"""The outline of a recording as a small picture for a table of many runs."""

from __future__ import annotations

import numpy as np

from pipeline.analyse import Analysis

BINS, FEWEST_BINS = 60, 8


def outline(analysis: Analysis) -> str:
    """Return an outline of the recording as an SVG path in a box of 120 by 30; empty if nothing was measured."""
    t, y = analysis.track.t, analysis.track.y
    there = np.isfinite(t) & np.isfinite(y)
    order = np.argsort(t[there], kind="stable")
    t, y = t[there][order], y[there][order]
    if t.size < 2 or not np.ptp(t) > 0:
        return ""
    span = t[-1] - t[0]
    # A bin shorter than a period would not show the outline.
    count = (
        int(np.clip(span / period.value, FEWEST_BINS, BINS)) if (period := analysis.estimates.get("period")) else BINS
    )
    ends = np.searchsorted(t, t[0] + span * np.arange(count + 1) / count)
    filled = np.flatnonzero(np.diff(ends))
    low, high = (edge.reduceat(y, ends[filled]) for edge in (np.minimum, np.maximum))
    beyond = y.size // 200  # the extreme 0.5 % are ignored, so that false echoes do not flatten the outline
    bottom, top = np.partition(y, (beyond, -1 - beyond))[[beyond, -1 - beyond]]
    scale = 28.0 / max(top - bottom, 1e-300)
    above, below = (np.clip(29.0 - (edge - bottom) * scale, 0.0, 30.0).round() for edge in (high, low))
    x = ((filled + 0.5) * 120.0 / count).round(1).tolist()
    edge = [*zip(x, above.tolist(), strict=True), *reversed([*zip(x, below.tolist(), strict=True)])]
    return "M" + "L".join(f"{a:g} {b:g}" for a, b in edge) + "Z"
