"""Position against time with the fit, and its residuals."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.analyse import Analysis, Oscillation, Overdamped
from pipeline.numerics.quantity import SHOWN, noun
from pipeline.track import F8, UNUSABLE, Quality
from springmass.report.figures.canvas import (
    BLUE,
    DENSE_POINTS,
    GREEN,
    ORANGE,
    PURPLE,
    RASTER_POINTS,
    SKY,
    VERMILLION,
    escaped,
    finish_residual,
    legend_above,
    model_phase,
    panels,
    share,
    style,
    thinned,
    value_label,
)
from springmass.report.figures.rest_position import draw_rest, rest_moves
from springmass.report.recorded import Note

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["ZOOM_PERIODS", "has_error_bars", "is_long", "position_figure", "position_panel"]

# Flag bits of a sample, the most serious first, with name, marker and colour.
_FLAGGED: tuple[tuple[int, str, str, str], ...] = (
    (int(Quality.CLIPPED), "clipped", "s", ORANGE),
    (int(Quality.FALSE_ECHO), "false echo", "x", VERMILLION),
    (int(Quality.OUTSIDE), "outside the analysed part", ".", "0.6"),
    (int(UNUSABLE), "otherwise unusable", "+", GREEN),
)
ZOOM_PERIODS = 8
LONG_PERIODS = 14  # with more periods, a detail is drawn in addition to the whole
DENSE_PERIODS = 40  # with more periods, the motion looks like a band
MOST_WORDS = 12  # maximum number of marks with room for their words
VISIBLE_NOISE = 0.005  # of the panel's height; smaller error bars are hidden by the points


def is_long(analysis: Analysis) -> bool:
    """Return whether a detail of the first periods is drawn in addition to the whole position."""
    return isinstance(analysis.motion, Oscillation) and analysis.motion.cycles.count > LONG_PERIODS


def has_error_bars(analysis: Analysis) -> bool:
    """Return whether the samples' error bars are large enough to be visible and are therefore drawn."""
    y = analysis.track.y[(analysis.flags & UNUSABLE) == 0]
    return isinstance(analysis.motion, Oscillation) and bool(analysis.conditioned.noise_m > VISIBLE_NOISE * np.ptp(y))


def position_figure(analysis: Analysis, notes: Sequence[Note] = ()) -> Figure:
    """Draw the distance with its fit, and below it the residuals divided by the noise of one sample.

    Flagged samples have other markers; those outside the axis range are drawn at its edge. A long record is followed by
    a detail of its first periods, and a moving rest position by a panel at the end. If nothing oscillates, only the
    distance is drawn.

    Parameters
    ----------
    analysis : Analysis
    notes : sequence of Note
        Marks and events of the recording; marks, the trigger and losses are drawn.
    """
    track, motion = analysis.track, analysis.motion
    start, end = float(np.nanmin(track.t)), float(np.nanmax(track.t))
    with style():
        if not isinstance(motion, Oscillation):
            figure, (only,) = panels([3.2])
            position_panel(only, analysis, start, end)
            _draw_notes(only, notes)
            legend_above(only)
            only.set_xlabel("time / s")
            return figure
        long = is_long(analysis)
        heights = [2.2, 1.1, 2.2, 1.2] if long else [2.9, 1.4]
        figure, axes = panels([*heights, 1.4] if rest_moves(analysis) else heights)
        _draw_pair(axes[:2], analysis, motion, start, end)
        _draw_notes(axes[0], notes)
        legend_above(axes[0])
        if long:
            first = float(track.t[analysis.conditioned.used][0])
            last = first + ZOOM_PERIODS / motion.cycles.frequency_hz
            _draw_pair(axes[2:4], analysis, motion, first, last)
            for panel in axes[:2]:
                panel.axvspan(first, last, color="#000000", alpha=0.07, lw=0)
            axes[2].set_title(f"the first {ZOOM_PERIODS} periods")
        if rest_moves(analysis):
            draw_rest(axes[-1], motion, track.unit, start, end)
        axes[-1].set_xlabel("time / s")
        return figure


