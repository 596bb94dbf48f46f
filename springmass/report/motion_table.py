"""Motion and amplitude against time as tables with uncertainties: at every sample, and for every window."""

from __future__ import annotations

import numpy as np

from pipeline.analyse import Analysis
from pipeline.results.curves import Smoothed
from pipeline.units import Unit, noun

MOST_ROWS = 1_000_000


def columns_of(unit: str) -> tuple[str, ...]:
    """Return the columns of ``motion.csv``: time, value and used belong to the sample, the others are smoothed.

    >>> columns_of("rad")[1:6]
    ('angle_rad', 'used', 'smooth_angle_rad', 'u_smooth_angle_rad', 'derivative_rad_per_s')
    """
    word = noun(unit).replace(" ", "_")
    names = (f"smooth_{word}", "derivative", "second_derivative")
    if unit == "m":
        word, names = "distance", ("position", "velocity", "acceleration")
    smooth = [f"{name}{_spelt(Unit(1, -order).of(unit))}" for order, name in enumerate(names)]
    return ("time_s", f"{word}{_spelt(unit)}", "used", *(x for each in smooth for x in (each, f"u_{each}")))


def _spelt(unit: str) -> str:
    """Return a unit as the suffix of a column name; empty for a plain number."""
    spelt = unit.removeprefix("1").replace("/", "_per_").replace("^", "").strip("_")
    return f"_{spelt}" if spelt else ""


def motion_csv(analysis: Analysis, smoothed: Smoothed) -> str:
    """Return CSV with one line per sample in the record's order, with the columns from :func:`columns_of`.

    Times keep all their digits; other values keep ten, which exceeds their accuracy. NaN becomes an empty cell: a
    missing distance, or the motion at a sample without a time or outside the analysed part. Records of more than a
    million samples have a line for every second or third sample.
    """
    used = analysis.used
    orders = ("position", "velocity", "acceleration")
    motion = [getattr(smoothed, f"{u}{name}") for name in orders for u in ("", "u_")]
    every = -(-len(analysis.track) // MOST_ROWS)
    table = np.column_stack([analysis.track.t, analysis.track.y, used, *motion])[::every]
    line = ",".join(["%.17g", "%.10g", "%d", *["%.10g"] * 6]) + "\n"
    # One format string for many lines takes a third of the time of numpy, which formats them one by one.
    blocks = (table[at : at + 1000] for at in range(0, len(table), 1000))
    text = "".join((line * len(block)) % tuple(block.ravel().tolist()) for block in blocks)
    return ",".join(columns_of(analysis.track.unit)) + "\n" + text.replace("nan", "")


def amplitude_csv(analysis: Analysis) -> str:
    """Return CSV with one line per window: time, amplitude and total phase with their u; empty if nothing oscillates.

    u of an amplitude is its scatter about a smooth curve; the scale of the distances, which all share, is not in it.
    ``used`` is 0 for amplitudes far from their neighbours, to which no law was fitted.
    """
    if (motion := analysis.oscillation) is None:
        return ""
    windows, scatter, scale = motion.windows, motion.damping.scatter, analysis.derived.amplitude_scale
    u_phase = np.sqrt(windows.covariance[:, 1, 1] * max(motion.phase.reduced_chi2, 1.0))
    table = (windows.t, scale * windows.amplitude, scale * scatter.u, windows.phase, u_phase, scatter.kept)
    word = f"amplitude{_spelt(analysis.track.unit)}"
    rows = zip(*table, strict=True)
    lines = [f"{t:.10g},{a:.10g},{u_a:.3g},{phi:.10g},{u_phi:.3g},{used:d}" for t, a, u_a, phi, u_phi, used in rows]
    return "\n".join([f"time_s,{word},u_{word},phase_rad,u_phase_rad,used", *lines, ""])
