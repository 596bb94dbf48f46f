"""One example of each finding, as a student's run would give it."""

from __future__ import annotations

from collections.abc import Mapping

__all__ = ["EXAMPLES"]

EXAMPLES: Mapping[str, str] = {
    # Motion.
    "no_oscillation": "No oscillation: the distance stays within 0.3 mm: nothing moves in the beam.",
    "two_modes": "Two oscillations of similar strength overlap, so there is no single period.",
    "overdamped": "The motion is overdamped: it does not oscillate.",
    "strongly_damped": "Strong damping: the equation of motion was solved and fitted, not a decaying sinusoid.",
    "short_record": "Only 4.2 periods were analysed, too few to measure the damping.",
    "touched": "The motion was disturbed at 41.9 s; only the part until 40.78 s was analysed.",
    "restarted": "The bob was released again at 60.2 s; only the part from 62.10 s on was analysed.",
    "phase_jump": "The phase jumps at 30.0 s; only the part from 30.10 s on was analysed.",
    "handled": "The bob does not move freely for 3.4 s; only the part from 117.20 s on was analysed.",
    "at_rest": "The bob hangs still from 0.00 to 2.31 s; that was left out.",
    "sideways_mode": "A second oscillation shows, 0.95 mm at 0.8027 Hz, perhaps sideways; the fit includes it.",
    "amplitude_dependent_frequency": (
        "At 53 mm the frequency is 0.16 % lower than in very small swings; the period is an average."
    ),
    "rest_drift": "The rest position drifts by 0.52 mm.",
    "not_sinusoidal": "In every period the motion differs from a sinusoid by up to 1.1 mm (2.1 % of the amplitude).",
    "model_misfit": "Residuals (0.2 mm) exceed the scatter in a period (0.11 mm); the uncertainties were increased.",
    "not_converged": "The fit of the whole waveform did not converge; the values of standard accuracy are given.",
    "implausible_motion": "The motion needs 12 times the acceleration of gravity: probably a wrong unit.",
    "implausible_sag": "A period of 305.4 s would stretch the spring by 2.32e+04 m.",
    # Damping.
    "stated_law_rejected": "The recording contradicts the law that you stated, linear: linear+quadratic fits better.",
    "no_law_fits": "No damping law fits: the best has a reduced chi-square of 5.98, not about 1.",
    "law_rejected": "2 of the 9 damping laws tried fit this recording; 7 do not.",
    "laws_not_separable": "7 damping laws fit this run equally well; a longer run may distinguish them.",
    # Distances.
    "clipped": "542 of 2000 samples are cut off at 324.2 mm; they were left out.",
    "false_echoes": "701 of 12000 samples (5.8%) are false echoes; they were left out.",
    "missing_samples": "144 of 1000 samples have no distance; they were left out.",
    "lost_target": "12 distances of 2.4 to 2.6 m are far from all others: the target was lost; kept and flagged.",
    "no_target": "The sensor heard no echo for 2.5 s in total, at most 1.4 s at a time.",
    "quantised": "The distances come in steps of 1 mm, which is more than their noise.",
    "held_samples": "Each distance is repeated 5 times: the sensor measures only every 0.05 s.",
    "smoothed_sensor": "Neighbouring distances are correlated (0.55): the sensor smooths its readings.",
    "stated_error_is_not_noise": (
        "The file states an error of 2.39 mm, but the samples scatter by 0.057 mm, which was used."
    ),
    "implausible_distance": "Distances from -0.248 to 0.245 m are outside the range of a rangefinder.",
    "offset_unknown": (
        "The position was integrated from the velocity: its offset is unknown, and the first sample is at 0 m."
    ),
    "offset_unknown_after_gap": (
        "The velocity has 2 gaps, the first before t = 3.2 s: the integrated position may jump there."
    ),
    "pair_mismatch": "31 of 40 velocities contradict the positions; the two files may be of different runs.",
    "velocity_missing": "2 times are only in the position file, so they have no velocity.",
    # Times.
    "nominal_clock": "The times are row numbers at the nominal rate, which a crystal keeps to 50 ppm.",
    "duplicate_time": "14 samples have the same time as an earlier one; they were left out.",
    "non_monotonic_time": "3 samples have times that run backward; they were left out.",
    "undersampled": "There are only 3.1 samples per period: another frequency gives the same samples.",
    "clock_refused": "The clocks of sensor and computer disagree, so the times were not corrected.",
    "late_readings": "40 readings reached the computer late, by at most 0.25 s; the sensor's own times are used.",
    "jittered_time": "The times are measured: their steps vary from 98.87 to 101.2 ms (9.99944 Hz on average).",
    "times_in_bursts": "The times come in bursts of 5 samples every 50 ms; the samples were spread evenly, at 100 Hz.",
    "clock_times": "The file gives times of day; here time 0 is 10:04:59.812.",
    "rate_assumed": "The rate of 30.08 Hz is the most likely one: there are too few rows to be certain.",
    "rate_given": "You stated the sampling rate: 100 Hz.",
    "time_assumed": '"column 1" was read as the times, because no other column rises like it.',
    "stale_header": "The header states the times 0 s + i * 0.01 s, but the column of times differs and is used.",
    # Scene.
    "spring_mass_missing": "The mass of the spring is not stated, so the spring constant is less certain.",
    "uncertainty_missing": "No uncertainty was stated for [bob] mass_kg, so it was taken as exact.",
    "scene_implausible": "Implausible: [bob] mass_kg = 200.",
    # Recording.
    "truncated_row": "The last row is incomplete; its sample counts as missing.",
    "malformed_rows": "3 rows could not be read, the first in line 120; 3 kept as missing samples.",
    "zero_filled_tail": "The last 144 distances are exactly 0, which no rangefinder reads; kept as missing samples.",
    "unit_assumed": "The times have no unit: read as seconds.",
    "unit_given": 'You stated the unit of "x": mm.',
    "decimal_comma": 'The comma in "0,2345" was read as a decimal comma, not as a thousands separator.',
    "empty_channel": 'The channel "column 3" has no numbers.',
    "preamble": '4 lines of text above the table were skipped; the first is "MIN=0".',
    "unverified": (
        "run.h5 was changed or damaged after it was written (the column 'distance'); it was read, as you asked."
    ),
    "unknown_code": "The run file contains a note that this version does not know.",
    "cut_short": "The recording was cut short; everything in its log is here.",
    "damaged_log": "The wire log is damaged: 512 bytes at 20480 could not be read.",
    "readings_dropped": (
        "12 reads of the port (288 bytes) were dropped because the disk was too slow and the queue was full."
    ),
    "sensor_lost": "The sensor sent no reading in the last 8 s of the 60 s recorded.",
    "sensor_away": (
        "The sensor's port was lost once and came back, after at most 3.1 s; 3.1 s in total were not recorded."
    ),
    "counter_changed": (
        "The connection broke and the sensor's counter started again; the computer's clock times the gap."
    ),
    "sensor_unconfirmed": "After the connection broke, another sensor of the same model may have been plugged in.",
    "sensor_replaced": "Another sensor was plugged in; the recording continues in channel 2.",
    "other_device": "Another device was connected in place of the lost sensor; it was not recorded.",
    # Comparison.
    "runs_exchanged": "The spring constants agree only if two runs are exchanged.",
    "springs_differ": "The spring constants of the runs disagree by 9 standard uncertainties.",
    "laws_differ": "The runs do not share one damping law.",
}
"""A message for each code; the numbers are examples."""