def position_panel(panel: Axes, analysis: Analysis, start: float, end: float) -> None:
    """Draw the distance between two times, with its fit if there is one.

    Parameters
    ----------
    panel : Axes
    analysis : Analysis
    start, end : float, s
    """
    motion, factor = analysis.motion, SHOWN[analysis.track.unit].factor
    _draw_distance(panel, analysis, start, end)
    if isinstance(motion, Overdamped):
        t, y = _relaxing(analysis, motion)
        panel.plot(t, y * factor, color="#000000", lw=0.9, label="fit", zorder=2.5)
    if not isinstance(motion, Oscillation):
        return
    law, rest = motion.damping.best, motion.rest
    if (end - start) * motion.cycles.frequency_hz > DENSE_PERIODS:
        grid = np.linspace(start, end, 400)
        reach = law.amplitude(grid - motion.damping.t0)
        for sign, label in ((1, "fit: rest ± amplitude"), (-1, None)):
            panel.plot(grid, (rest.at(grid) + sign * reach) * factor, color="#000000", lw=1.0, label=label, zorder=1.8)
    else:
        grid = np.linspace(start, end, int(50 * (end - start) * motion.cycles.frequency_hz) + 2)
        position = rest.at(grid) + model_phase(motion, grid)[0]
        # Below the samples, because a fit must not hide its data.
        panel.plot(grid, position * factor, color="#000000", lw=1.4, alpha=0.8, label="fit", zorder=1.8)


def _relaxing(analysis: Analysis, motion: Overdamped) -> tuple[F8, F8]:
    """Return times and distances of the relaxation: a linear fit of amplitudes and rest at the fitted rates."""
    track, x = analysis.track, motion.estimates
    used = ((analysis.flags & UNUSABLE) == 0) & (track.t >= motion.start_s)

    def columns(t: F8) -> F8:
        since = t - motion.start_s
        if motion.kind == "strong":
            turn = x["angular_frequency"].value * since
            pair = np.exp(-x["damping_rate"].value * since) * np.array([np.cos(turn), np.sin(turn)])
        elif motion.kind == "critical":
            pair = np.exp(-x["relaxation_rate"].value * since) * np.array([np.ones_like(since), since])
        else:
            pair = np.array([np.exp(-x[f"relaxation_rate_{name}"].value * since) for name in ("slow", "fast")])
        return np.column_stack([np.ones_like(since), *pair])

    weights, *_ = np.linalg.lstsq(columns(track.t[used]), track.y[used], rcond=None)
    grid = np.linspace(motion.start_s, float(np.nanmax(track.t)), 600)
    return grid, np.asarray(columns(grid) @ weights)


def _draw_pair(axes: Sequence[Axes], analysis: Analysis, motion: Oscillation, start: float, end: float) -> None:
    """Draw distance and fit above, and below them residuals divided by noise, between two times."""
    above, below = axes
    t = analysis.track.t
    position_panel(above, analysis, start, end)
    noise = analysis.estimates["noise"].value or 1.0
    inside = ((analysis.flags & UNUSABLE) == 0) & (t >= start) & (t <= end)
    residual = motion.waveform.residual[inside] / noise
    # Thousands of points are drawn as pixels, which take a third of the bytes of round points.
    look: dict[str, Any] = {"marker": ",", "alpha": 0.7} if residual.size > DENSE_POINTS else {"marker": ".", "ms": 2.6}
    dense = residual.size > RASTER_POINTS
    below.plot(t[inside], residual, ls="", mew=0, color=BLUE, rasterized=dense, **look)
    finish_residual(below, residual, "residual / σ")
    share(above, below, start, end)


