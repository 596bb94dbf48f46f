"""Velocity against displacement: the phase plot."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pipeline.analyse import Analysis, Oscillation
from pipeline.numerics.quantity import SHOWN, noun
from pipeline.track import F8, UNUSABLE, Quality
from springmass.report.figures.canvas import (
    RASTER_POINTS,
    derivative_label,
    legend_above,
    model_phase,
    moving,
    panels,
    style,
    value_label,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.figure import Figure

__all__ = ["measured_phase", "phase_figure", "phase_panel", "turn_step"]

LEAST_TURNS, MOST_TURNS = 4, 24  # minimum and maximum number of turns in a phase plot


def turn_step(motion: Oscillation) -> int:
    """Return n if the phase plot draws every n-th turn; it draws fewer turns if the amplitude falls less."""
    amplitude = motion.demodulated.amplitude
    wanted = 32.0 * float(np.ptp(amplitude) / np.max(amplitude))
    return max(1, int(np.ceil(motion.cycles.count / min(max(wanted, LEAST_TURNS), MOST_TURNS))))


def phase_figure(analysis: Analysis) -> Figure:
    """Draw the fitted velocity against the fitted displacement, and in grey the values from the samples.

    If there are many turns, evenly spaced ones are drawn; see :func:`turn_step`.

    Parameters
    ----------
    analysis : Analysis
        Analysis of a record that oscillates.
    """
    with style():
        figure, (panel,) = panels([4.6], width=5.6)
        times = phase_panel(panel, analysis)
        legend_above(panel)
        bar = figure.colorbar(times, ax=panel, label="time / s")
        bar.solids.set_rasterized(True)  # type: ignore[union-attr]  # a bar without lines always has them
        return figure


def phase_panel(panel: Axes, analysis: Analysis) -> ScalarMappable:
    """Draw the turns of :func:`phase_figure`; return the colour scale of their times in s, for a colour bar.

    Parameters
    ----------
    panel : Axes
    analysis : Analysis
        Analysis of a record that oscillates.
    """
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import ListedColormap, Normalize

    motion, track = moving(analysis), analysis.track
    unit, factor = track.unit, SHOWN[track.unit].factor
    period = 2.0 * np.pi / motion.phase.angular_frequency.value
    inside = (analysis.flags & Quality.OUTSIDE) == 0
    first, end = motion.damping.t0, float(np.nanmax(track.t[inside]))
    # The pale end of the colour map would be invisible on paper.
    colours = ListedColormap(colormaps["cividis"](np.linspace(0.0, 0.88, 64)))
    scale = Normalize(first, end)
    displacement, velocity, label = measured_phase(analysis, motion)
    turn = np.floor((track.t - first) / period)
    drawn = np.isfinite(velocity) & (turn >= 0) & (np.mod(turn, turn_step(motion)) == 0)
    dots: dict[str, Any] = {
        "ms": 2.8,
        "mew": 0,
        "color": "#a0a0a0",
        "rasterized": bool(np.count_nonzero(drawn) > RASTER_POINTS),
    }
    fastest = 1.3 * float(np.nanmax(np.abs(motion.waveform.velocity)))
    beyond = int(np.count_nonzero(np.abs(velocity[drawn]) > fastest))
    label += f" ({beyond} off the axis)" if beyond else ""
    panel.plot(displacement[drawn] * factor, velocity[drawn], ".", label=label, **dots)
    panel.set_ylim(-fastest, fastest)
    for i, start in enumerate(np.arange(first, end, period * turn_step(motion))):
        t = np.linspace(start, min(start + period, end), 73)
        x, v = model_phase(motion, t)
        panel.plot(x * factor, v, color=colours(scale(start)), lw=1.0, label=None if i else "fitted motion")
    panel.set_xlabel(value_label("displacement" if unit == "m" else f"{noun(unit)} from rest", unit))
    panel.set_ylabel(derivative_label(("velocity", "derivative"), 1, unit))
    return ScalarMappable(scale, colours)


def measured_phase(analysis: Analysis, motion: Oscillation) -> tuple[F8, F8, str]:
    """Return displacement and velocity of used samples, NaN elsewhere, and the source of the velocity in words."""
    track = analysis.track
    used: NDArray[np.bool_] = (analysis.flags & UNUSABLE) == 0
    displacement = np.where(used, track.y - motion.rest.at(track.t), np.nan)
    if track.velocity is not None and np.isfinite(track.velocity).any():
        return displacement, np.where(used, track.velocity, np.nan), "samples, velocity as recorded"
    # Wider differences have less noise; their known attenuation of a sinusoid is corrected.
    omega = motion.phase.angular_frequency.value
    apart = max(1, round(2.0 * np.pi / omega * track.rate_hz / 16.0))
    velocity = np.full(track.t.size, np.nan)
    if track.t.size > 2 * apart:
        step = track.t[2 * apart :] - track.t[: -2 * apart]
        near = used[2 * apart :] & used[: -2 * apart] & (np.abs(step * track.rate_hz - 2 * apart) < 0.5)
        rise = (track.y[2 * apart :] - track.y[: -2 * apart])[near]
        velocity[apart:-apart][near] = rise * omega / (2.0 * np.sin(0.5 * omega * step[near]))
    return displacement, velocity, "samples, velocity from those around"
