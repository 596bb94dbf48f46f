"""Findings on a page: which stand at its top, what to do about each, and beside which figure the others stand."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pipeline.analyse import Analysis, Oscillation
from springmass.report.words import typeset
from springmass.terminal.printing import STANDING

__all__ = ["ADVICE", "LAW_CODES", "MOST_HEEDED", "Told", "advice_on", "sorted_out"]

MOST_HEEDED = 3
LAW_CODES = frozenset({"law_rejected", "laws_not_separable", "mixed_drag", "no_law_fits"})
"""Said by the verdict and the table of the laws."""

_WORDS = {"error": "Error", "warning": "Warning", "info": "Note"}
_BESIDE = {
    "position": (
        "at_rest handled restarted touched phase_jump contact rows_doubled clipped false_echoes locked_echoes "
        "missing_samples duplicate_time non_monotonic_time quantised held_samples smoothed_sensor not_sinusoidal "
        "undersampled rest_drift correlated_residuals lost_target rows_lost interleaved_records zero_filled_tail "
        "no_oscillation two_modes overdamped mains_hum implausible_motion implausible_distance implausible_sag "
        "sensor_lost wave_slips"
    ),
    "amplitude": "sideways_mode strongly_damped short_record not_converged",
    "phase": "amplitude_dependent_frequency",
}
_FIGURE_OF = {code: figure for figure, codes in _BESIDE.items() for code in codes.split()}

ADVICE = {
    "no_oscillation": "Look at the record, and record longer.",
    "two_modes": "Start the one without the other.",
    "handled": "See in the figure of the position whether the times are right.",
    "restarted": "Analyse the other parts with --from and --to.",
    "touched": "Analyse the other parts with --from and --to.",
    "phase_jump": "Analyse the other parts with --from and --to, and see how times were made.",
    "contact": "Take away what the bob hits.",
    "rows_doubled": "Record with measured times; use no time of this record.",
    "rows_lost": "Record with measured times; use no time of this record.",
    "interleaved_records": "Separate every other row.",
    "overdamped": "If the bob does not move in oil, see what it rubs against.",
    "false_echoes": "Move the sensor, or put a flat target on the bob.",
    "wave_slips": "Put a flat, hard target on the bob; exchange the sensor.",
    "clipped": "Move what stands nearer than the bob, or keep the bob within range.",
    "locked_echoes": "Take away what stands beside the path; turn off the sensor's filter.",
    "missing_samples": "Keep the bob within range.",
    "duplicate_time": "Check the export; prefer a sensor that sends its own time.",
    "non_monotonic_time": "Check the export: two runs may have been joined.",
    "unverified": "Restore the file from a copy, or make it again from the wire log or the old recording.",
    "clock_refused": "See to the link and to the sensor's rate.",
    "scene_implausible": "Check the value and its unit in the scene.",
    "spring_mass_missing": "Weigh the spring.",
    "uncertainty_missing": "State the uncertainty in the scene.",
    "quantised": "Record with more amplitude, or with a finer sensor.",
    "held_samples": "Record at the sensor's own rate.",
    "smoothed_sensor": "Switch the smoothing off in the sensor or its program.",
    "not_sinusoidal": "Look at the residuals; see to scale, spring and stops.",
    "undersampled": "Record at ten samples a period and more.",
    "mains_hum": "See to the sensor's supply; use none of the numbers.",
    "implausible_motion": "Check unit and column.",
    "implausible_sag": "Check the unit of the times (--time-unit).",
    "implausible_distance": "Check unit and column.",
    "short_record": "Record ten periods or more.",
    "amplitude_dependent_frequency": "Quote the amplitude with the period.",
    "rest_drift": "Check the clamp and the sensor's mount.",
    "sideways_mode": "Release the bob without sideways motion.",
    "amplitude_modulated": "Record for longer than a beat, and see what else moves.",
    "correlated_residuals": "Look at the figure of the amplitude; analyse parts of the record with --from and --to.",
    "not_converged": "Look at the residuals for what no smooth model describes.",
    "runs_exchanged": "Check which record belongs to which bob.",
    "springs_differ": "Check masses, spring, and what else swings; do not average them.",
    "laws_differ": "Quote each run's own law; look for a draught or a bent disc.",
    "truncated_row": "Export the recording again.",
    "lost_target": "Keep the bob within range.",
    "rate_assumed": "Check the rate: it scales period and spring constant.",
    "unit_assumed": "Check the unit, and give it with --unit.",
    "time_assumed": "Check the column; name another with --time.",
    "malformed_rows": "Look at the lines named.",
    "zero_filled_tail": "Look at the end of the file: its writer was interrupted.",
    "stale_header": "Check the rate.",
    "offset_unknown_after_gap": "Prefer the position file.",
    "pair_mismatch": "Check that both files are of one run.",
    "sensor_lost": "Look at cable, power and network; record again.",
    "other_device": "Give the ports names that stay.",
    "sensor_replaced": "Check which sensor this part is of; analyse the parts one by one.",
    "sensor_unconfirmed": "Check that the same sensor was plugged in again; give it a name with `springmass firmware`.",
    "readings_dropped": "Record on another disk.",
}
"""What to do about an error or a warning, one sentence by code."""


def advice_on(code: str, analysis: Analysis) -> str:
    """Return what to do about a finding of a run; where the motion is cut, by how far to move the sensor.

    The swing as it began, a centimetre to spare, in whole centimetres; by the widest of the cuts.
    """
    motion, unit = analysis.motion, analysis.track.unit
    if code == "clipped" and isinstance(motion, Oscillation) and unit == "m":
        rest, amplitude = analysis.estimates["offset"].value, float(motion.damping.best.amplitude(np.zeros(1))[0])
        cuts = [(cut.end, cut.from_m) for cut in analysis.conditioned.cuts if cut.fixed]
        cuts = cuts or [("far" if m > rest else "near", m) for m in analysis.conditioned.plateaus_m]
        lacks = [(amplitude - abs(from_m - rest), end) for end, from_m in cuts]
        if lacks and len({end for _, end in lacks}) == 1 and max(lacks)[0] > 0.0:
            lack, end = max(lacks)
            return f"Move the sensor {math.ceil(100.0 * lack + 1.0)} cm {'away' if end == 'near' else 'nearer'}."
    return ADVICE.get(code, "")


@dataclass(frozen=True, slots=True)
class Told:
    """One finding as the page tells it.

    Parameters
    ----------
    code, severity, word, message : str
        The message typeset, its first letter a capital.
    advice : str
        What to do; empty for a note.
    figure : str
        Name of the figure that shows it; empty where none does.
    """

    code: str
    severity: str
    word: str
    message: str
    advice: str
    figure: str


def sorted_out(findings: Iterable[Mapping[str, Any]], figures: Sequence[str]) -> dict[str, Any]:
    """Return each finding in the one place where the page tells it.

    Parameters
    ----------
    findings : iterable of mapping
        As in the result's JSON, the gravest first.
    figures : sequence of str
        Names of those that the page holds.

    Returns
    -------
    dict
        "heed": at most three that change a number; "beside": the others by the figure that shows them, "" for none;
        "standing": what every file of the format brings; "law": codes of what the verdict says.
    """
    heed: list[Told] = []
    beside: dict[str, list[Told]] = {}
    standing: list[Told] = []
    law: list[str] = []
    for finding in findings:
        code, severity = finding["code"], finding["severity"]
        if code in LAW_CODES:
            law.append(code)
            continue
        figure = _FIGURE_OF.get(code, "")
        message = typeset(finding["message"])
        told = Told(
            code,
            severity,
            _WORDS[severity],
            f"{message[:1].upper()}{message[1:]}",
            "" if severity == "info" else ADVICE.get(code, ""),
            figure if figure in figures else "",
        )
        if severity == "info" and code in STANDING:
            standing.append(told)
        elif severity != "info" and len(heed) < MOST_HEEDED:
            heed.append(told)
        else:
            beside.setdefault(told.figure, []).append(told)
    return {"heed": heed, "beside": beside, "standing": standing, "law": list(dict.fromkeys(law))}