def _draw_notes(panel: Axes, notes: Sequence[Note]) -> None:
    """Draw a line at every mark, at the trigger and at losses; if there are few marks, draw their words too."""
    marks = [note for note in notes if note.kind == "mark"]
    for kind, colour in (("mark", PURPLE), ("trigger", GREEN), ("lost", VERMILLION), ("reopened", VERMILLION)):
        times = [note.t_s for note in notes if note.kind == kind]
        for i, t_s in enumerate(times):
            label = None if i else kind if len(times) == 1 else f"{kind} ({len(times)})"
            panel.axvline(t_s, color=colour, lw=0.9, ls=(0, (4, 2)), label=label, zorder=4)
    if len(marks) <= MOST_WORDS:
        for mark in marks:
            words = mark.text if len(mark.text) <= 24 else f"{mark.text[:22]}…"
            look: dict[str, Any] = {"fontsize": 7.0, "va": "top", "ha": "right", "clip_on": True, "zorder": 5}
            at = (mark.t_s, 0.97)
            text = panel.text(*at, escaped(words), rotation=90, transform=panel.get_xaxis_transform(), **look)
            text.set_bbox({"facecolor": "#ffffff", "alpha": 0.7, "linewidth": 0, "pad": 0.5})


def _draw_distance(panel: Axes, analysis: Analysis, start: float, end: float) -> None:
    """Draw the samples between two times, with other markers on top for the flagged ones."""
    track, flags = analysis.track, analysis.flags
    inside = (track.t >= start) & (track.t <= end)
    factor = SHOWN[track.unit].factor
    y = track.y * factor
    used = inside & ((flags & UNUSABLE) == 0) & np.isfinite(y)
    if np.count_nonzero(used) > DENSE_POINTS:
        ends = thinned(y[used], 900)
        panel.plot(track.t[used][ends], y[used][ends], color=SKY, lw=0.5, label="samples used")
    else:
        dense = np.count_nonzero(used) > RASTER_POINTS
        panel.plot(track.t[used], y[used], ".", ms=3.4, mew=0, color=SKY, label="samples used", rasterized=dense)
        if has_error_bars(analysis):
            u = analysis.conditioned.noise_m * factor
            panel.vlines(track.t[used], y[used] - u, y[used] + u, color=SKY, lw=0.6, alpha=0.6)
    # Clipped crests are part of the motion, so the axis includes the fit as well as the samples.
    fit = analysis.motion.waveform.position[inside] * factor if isinstance(analysis.motion, Oscillation) else y[used]
    shown = np.concatenate([y[used], fit[np.isfinite(fit)]])
    low, high = (float(np.min(shown)), float(np.max(shown))) if shown.size else (0.0, 1.0)
    margin = 0.1 * (max(high - low, 6.0 * factor * analysis.conditioned.noise_m) or 1.0)
    low, high = low - margin, high + margin
    rest = inside & ~used
    for bit, name, marker, colour in _FLAGGED:
        chosen = rest & np.isfinite(y) & ((flags & np.uint8(bit)) != 0)
        rest &= ~chosen
        if chosen.any():
            beyond = int(np.count_nonzero((y[chosen] < low) | (y[chosen] > high)))
            label = f"{name} ({np.count_nonzero(chosen)}" + (f"; {beyond} off the axis)" if beyond else ")")
            _mark(panel, track.t[chosen], np.clip(y[chosen], low, high), marker, colour, label)
    missing = rest & ~np.isfinite(y)
    if missing.any():
        count = int(np.count_nonzero(missing))
        _mark(panel, track.t[missing], np.full(count, low), "|", PURPLE, f"missing ({count})")
    panel.set_ylim(low, high)
    panel.set_xlim(start, end)
    panel.set_ylabel(value_label("position" if track.unit == "m" else noun(track.unit), track.unit))


def _mark(panel: Axes, t: F8, y: F8, marker: str, colour: str, label: str) -> None:
    """Draw markers on top of everything, and uncut at the edge."""
    dense = t.size > RASTER_POINTS
    look: dict[str, Any] = {
        "rasterized": dense,
        "ms": 7 if marker == "|" else 3.2,
        "mew": 0.8,
        "color": colour,
        "ls": "",
    }
    panel.plot(t, y, marker, mfc="none", label=label, clip_on=False, zorder=4, **look)
