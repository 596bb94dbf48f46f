"""The numbers of the report's interactive charts: position, amplitude and frequency of one run."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.analyse import Analysis, Oscillation
from pipeline.numerics.quantity import SHOWN, noun
from pipeline.track import F8, UNUSABLE, Quality
from springmass.report.figures.canvas import thinned
from springmass.report.figures.frequency import frequency_points
from springmass.report.tables import law_status, page_unit

__all__ = ["REASONS", "chart_data"]

MOST_SAMPLES = 40_000
"""Approximate maximum number of samples in a chart; longer recordings keep the minimum and maximum of each bin."""
DIGITS = 5
"""Significant digits of a plotted number: a screen has fewer than ten thousand pixels."""
REASONS: tuple[tuple[int, str], ...] = (
    (int(Quality.CLIPPED), "clipped: cut off at the end of the range"),
    (int(Quality.FALSE_ECHO), "false echo: far from where the motion puts the bob"),
    (int(Quality.DUPLICATE_TIME), "repeats an earlier time"),
    (int(Quality.NON_MONOTONIC_TIME), "runs backward in time"),
    (int(Quality.OUTSIDE), "outside the analysed part"),
    (int(UNUSABLE), "not usable"),
)
"""Bits of a sample's flags, and their meaning in words."""


def chart_data(analysis: Analysis) -> dict[str, Any]:
    """Return the numbers of a run's charts, with None for missing numbers.

    Parameters
    ----------
    analysis : Analysis

    Returns
    -------
    dict
        ``unit`` and ``quantity`` of the recording; ``t`` in s, as a list or as start, step and count; ``y`` as a list
        in that unit; ``flagged``, a list of [row, reason]. For an oscillation also ``fit`` as a list, ``sigma``, the
        noise, and ``amplitude`` and ``frequency``.
    """
    track, motion = analysis.track, analysis.motion
    shown = SHOWN[track.unit]
    rows = np.flatnonzero(np.isfinite(track.t))
    rows = rows[np.argsort(track.t[rows], kind="stable")]
    if rows.size > MOST_SAMPLES:
        rows = rows[thinned(np.nan_to_num(track.y[rows]), MOST_SAMPLES // 2)]
    flags = analysis.flags[rows]
    y = track.y[rows] * shown.factor
    data: dict[str, Any] = {
        "unit": page_unit(shown.unit),
        "quantity": "position" if track.unit == "m" else noun(track.unit),
        "t": _times(track.t[rows]),
        "y": _plain(y),
        "flagged": [[int(row), _reason(int(flags[row]), y[row])] for row in np.flatnonzero(_left_out(flags, y))],
    }
    if isinstance(motion, Oscillation):
        data["fit"] = _plain(motion.waveform.position[rows] * shown.factor)
        data["sigma"] = _rounded(analysis.estimates["noise"].value * shown.factor)
        data["amplitude"] = _amplitude(motion, shown.factor)
        data["frequency"] = _frequency(motion, shown.factor)
    return data


def _left_out(flags: NDArray[np.uint8], y: F8) -> NDArray[np.bool_]:
    return np.asarray(((flags & UNUSABLE) != 0) | ~np.isfinite(y), np.bool_)


def _reason(flags: int, y: float) -> str:
    if not math.isfinite(y):
        return "missing: the sensor gave no distance"
    return next((words for bit, words in REASONS if flags & bit), "not usable")


def _amplitude(motion: Oscillation, factor: float) -> dict[str, Any]:
    """Return the amplitudes of the windows with their u, and every law at the same times, the selected law first."""
    damping, windows = motion.damping, motion.demodulated
    order = np.argsort(windows.t, kind="stable")
    t = windows.t[order]
    names = sorted(damping.fits, key=lambda name: (name != damping.selected, name != "linear"))
    return {
        "t": _plain(t, 7),
        "y": _plain(windows.amplitude[order] * factor),
        "u": _plain(damping.scatter.u[order] * factor, 3),
        "left_out": np.flatnonzero(~damping.scatter.kept[order]).tolist(),
        "laws": [
            {
                "name": name,
                "status": law_status(damping, name),
                "y": _plain(damping.fits[name].amplitude(t - damping.t0) * factor),
            }
            for name in names
        ],
    }


def _frequency(motion: Oscillation, factor: float) -> dict[str, Any] | None:
    points = frequency_points(motion)
    if points is None:
        return None
    order = np.argsort(points.amplitude, kind="stable")
    return {
        "a": _plain(points.amplitude[order] * factor),
        "f": _plain(points.frequency_hz[order], 8),
        "u": _plain(points.u_hz[order], 3),
        "mean": _rounded(motion.phase.angular_frequency.value / (2.0 * np.pi), 8),
        "model": _plain(motion.phase.rate(points.amplitude[order]) / (2.0 * np.pi), 8),
    }


def _times(t: F8) -> dict[str, float] | list[float | None]:
    """Return evenly spaced times as start, step and count, and other times as a list."""
    if t.size > 2:
        step = (t[-1] - t[0]) / (t.size - 1)
        if step > 0.0 and np.max(np.abs(t - t[0] - step * np.arange(t.size))) < 0.01 * step:
            return {"start": float(t[0]), "step": float(step), "count": int(t.size)}
    return _plain(t, 9)


def _plain(values: F8, digits: int = DIGITS) -> list[float | None]:
    return [_rounded(value, digits) for value in values.tolist()]


def _rounded(value: float, digits: int = DIGITS) -> float | None:
    return float(f"{value:.{digits}g}") if math.isfinite(value) else None
