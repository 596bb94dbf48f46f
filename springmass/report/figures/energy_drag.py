"""Energy against time and drag coefficient against amplitude, each with its uncertainty band."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from pipeline.analyse import Analysis, Oscillation
from pipeline.errors import AnalysisError
from pipeline.numerics.quantity import SHOWN
from pipeline.results.curves import Curve
from pipeline.results.kinematics import Smoothed
from pipeline.track import F8
from springmass.report.figures.canvas import (
    BLUE,
    GREEN,
    SKY,
    VERMILLION,
    error_bars,
    legend_above,
    moving,
    panels,
    share,
    style,
    value_label,
)
from springmass.report.figures.position import ZOOM_PERIODS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["drag_figure", "drag_panel", "energy_figure", "energy_panel"]

MOST_MEANS = 120  # of each part; with more periods, one mean covers several


def energy_figure(analysis: Analysis, smoothed: Smoothed | None = None) -> Figure | None:
    """Draw the mechanical energy with its band, its kinetic and potential parts, and the deviation from the law.

    Return None if the record determines no displacement.

    Parameters
    ----------
    analysis : Analysis
        Analysis of a record that oscillates. Without a mass in its scene, the energy of one kilogram is drawn.
    smoothed : Smoothed, optional
        Smoothed motion, which separates the two parts; without it they are not drawn.
    """
    motion = moving(analysis)
    curve = motion.derived.energy_curve(motion.damping, motion.demodulated)
    if curve is None:
        return None
    with style():
        smoothed = smoothed if analysis.track.unit == "m" else None
        heights = [2.7, 1.1]
        figure, axes = panels(heights if smoothed is None else [*heights, 2.1])
        above, below = axes[:2]
        energy_panel(above, analysis)
        if smoothed is not None:
            parts = _parts(motion, smoothed)
            _draw_means(above, motion, *parts)
            _draw_parts(axes[2], analysis, *parts)
            axes[2].set_ylabel(above.get_ylabel())
        law = np.interp(curve.x_points, curve.x, curve.y)
        # Where friction has stopped the motion, the law predicts no energy for comparison.
        drawn, moves = law > 0.0, curve.y > 0.0
        deviation = 100.0 * (curve.y_points[drawn] / law[drawn] - 1.0)
        scatter = 100.0 * curve.u_points[drawn] / law[drawn]
        width = 100.0 * curve.u[moves] / curve.y[moves]
        below.fill_between(curve.x[moves], -width, width, color=SKY, alpha=0.45, lw=0)
        _draw_points(below, curve.x_points[drawn], deviation, scatter, None)
        below.axhline(0.0, color="#000000", lw=0.8)
        reach = 1.08 * max(float(np.max(np.abs(deviation) + scatter)), float(np.max(width)), 1e-6)
        below.set_ylim(-reach, reach)
        below.set_ylabel("deviation / %")
        share(above, below, float(curve.x[0]), float(np.nanmax(analysis.track.t)))
        axes[-1].set_xlabel("time / s")
        legend_above(above)
        return figure


def _parts(motion: Oscillation, smoothed: Smoothed) -> tuple[F8, F8, F8]:
    """Return sorted times with the kinetic and the potential energy at each, in J, or in J/kg without a mass."""
    rows = np.flatnonzero(np.isfinite(smoothed.position))
    rows = rows[np.argsort(smoothed.t[rows], kind="stable")]
    stiffness = motion.derived.half_stiffness
    assert stiffness is not None  # otherwise there is no energy curve
    t, half = smoothed.t[rows], stiffness.value
    displacement = smoothed.position[rows] - motion.rest.at(t)
    # Both energies use the same constant, because m v^2 / 2 = k (v/omega)^2 / 2.
    quadrature = smoothed.velocity[rows] / motion.phase.angular_frequency.value
    return t, half * quadrature**2, half * displacement**2


def _draw_means(panel: Axes, motion: Oscillation, t: F8, kinetic: F8, potential: F8) -> None:
    """Draw each part's mean over every whole period, or over several periods if there are many."""
    together = max(1, math.ceil(motion.cycles.count / MOST_MEANS))
    turn = np.floor((t - t[0]) * motion.cycles.frequency_hz / together).astype(np.intp)
    counts = np.bincount(turn)
    whole = counts >= np.median(counts) - 1  # a period is not a whole number of samples
    times = np.bincount(turn, t)[whole] / counts[whole]
    # Both means are half the energy and lie on one line, so their markers alternate and neither covers the other.
    for first, (part, marker, colour, label) in enumerate(
        ((kinetic, "o", VERMILLION, "kinetic"), (potential, "^", GREEN, "potential"))
    ):
        mean = 1e3 * np.bincount(turn, part)[whole] / counts[whole]
        open_marker: dict[str, Any] = {
            "ls": "",
            "mew": 0.8,
            "mfc": "none",
            "color": colour,
            "label": f"{label}, mean of a period",
        }
        panel.plot(times[first::2], mean[first::2], marker, ms=3.4, **open_marker)


