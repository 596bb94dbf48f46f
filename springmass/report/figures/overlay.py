"""The positions of several runs in one plot."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.analyse import Analysis, Oscillation
from pipeline.numerics.quantity import SHOWN, noun
from pipeline.track import UNUSABLE
from springmass.report.figures.canvas import (
    BLUE,
    GREEN,
    ORANGE,
    PURPLE,
    SKY,
    VERMILLION,
    escaped,
    legend_above,
    panels,
    style,
    thinned,
    value_label,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["overlay_figure"]

COLOURS = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY)
LONGEST_NAME = 28
PERIODS = 8
BINS = 700


def overlay_figure(names: Sequence[str], analyses: Sequence[Analysis]) -> Figure | None:
    """Draw the displacement of every run against the time since its first used sample, and the first periods below.

    Return None if the runs have different units.

    Parameters
    ----------
    names : sequence of str
    analyses : sequence of Analysis
    """
    unit = analyses[0].track.unit
    if any(analysis.track.unit != unit for analysis in analyses):
        return None
    factor = SHOWN[unit].factor
    with style():
        figure, (whole, detail) = panels([2.2, 2.0])
        shortest = np.inf
        for i, (name, analysis) in enumerate(zip(names, analyses, strict=True)):
            track, motion = analysis.track, analysis.motion
            used = ((analysis.flags & UNUSABLE) == 0) & np.isfinite(track.y)
            if not used.any():
                continue
            t = track.t[used] - track.t[used][0]
            rest = motion.rest.at(track.t[used]) if isinstance(motion, Oscillation) else np.mean(track.y[used])
            y = (track.y[used] - rest) * factor
            if isinstance(motion, Oscillation):
                shortest = min(shortest, PERIODS / motion.cycles.frequency_hz)
            look: dict[str, Any] = {
                "color": COLOURS[i % len(COLOURS)],
                "ls": ("-", (0, (4, 1.5)))[i // len(COLOURS) % 2],
            }
            label = name if len(name) <= LONGEST_NAME else f"{name[:12]}…{name[-12:]}"
            keep = thinned(y, BINS)
            whole.plot(t[keep], y[keep], lw=0.5, alpha=0.75, label=escaped(label), **look)
            detail.plot(t, y, lw=0.9, **look)
        longest = max(float(analysis.track.t[-1] - analysis.track.t[0]) for analysis in analyses)
        whole.set_xlim(0.0, longest)
        detail.set_xlim(0.0, min(shortest, longest))
        detail.set_xlabel("time since the first sample used / s")
        for panel in (whole, detail):
            panel.set_ylabel(value_label("displacement" if unit == "m" else f"{noun(unit)} from rest", unit))
        legend_above(whole)
        return figure
