"""Findings on samples: how many were usable, how they were measured, and when."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from pipeline.bench.instrument import Instrument
from pipeline.checks.echoes import Clusters, count_quality
from pipeline.findings.finding import Finding
from pipeline.numerics.quantity import amount, noun, plural
from pipeline.samples.condition import Conditioned, Cut
from pipeline.track import U8, Track

__all__ = ["clock_findings", "held_finding", "sample_findings"]

MANY = 0.1  # share of false echoes from which the finding is a warning: the sensor is probably badly placed
COARSE = 2.6  # ratio of step to noise above which the step is coarse: for rounding noise alone it is sqrt(12) = 3.5
GUESSED = 3.0  # minimum ratio of a stated error to the scatter: a normal distribution has one sample in 370 beyond it


def sample_findings(
    conditioned: Conditioned,
    flags: U8,
    noise_m: float,
    clusters: Clusters | None = None,
    swing_m: tuple[float, float] | None = None,
    *,
    by_chance: bool = False,
) -> Iterator[Finding]:
    """Yield the findings on the samples of a run, which need not oscillate.

    Parameters
    ----------
    conditioned : Conditioned
    flags : (n,) uint8
        Final flags.
    noise_m : float
        Standard deviation of one sample, m.
    clusters : Clusters, optional
        Clusters of false echoes, if the run oscillates.
    swing_m : (float, float), optional
        Rest position and amplitude at the start, m, if the run oscillates.
    by_chance : bool
        Whether noise explains all false echoes, so that they need no finding; they remain flagged.
    """
    track, quantum_m = conditioned.track, conditioned.quantum_m
    counts, n, unit = count_quality(flags), len(track), track.unit
    levels_m = [cut.from_m for cut in conditioned.cuts]
    advice = _distance_to_move(levels_m, swing_m) if swing_m is not None and unit == "m" else ""
    if unit != "m":
        advice = "Choose a larger range of the sensor, or release with a smaller amplitude."
    yield from (_cut_finding(cut, n, unit, advice) for cut in conditioned.cuts)
    if counts["clipped"] and not conditioned.cuts:
        yield Finding(
            "clipped",
            "warning",
            f"{counts['clipped']} of {n} samples are cut off at a level flagged in the recording; they were left out.",
            "The readings stop there: the bob leaves the range of the sensor, or a fixed object stands between them. "
            "Period and damping come from the other samples of each period. The turning points beyond were not "
            "measured, so the amplitude comes from the sinusoid that is fitted to the other samples.",
            {"samples": counts["clipped"]},
            advice,
        )
    if (echoes := counts["false_echo"]) and not by_chance:
        yield Finding(
            "false_echoes",
            "warning" if echoes > MANY * n else "info",
            f"{echoes} of {n} samples ({echoes / n:.1%}) are false echoes; they were left out.",
            _cluster_details(clusters, unit),
            {"samples": echoes, "share": echoes / n},
        )
    if counts["missing"]:
        yield Finding(
            "missing_samples",
            "info",
            f"{counts['missing']} of {n} samples have no {noun(unit)}; they were left out.",
            values={"samples": counts["missing"]},
        )
    if repeated := counts["duplicate_time"]:
        words = f"{repeated} samples have the same time as an earlier one; they were left out."
        yield Finding("duplicate_time", "warning", words, values={"samples": repeated})
    if backward := counts["non_monotonic_time"]:
        words = f"{backward} samples have times that run backward; they were left out."
        yield Finding("non_monotonic_time", "warning", words, values={"samples": backward})
    if track.stated_error_m is not None and track.stated_error_m > GUESSED * noise_m:
        yield Finding(
            "stated_error_is_not_noise",
            "info",
            f"The file states an error of {amount(track.stated_error_m, unit, '.2f')}, but the samples scatter by "
            f"{amount(noise_m, unit)}, which was used.",
            "The stated error was not used as noise.",
            {"stated_error_m": track.stated_error_m, "noise_m": noise_m},
        )
    if quantum_m is not None and quantum_m > COARSE * noise_m:
        yield Finding(
            "quantised",
            "warning",
            f"The {plural(unit)} come in steps of {amount(quantum_m, unit, '.3g')}, which is more than their noise.",
            "Amplitudes may be wrong by several times their stated uncertainty.",
            {"step_m": quantum_m, "noise_m": noise_m},
        )


def _distance_to_move(levels_m: Sequence[float], swing_m: tuple[float, float]) -> str:
    """Return the advice how far to move the sensor if the motion is cut off at one end, with a margin of 1 cm."""
    rest_m, amplitude_m = swing_m
    lacks = [(amplitude_m - abs(level - rest_m), "nearer" if level > rest_m else "away") for level in levels_m]
    if not lacks or len({way for _, way in lacks}) > 1 or max(lacks)[0] <= 0.0:
        return ""
    lack_m, way = max(lacks)
    return f"Move the sensor {math.ceil(100.0 * lack_m + 1.0)} cm {way}."


def _cut_finding(cut: Cut, n: int, unit: str, advice: str) -> Finding:
    end = cut.end if unit == "m" else {"far": "upper", "near": "lower"}[cut.end]
    return Finding(
        "clipped",
        "warning",
        f"The motion is cut off at the {end} end beyond {amount(cut.from_m, unit, '.1f')} "
        f"({cut.samples / n:.0%} of the samples).",
        f"{cut.samples} of {n} samples between {cut.first_s:.2f} and {cut.last_s:.2f} s were left out, by where the "
        f"fitted motion goes. They lie about {amount(cut.level_m, unit, '.1f')}. The amplitude comes from the rest of "
        "each period.",
        {
            "samples": cut.samples,
            "from_m": cut.from_m,
            "level_m": cut.level_m,
            "first_s": cut.first_s,
            "last_s": cut.last_s,
        },
        advice,
    )


def _cluster_details(clusters: Clusters | None, unit: str) -> str:
    if clusters is None or not clusters.count:
        return ""
    return (
        f"{clusters.samples} of them come in {clusters.count} cluster{'s' * (clusters.count > 1)}, of which "
        f"{clusters.turning} lie at turning points. Together they would change the amplitude by "
        f"{amount(clusters.shift_m, unit, '+.2g')}."
    )


def held_finding(count: int, step_s: float, unit: str) -> Finding:
    """Return the finding on a sensor slower than its recording; a count of 1 means readings joined by lines."""
    if count == 1:
        message = f"The {plural(unit)} lie on straight lines: the readings of a slower sensor were interpolated."
    else:
        message = f"Each {noun(unit)} is repeated {count} times: the sensor measures only every {count * step_s:.3g} s."
    return Finding(
        "held_samples",
        "warning",
        message,
        "The uncertainties of amplitude and phase include that.",
        {"count": count, "interval_s": count * step_s},
    )


def clock_findings(track: Track, instrument: Instrument) -> Iterator[Finding]:
    """Yield findings on the clock of the sensor and on late readings.

    Parameters
    ----------
    track : Track
    instrument : Instrument
        The instrument of this track.
    """
    if track.clock == "nominal":
        yield Finding(
            "nominal_clock",
            "info",
            "The times are row numbers at the nominal rate, which a crystal keeps to 50 ppm.",
            "An even distribution over 50 ppm on either side, u = 29 ppm, is part of every period's uncertainty.",
        )
    if instrument.clock_refused:
        yield Finding(
            "clock_refused",
            "warning",
            "The clocks of sensor and computer disagree, so the times were not corrected.",
            instrument.clock_words,
        )
    if track.held_samples:
        yield Finding(
            "late_readings",
            "info",
            f"{track.held_samples} readings reached the computer late, by at most {track.longest_stall_s:.3g} s; "
            "the sensor's own times are used.",
            "The connection stalled, and these readings arrived together. The clocks were compared without them.",
            {"readings": track.held_samples, "longest_stall_s": track.longest_stall_s},
        )
