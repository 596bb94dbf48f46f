"""The closed list of findings: severities, meaning, cause and advice for each code."""

from __future__ import annotations

import enum
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

__all__ = ["FINDINGS", "UNKNOWN_CODE", "FindingKind", "Severity", "Symptom", "check_finding"]

Severity = Literal["info", "warning", "error"]


class Symptom(enum.Enum):
    """The heading under which a reader looks for a finding."""

    TIMES = "Times"
    DISTANCES = "Distances"
    MOTION = "Motion"
    DAMPING = "Damping"
    SCENE = "Scene"
    RECORDING = "Recording"
    COMPARISON = "Comparison"


@dataclass(frozen=True, slots=True)
class FindingKind:
    """The properties of a finding that are the same for all runs.

    Parameters
    ----------
    severities : tuple of {"info", "warning", "error"}
        The severities that the finding may have; the first one is used if the reader of a file reports it.
    symptom : Symptom
    meaning, cause : str
        One sentence each.
    advice : str
        What to do, one sentence; empty if nothing needs to be done.
    figure : str
        The figure of the report that shows the finding: position, amplitude or phase; empty if none does.
    """

    severities: tuple[Severity, ...]
    symptom: Symptom
    meaning: str
    cause: str
    advice: str = ""
    figure: str = ""


UNKNOWN_CODE = "unknown_code"
"""The code for a note in a run file that was written by another version of springmass and is unknown to this one."""

_INFO: tuple[Severity, ...] = ("info",)
_WARNING: tuple[Severity, ...] = ("warning",)
_ERROR: tuple[Severity, ...] = ("error",)
_NOTE_OR_WARNING: tuple[Severity, ...] = ("info", "warning")

