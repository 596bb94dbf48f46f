"""The closed list of finding codes, each with the severities that it may have."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

__all__ = ["FINDINGS", "UNKNOWN_CODE", "Severity", "check_finding"]

Severity = Literal["info", "warning", "error"]

UNKNOWN_CODE = "unknown_code"
"""The code of a note that another version of springmass left in a run file and this one does not know."""

FINDINGS: Mapping[str, tuple[Severity, ...]] = {
    # From the analysis of a run.
    "amplitude_dependent_frequency": ("warning",),
    "amplitude_modulated": ("warning",),
    "at_rest": ("info",),
    "clipped": ("warning",),
    "clock_refused": ("warning",),
    "contact": ("warning",),
    "correlated_residuals": ("warning",),
    "duplicate_time": ("warning",),
    "false_echoes": ("info", "warning"),
    "halves_differ": ("info",),
    "handled": ("warning",),
    "held_samples": ("warning",),
    "implausible_distance": ("warning",),
    "implausible_motion": ("warning",),
    "implausible_sag": ("warning",),
    "interleaved_records": ("error",),
    "late_readings": ("info",),
    "law_rejected": ("info",),
    "laws_not_separable": ("info",),
    "locked_echoes": ("warning",),
    "mains_hum": ("warning", "error"),
    "missing_samples": ("info", "warning"),
    "mixed_drag": ("info",),
    "no_law_fits": ("warning",),
    "no_oscillation": ("error",),
    "nominal_clock": ("info",),
    "non_monotonic_time": ("warning",),
    "not_converged": ("warning",),
    "not_sinusoidal": ("warning",),
    "overdamped": ("warning",),
    "phase_jump": ("warning",),
    "quantised": ("warning",),
    "rest_drift": ("warning",),
    "restarted": ("warning",),
    "rows_doubled": ("error",),
    "rows_lost": ("error",),
    "scene_implausible": ("warning",),
    "short_record": ("warning",),
    "sideways_mode": ("info", "warning"),
    "smoothed_sensor": ("warning",),
    "spring_mass_missing": ("warning",),
    "stated_error_is_not_noise": ("info",),
    "strongly_damped": ("info",),
    "touched": ("warning",),
    "two_modes": ("error",),
    "uncertainty_missing": ("warning",),
    "undersampled": ("warning",),
    "wave_slips": ("info", "warning"),
    # From a comparison of runs.
    "laws_differ": ("warning",),
    "runs_exchanged": ("error",),
    "springs_differ": ("error",),
    # From the reader of a file.
    "clock_times": ("info",),
    "decimal_comma": ("info",),
    "empty_channel": ("info",),
    "jittered_time": ("info",),
    "lost_target": ("warning",),
    "malformed_rows": ("warning",),
    "offset_unknown": ("info",),
    "offset_unknown_after_gap": ("warning",),
    "pair_mismatch": ("warning",),
    "preamble": ("info",),
    "rate_assumed": ("warning",),
    "stale_header": ("warning",),
    "time_assumed": ("warning",),
    "truncated_row": ("warning",),
    "unit_assumed": ("warning",),
    "unverified": ("error",),
    "velocity_missing": ("info",),
    "zero_filled_tail": ("warning",),
    UNKNOWN_CODE: ("info",),
    # From the recovery of a wire log.
    "cut_short": ("info",),
    "damaged_log": ("info",),
    "no_target": ("info",),
    "other_device": ("warning",),
    "readings_dropped": ("warning",),
    "counter_changed": ("info",),
    "sensor_away": ("info",),
    "sensor_lost": ("warning",),
    "sensor_replaced": ("warning",),
    "sensor_unconfirmed": ("warning",),
}
"""Code to severities; where there are several, the first is that of a reader's finding."""


def check_finding(code: str, severity: str) -> None:
    """Refuse a finding that is not in the list.

    Raises
    ------
    ValueError
        If the code is not registered, or not with this severity.
    """
    if severity not in FINDINGS.get(code, ()):
        raise ValueError(f"finding {code!r} with severity {severity!r} is not registered in pipeline.registry.findings")