def _draw_parts(panel: Axes, analysis: Analysis, t: F8, kinetic: F8, potential: F8) -> None:
    """Draw the exchange between both parts in the first periods, and their sum."""
    motion = moving(analysis)
    end = min(float(t[0]) + ZOOM_PERIODS / motion.cycles.frequency_hz, float(t[-1]))
    rows = np.flatnonzero(t <= end)
    rows = rows[:: max(1, rows.size // 600)]
    for part, colour, dashes in ((kinetic, VERMILLION, "-"), (potential, GREEN, (0, (4, 1.5)))):
        panel.plot(t[rows], 1e3 * part[rows], color=colour, ls=dashes, lw=0.9)
    panel.plot(t[rows], 1e3 * (kinetic + potential)[rows], color="#000000", lw=0.9)
    panel.set_title("kinetic, potential (dashed) and their sum in the first periods")
    panel.set_ylim(bottom=0.0)
    panel.set_xlim(float(t[0]), end)


def energy_panel(panel: Axes, analysis: Analysis) -> None:
    """Draw the mechanical energy against time with its uncertainty band, as :func:`energy_figure` does.

    Raises
    ------
    AnalysisError
        If the record determines no displacement.
    """
    motion = moving(analysis)
    curve = motion.derived.energy_curve(motion.damping, motion.demodulated)
    if curve is None:
        raise AnalysisError(f"an energy needs a displacement, and a record in {analysis.track.unit} tells none")
    low, high = curve.y - curve.u, curve.y_points
    _draw(panel, curve, 1.0, 1e3, "from single amplitudes", f"from the law {motion.damping.selected}")
    if 0 < float(np.min(low)) < float(np.max(high)) / 20.0 and float(np.min(high)) > 0:
        panel.set_yscale("log")
        panel.yaxis.set_major_formatter("{x:g}")
    panel.set_ylabel("energy / mJ" if curve.unit == "J" else "energy per mass / (mJ/kg)")


def drag_figure(analysis: Analysis) -> Figure | None:
    """Draw the drag coefficient against amplitude with its band; return None if it cannot be determined.

    Parameters
    ----------
    analysis : Analysis
        Analysis of a record that oscillates.
    """
    with style():
        figure, (panel,) = panels([3.7])
        if not drag_panel(panel, analysis):
            return None
        # The axis begins at 0 and the coefficient falls with growing amplitude, so the lower left corner is free.
        panel.legend(loc="lower left")
        return figure


def drag_panel(panel: Axes, analysis: Analysis) -> bool:
    """Draw the drag coefficient against amplitude; return whether scene and record determine one.

    Parameters
    ----------
    panel : Axes
    analysis : Analysis
        Analysis of a record that oscillates.
    """
    motion = moving(analysis)
    curve = motion.derived.drag_curve(motion.damping, motion.demodulated)
    diameter, displacement = analysis.scene.disc_diameter_m, motion.derived.displacement
    if curve is None or diameter is None or displacement is None:
        return False
    unit = analysis.track.unit
    factor = SHOWN[unit].factor
    _draw(panel, curve, factor, 1.0, "from a stretch of the record", f"from the law {motion.damping.selected}")
    points = [curve.y_points + curve.u_points, curve.y_points - curve.u_points]
    shown = np.concatenate([curve.y + curve.u, curve.y - curve.u, *points])
    # The long error bar of a stretch with hardly any damping would compress everything else.
    most = 2.5 * float(np.max(np.abs(curve.y) + curve.u))
    low, high = min(0.0, max(float(np.min(shown)), -most)), min(float(np.max(shown)), most)
    panel.set_ylim(low - 0.05 * (high - low) if low < 0 else 0.0, high + 0.08 * (high - low))
    panel.set_ylabel("effective drag coefficient")
    panel.set_xlabel(value_label("amplitude", unit))
    edge = 0.04 * factor * float(np.ptp(curve.x))
    panel.set_xlim(max(factor * float(curve.x[0]) - edge, 0.0), factor * float(curve.x[-1]) + edge)
    per_value = 2.0 * np.pi * displacement.value / (diameter.value * factor)
    second = panel.secondary_xaxis("top", functions=(_times(per_value), _times(1.0 / per_value)))
    second.set_xlabel("Keulegan-Carpenter number")
    return True


def _times(factor: float) -> Callable[[ArrayLike], F8]:
    return lambda x: np.asarray(x, np.float64) * factor


def _draw(panel: Axes, curve: Curve, x: float, y: float, points: str, law: str) -> None:
    """Draw band, points and curve, multiplied by the factors x and y."""
    label = "± one standard uncertainty"
    low, high = y * (curve.y - curve.u), y * (curve.y + curve.u)
    panel.fill_between(x * curve.x, low, high, color=SKY, alpha=0.45, lw=0, label=label)
    _draw_points(panel, x * curve.x_points, y * curve.y_points, y * curve.u_points, points)
    panel.plot(x * curve.x, y * curve.y, color="#000000", lw=1.0, label=law, zorder=3)


def _draw_points(panel: Axes, x: F8, y: F8, u: F8, label: str | None) -> None:
    error_bars(panel, x, y, u, label, size=2.6, width=0.7, color=BLUE)