FINDINGS: Mapping[str, FindingKind] = {
    # Motion.
    "no_oscillation": FindingKind(
        _ERROR,
        Symptom.MOTION,
        "No oscillation stands out of the noise, so there is no period.",
        "The bob hangs still, the recording is too short, or the channel is not the motion.",
        "Look at the position figure, check the channel, and record at least ten periods.",
        "position",
    ),
    "two_modes": FindingKind(
        _ERROR,
        Symptom.MOTION,
        "Two oscillations of similar strength overlap, so there is no single period.",
        "The bob swings like a pendulum while it bounces, or two coupled bobs move.",
        "Release the bob straight down, without a push or a twist.",
        "position",
    ),
    "overdamped": FindingKind(
        _WARNING,
        Symptom.MOTION,
        "The bob returns to rest without oscillating; relaxation rates are given instead of a period.",
        "The bob moves in a viscous liquid or rubs against something.",
        "If the bob moves in air, look for what it rubs against.",
        "position",
    ),
    "strongly_damped": FindingKind(
        _INFO,
        Symptom.MOTION,
        "The damping is strong, so the equation of motion was solved and fitted, not a decaying sinusoid.",
        "A large disc, a liquid, or friction that stops the bob within the recording.",
        "",
        "amplitude",
    ),
    "short_record": FindingKind(
        _WARNING,
        Symptom.MOTION,
        "The analysed part has too few periods to measure the damping.",
        "The recording is short, or only a short part of it is free motion.",
        "Record at least ten periods of free motion.",
        "amplitude",
    ),
    "touched": FindingKind(
        _WARNING,
        Symptom.MOTION,
        "Amplitude and phase change suddenly; the longest undisturbed part was analysed.",
        "Something touched the bob, or the bob hit something.",
        "Do not touch the bob; analyse the other parts with --from and --to.",
        "position",
    ),
    "restarted": FindingKind(
        _WARNING,
        Symptom.MOTION,
        "The recording holds more than one free oscillation; the longest was analysed.",
        "The bob was stopped and released again.",
        "Analyse the other parts with --from and --to.",
        "position",
    ),
    "phase_jump": FindingKind(
        _WARNING,
        Symptom.MOTION,
        "The phase jumps while the amplitude goes on; the longest part was analysed.",
        "Rows were lost, a clock stopped for a while, or two recordings were joined.",
        "Check how the times were made; analyse the other parts with --from and --to.",
        "position",
    ),
    "handled": FindingKind(
        _WARNING,
        Symptom.MOTION,
        "The bob does not move freely in part of the recording; that part was left out.",
        "A hand held or moved the bob.",
        "Check the analysed part in the position figure.",
        "position",
    ),
    "at_rest": FindingKind(
        _INFO,
        Symptom.MOTION,
        "The bob is at rest in part of the recording; that part was left out.",
        "The recording began before the release, or went on after the motion had ended.",
        "",
        "position",
    ),
    "sideways_mode": FindingKind(
        _NOTE_OR_WARNING,
        Symptom.MOTION,
        "The bob also swings at a second frequency; the fit accounts for it.",
        "The bob swings sideways like a pendulum, or twists.",
        "Release the bob from straight below its rest position, without a push.",
        "spectrum",
    ),
    "amplitude_dependent_frequency": FindingKind(
        _WARNING,
        Symptom.MOTION,
        "The frequency changes with the amplitude; the period is the mean over the run.",
        "The spring is not linear, or the disc carries an amount of air that depends on the stroke.",
        "Quote the period together with the range of amplitudes.",
        "frequency",
    ),
    "rest_drift": FindingKind(
        _WARNING,
        Symptom.MOTION,
        "The rest position drifts or jumps.",
        "The clamp or the sensor moved, or the sensor or the air warmed up.",
        "Check the clamp and the sensor's mount.",
        "position",
    ),
    "not_sinusoidal": FindingKind(
        _WARNING,
        Symptom.MOTION,
        "Every period differs from a sinusoid in the same way; the uncertainties were increased.",
        "A wrong distance calibration, a slack spring, touching coils, or an echo near a turning point.",
        "Check the distance calibration, the spring's coils, and the aim of the sensor.",
        "spectrum",
    ),
    "model_misfit": FindingKind(
        _WARNING,
        Symptom.MOTION,
        "The model does not describe this recording to within its noise; the uncertainties were increased.",
        "Anything that is not modelled: a slow beat, a driven bob, lost or doubled rows, a changing spring.",
        "Look at the residuals; analyse parts of the recording with --from and --to.",
        "position",
    ),
    "not_converged": FindingKind(
        _WARNING,
        Symptom.MOTION,
        "The fit of the whole motion did not converge; the values of standard accuracy are given.",
        "The motion contains something that no smooth model describes.",
        "Look at the residuals.",
        "amplitude",
    ),
    "implausible_motion": FindingKind(
        _WARNING,
        Symptom.MOTION,
        "The acceleration is larger than a bob on a hanging spring can reach.",
        "A wrong unit, mains hum, or a velocity or voltage read as a distance.",
        "Check the units of distance and time, and that the right channel was read.",
        "position",
    ),
    "implausible_sag": FindingKind(
        _WARNING,
        Symptom.MOTION,
        "The period is too long for a bob on a spring.",
        "Times in ms or us were read as seconds, or the motion is not that of a bob on a spring.",
        "Check the unit of the times (--time-unit).",
        "position",
    ),
    # Damping.
    "no_law_fits": FindingKind(
        _WARNING,
        Symptom.DAMPING,
        "No damping law describes how the amplitude falls.",
        "Several kinds of drag act, the amplitude beats, or the run was disturbed.",
        "Quote the amplitude against time instead of the coefficients of a law.",
        "amplitude",
    ),
    "stated_law_rejected": FindingKind(
        _WARNING,
        Symptom.DAMPING,
        "The recording contradicts the damping law that you stated.",
        "The amplitude falls in another way, or was disturbed during the run.",
        "State another law, or none: --law any lets the recording choose.",
        "amplitude",
    ),
    "law_rejected": FindingKind(
        _INFO, Symptom.DAMPING, "The recording contradicts these damping laws.", "The amplitude falls in another way."
    ),
    "laws_not_separable": FindingKind(
        _INFO,
        Symptom.DAMPING,
        "The recording cannot distinguish these damping laws.",
        "The run is too short, or its amplitude falls too little.",
    ),
    # Distances.
    "clipped": FindingKind(
        _WARNING,
        Symptom.DISTANCES,
        "The distances are cut off at a level; the amplitude comes from the rest of each period.",
        "A fixed object in the beam, or a target outside the sensor's range.",
        "Remove what blocks the beam, or keep the bob within range.",
        "position",
    ),
    "false_echoes": FindingKind(
        _NOTE_OR_WARNING,
        Symptom.DISTANCES,
        "Some distances are false echoes; they were left out.",
        "The beam hits the support, the string or a neighbour.",
        "Move the sensor, or fix a flat target to the bob.",
        "position",
    ),
    "missing_samples": FindingKind(
        _NOTE_OR_WARNING,
        Symptom.DISTANCES,
        "Some samples have no distance.",
        "The sensor lost the target, or the file has empty cells.",
        "Keep the bob within range.",
        "position",
    ),
    "lost_target": FindingKind(
        _WARNING,
        Symptom.DISTANCES,
        "Some distances lie far outside the motion; they were left out.",
        "The sensor lost the target and measured something else.",
        "Keep the bob within range.",
        "position",
    ),
    "no_target": FindingKind(
        _INFO,
        Symptom.DISTANCES,
        "The sensor answered but heard no echo for a while.",
        "The bob was out of range.",
        "Keep the bob within range.",
    ),
    "quantised": FindingKind(
        _WARNING,
        Symptom.DISTANCES,
        "The distances come in steps larger than their noise.",
        "The sensor or the file has few digits.",
        "Record with a larger amplitude or a finer sensor.",
        "position",
    ),
    "held_samples": FindingKind(
        _WARNING,
        Symptom.DISTANCES,
        "Each distance is repeated several times; the uncertainties were increased.",
        "The sensor measures more slowly than the file records.",
        "Record at the sensor's own rate.",
        "position",
    ),
    "smoothed_sensor": FindingKind(
        _WARNING,
        Symptom.DISTANCES,
        "Neighbouring samples are correlated, as after a smoothing filter; the uncertainties were increased.",
        "The sensor or its program smooths the readings, or joins slow ones by lines, and the amplitude is too small.",
        "Switch the smoothing off, or state it in the scene under [sensor].",
        "position",
    ),
    "stated_error_is_not_noise": FindingKind(
        _INFO,
        Symptom.DISTANCES,
        "The error column of the file is not the noise of the samples; it was not used.",
        "The file states a resolution or a guess.",
    ),
    "implausible_distance": FindingKind(
        _WARNING,
        Symptom.DISTANCES,
        "The distances are outside the range of a rangefinder.",
        "A wrong unit, or a displacement or velocity read as a distance.",
        "Check the unit and the channel.",
        "position",
    ),
    "offset_unknown": FindingKind(
        _INFO,
        Symptom.DISTANCES,
        "The distance was integrated from the velocity, so the rest position is unknown.",
        "The file has velocities only.",
    ),
    "offset_unknown_after_gap": FindingKind(
        _WARNING,
        Symptom.DISTANCES,
        "The distance was integrated from the velocity across gaps, so it may jump there.",
        "The velocity column has gaps.",
        "If the program also exported the position, analyse that file.",
    ),
    "pair_mismatch": FindingKind(
        _WARNING,
        Symptom.DISTANCES,
        "The velocities are not the differences of the positions.",
        "The two files are of different runs.",
        "Check that both files are of one run.",
    ),
    "velocity_missing": FindingKind(
        _INFO,
        Symptom.DISTANCES,
        "Some times have a position but no velocity.",
        "A velocity needs two neighbouring positions.",
    ),
    # Times.
    "nominal_clock": FindingKind(
        _INFO,
        Symptom.TIMES,
        "The times are row numbers over the nominal rate; every period's uncertainty includes 50 ppm for the clock.",
        "The file does not record when each sample was taken.",
    ),
    "duplicate_time": FindingKind(
        _WARNING,
        Symptom.TIMES,
        "Some samples have the same time as an earlier one; they were left out.",
        "The export rounds its times, or rows were written twice.",
        "Export the times with more digits, or use a sensor that sends its own.",
        "position",
    ),
    "non_monotonic_time": FindingKind(
        _WARNING,
        Symptom.TIMES,
        "Some samples run backward in time; they were left out.",
        "Two runs were joined, or rows were written out of order.",
        "Export one run per file, with its rows in the order of their times.",
        "position",
    ),
    "undersampled": FindingKind(
        _WARNING,
        Symptom.TIMES,
        "There are fewer than four samples per period, so another frequency fits as well.",
        "The sampling rate is too low for this motion.",
        "Record at least ten samples per period.",
        "position",
    ),
    "clock_refused": FindingKind(
        _WARNING,
        Symptom.TIMES,
        "The clocks of sensor and computer disagree; the times were not corrected.",
        "The stated rate is wrong, the sensor's clock is inaccurate, or the cable or network stalled.",
        "Check the cable and the sensor's rate; state its clock's accuracy with --clock-ppm.",
    ),
    "late_readings": FindingKind(
        _INFO,
        Symptom.TIMES,
        "Some readings arrived late; their own times are used.",
        "The link between sensor and computer stalled.",
    ),
    "jittered_time": FindingKind(
        _INFO, Symptom.TIMES, "The measured times vary a little; they are used as they are.", "The times were measured."
    ),
    "times_in_bursts": FindingKind(
        _WARNING,
        Symptom.TIMES,
        "The computer stamped several samples together; they were spread evenly.",
        "The computer set the times; the sensor was polled, or its samples came in packets.",
        "Record the sensor's own times; one lost sample shifts all later ones.",
        "position",
    ),
    "clock_times": FindingKind(
        _INFO,
        Symptom.TIMES,
        "The file gives times of day; the first one is time 0.",
        "The file records a clock.",
    ),
    "rate_assumed": FindingKind(
        _WARNING,
        Symptom.TIMES,
        "The sampling rate was estimated from few or irregular times.",
        "The file does not state its rate.",
        "Check the rate, or state it with --rate-hz: period and spring constant scale with it.",
    ),
    "rate_given": FindingKind(_INFO, Symptom.TIMES, "You stated the sampling rate.", "The file does not state it."),
    "time_assumed": FindingKind(
        _WARNING,
        Symptom.TIMES,
        "The time column was chosen because it is the only one that increases.",
        "No column is named time.",
        "Check the column; choose another with --time.",
    ),
    "stale_header": FindingKind(
        _WARNING,
        Symptom.TIMES,
        "The header contradicts the rows; the rows were used.",
        "The header was copied from another recording.",
        "Check the rate.",
    ),
    # Scene.
    "spring_mass_missing": FindingKind(
        _WARNING,
        Symptom.SCENE,
        "The mass of the spring is not stated, so the spring constant is less certain.",
        "A third of the spring's mass moves with the bob.",
        "Weigh the spring and state it with --spring-mass-kg.",
    ),
    "uncertainty_missing": FindingKind(
        _WARNING,
        Symptom.SCENE,
        "A mass or diameter was stated without an uncertainty and taken as exact.",
        "The scene states the value as a plain number.",
        "Add it with --mass-u-kg, or in the scene as { value = ..., u = ... }.",
    ),
    "scene_implausible": FindingKind(
        _WARNING,
        Symptom.SCENE,
        "A value in the scene is outside the usual range of a bench.",
        "A wrong unit or a typing error.",
        "Check the value and its unit.",
    ),
    # Recording and file.
    "truncated_row": FindingKind(
        _WARNING,
        Symptom.RECORDING,
        "The last row is incomplete; its sample counts as missing.",
        "The export stopped in the middle of a row.",
        "Export the recording again.",
    ),
    "malformed_rows": FindingKind(
        _WARNING,
        Symptom.RECORDING,
        "Some rows could not be read.",
        "These rows contain text or too few columns.",
        "Look at the lines that the warning names.",
    ),
    "zero_filled_tail": FindingKind(
        _WARNING,
        Symptom.RECORDING,
        "The file ends in zeros; they were left out.",
        "The program that wrote it was interrupted.",
        "Look at the end of the file.",
        "position",
    ),
    "unit_assumed": FindingKind(
        _WARNING,
        Symptom.RECORDING,
        "A unit was assumed.",
        "The file does not state it.",
        "Check the unit, or state it with --unit or --time-unit.",
    ),
    "unit_given": FindingKind(
        _INFO, Symptom.RECORDING, "You stated the unit of the values.", "The file does not state it."
    ),
    "decimal_comma": FindingKind(
        _INFO, Symptom.RECORDING, "Commas were read as decimal marks.", "All numbers in a column look like 1,500."
    ),
    "empty_channel": FindingKind(
        _INFO, Symptom.RECORDING, "A channel contains no numbers.", "Its column is empty.", "Choose another channel."
    ),
    "preamble": FindingKind(
        _INFO, Symptom.RECORDING, "There are lines of text above the table.", "The program wrote a header."
    ),
    "unverified": FindingKind(
        _ERROR,
        Symptom.RECORDING,
        "The run file was changed or damaged after it was written.",
        "A damaged disk, or an edit.",
        "Restore the file from a copy, or make it again from the wire log.",
    ),
    UNKNOWN_CODE: FindingKind(
        _INFO,
        Symptom.RECORDING,
        "The run file contains a note that this version does not know.",
        "Another version of springmass wrote the file.",
    ),
    "cut_short": FindingKind(
        _INFO,
        Symptom.RECORDING,
        "The recording was interrupted; everything up to then is kept.",
        "The program, the computer or the disk stopped.",
    ),
    "damaged_log": FindingKind(
        _INFO,
        Symptom.RECORDING,
        "Part of the wire log is damaged; the rest was recovered.",
        "A damaged disk, or an edit.",
        "Look for the cause before you record again.",
    ),
    "readings_dropped": FindingKind(
        _WARNING,
        Symptom.RECORDING,
        "Readings were lost because the disk was too slow.",
        "The disk did not answer until the recorder's queue was full.",
        "Record on another disk.",
    ),
    "sensor_lost": FindingKind(
        _WARNING,
        Symptom.RECORDING,
        "The sensor stopped answering before the end.",
        "A loose cable, no power, or a network failure.",
        "Check the cable, the power and the network; record again.",
        "position",
    ),
    "sensor_away": FindingKind(
        _INFO,
        Symptom.RECORDING,
        "The sensor was unplugged for a while and came back.",
        "A loose plug.",
        "Make sure that the plug is firmly in.",
    ),
    "counter_changed": FindingKind(
        _INFO,
        Symptom.RECORDING,
        "After the connection broke, the sensor's counter started again.",
        "The device lost power, or another device was plugged in.",
        "Make sure that the plug is firmly in.",
    ),
    "sensor_unconfirmed": FindingKind(
        _WARNING,
        Symptom.RECORDING,
        "After the connection broke, another sensor of the same model may have been plugged in.",
        "It sends no name and no serial number.",
        "Check that it is the same one; springmass firmware can name it.",
    ),
    "sensor_replaced": FindingKind(
        _WARNING,
        Symptom.RECORDING,
        "A different sensor of the same model was plugged in; its samples are a separate run.",
        "A different device was plugged in.",
        "Check which sensor each part is from; analyse the parts separately.",
    ),
    "other_device": FindingKind(
        _WARNING,
        Symptom.RECORDING,
        "A different device appeared in place of the sensor; nothing from it was recorded.",
        "The port's name now belongs to another device.",
        "Give the ports names that do not change.",
    ),
    # Comparison of runs.
    "runs_exchanged": FindingKind(
        _ERROR,
        Symptom.COMPARISON,
        "The spring constants agree only if two runs are exchanged.",
        "Two recordings or two masses were mixed up.",
        "Check which recording belongs to which bob.",
    ),
    "springs_differ": FindingKind(
        _ERROR,
        Symptom.COMPARISON,
        "The spring constants of the runs disagree.",
        "The springs differ, a mass is wrong, or a mass that moves with the bob was not counted.",
        "Check the masses and the spring; do not average.",
    ),
    "laws_differ": FindingKind(
        _WARNING,
        Symptom.COMPARISON,
        "The runs do not share one damping law.",
        "A draught, a bent disc, or another range of amplitudes.",
        "Quote each run's own law.",
    ),
}
"""Each code with its severities, texts and figure."""


def check_finding(code: str, severity: str) -> None:
    """Raise an error if a finding is not registered with this severity.

    Raises
    ------
    ValueError
        If the code is not registered, or not with this severity.
    """
    if code not in FINDINGS or severity not in FINDINGS[code].severities:
        raise ValueError(f"finding {code!r} with severity {severity!r} is not registered in pipeline.findings.registry")
