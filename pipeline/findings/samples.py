"""Findings on what was recorded: the part analysed, how many samples were usable, how they were measured, and when."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

from pipeline.bench.clock_rate import clock_rate
from pipeline.checks.echoes import count_quality
from pipeline.notice import Notice
from pipeline.numerics.levels import NEGLIGIBLE, SIGNIFICANT
from pipeline.parts.spans import Partition, Span, SpanKind
from pipeline.samples.condition import COARSE, Samples
from pipeline.track import U8, Track


def sample_findings(
    samples: Samples,
    flags: U8,
    noise: float,
    clusters: Mapping[str, float] | None = None,
    swing: tuple[float, float] | None = None,
    *,
    by_chance: bool = False,
) -> Iterator[Notice]:
    """Yield what the final flags and the noise show of the samples of a run.

    Only a run that oscillates has clusters of false echoes and a swing (rest position and amplitude at the start).
    ``by_chance`` says whether noise explains all false echoes, so that they need no finding; they remain flagged.
    """
    track, quantum = samples.track, samples.quantum
    counts, n = count_quality(flags), len(track)
    heights = [clipping.beyond for clipping in samples.clippings] or samples.plateaus
    move = _distance_to_move(heights, swing) if swing is not None and track.unit == "m" else {}
    for clipping in samples.clippings:
        numbers = {
            "samples": clipping.samples,
            "n": n,
            "share": clipping.samples / n,
            "above_m" if clipping.end == "far" else "below_m": clipping.beyond,
            "level_m": clipping.level,
            "first_s": clipping.first_s,
            "last_s": clipping.last_s,
        }
        yield Notice("clipped", {**numbers, **move})
    if counts["clipped"] and not samples.clippings:
        levels = {f"level_{i}_m": level for i, level in enumerate(samples.plateaus, 1)}
        yield Notice("clipped", {"samples": counts["clipped"], "n": n, **levels, **move})
    if (echoes := counts["false_echo"]) and not by_chance:
        numbers = {"samples": echoes, "n": n, "share": echoes / n, **(clusters or {})}
        yield Notice("false_echoes", numbers, "warning" if echoes > NEGLIGIBLE * n else "info")
    if counts["missing"]:
        yield Notice("missing_samples", {"samples": counts["missing"], "n": n}, "info")
    for code in ("duplicate_time", "non_monotonic_time"):
        if counts[code]:
            yield Notice(code, {"samples": counts[code]})
    if track.stated_error_m is not None and track.stated_error_m > SIGNIFICANT * noise:
        yield Notice("stated_error_is_not_noise", {"stated_error_m": track.stated_error_m, "noise_m": noise})
    if quantum is not None and quantum > COARSE * noise:
        yield Notice("quantised", {"step_m": quantum, "noise_m": noise})


def _distance_to_move(heights: Sequence[float], swing: tuple[float, float]) -> dict[str, float]:
    """Return how far to move the sensor if the motion is cut off at one end, with a margin of 1 cm."""
    rest, amplitude = swing
    lacks = [(amplitude - abs(level - rest), "nearer_cm" if level > rest else "away_cm") for level in heights]
    if not lacks or len({way for _, way in lacks}) > 1 or max(lacks)[0] <= 0.0:
        return {}
    lack, way = max(lacks)
    return {way: math.ceil(100.0 * lack + 1.0)}


def clock_findings(track: Track) -> Iterator[Notice]:
    """Yield what is known of the clock of the sensor and of late readings."""
    if track.clock == "nominal":
        yield Notice("nominal_clock")
    if (clock := clock_rate(track)).refused:
        yield Notice("clock_refused", {"why": clock.words})
    if track.held_samples:
        yield Notice("late_readings", {"readings": track.held_samples, "longest_stall_s": track.longest_stall_s})


def part_findings(partition: Partition | None, first_s: float, last_s: float) -> Iterator[Notice]:
    """Yield which parts of a recording from ``first_s`` to ``last_s`` were left out, and why."""
    if partition is None:
        return
    analysed = {"first_s": max(partition.first_s, first_s), "last_s": min(partition.last_s, last_s)}
    others = [span for span in partition.left_out if span.kind is SpanKind.FREE]
    handled = [span for span in partition.left_out if span.kind is SpanKind.HANDLED]
    still = [span for span in partition.left_out if span.kind is SpanKind.AT_REST]
    for kind in dict.fromkeys(one.kind for one in partition.breaks):
        breaks = [one for one in partition.breaks if one.kind == kind]
        numbers = {
            "time_s": breaks[0].time_s,
            "amplitude_ratio": 1.0 + breaks[0].amplitude,
            "phase_rad": breaks[0].phase,
            "times": len(breaks) if len(breaks) > 1 else None,
            "others": _listed(others) if others else None,
        }
        yield Notice(kind.value, {**numbers, **analysed})
    gaps = [span for span in partition.left_out if span.kind is SpanKind.GAP]
    if gaps:
        other = max(others, key=lambda span: span.last_s - span.first_s)
        numbers = {
            "gap_first_s": gaps[0].first_s,
            "gap_last_s": gaps[0].last_s,
            "gaps": len(gaps) if len(gaps) > 1 else None,
            "others": _listed(others) if len(others) > 1 else None,
            "other_from": other.first_s,
            "other_to": other.last_s,
        }
        yield Notice("long_gap", {**numbers, **analysed})
    if handled and not partition.breaks:
        yield Notice("handled", {"seconds": _seconds(handled), "left_out": _listed(handled), **analysed})
    for span in partition.left_out:
        if span.kind is SpanKind.WAITING:
            yield Notice("at_rest", {"seconds": span.last_s - span.first_s, "trigger_s": span.last_s})
    if still:
        # Windows reach beyond the first and the last sample by half the distance of two samples.
        ends = {"still_from_s": max(still[0].first_s, first_s), "still_to_s": min(still[0].last_s, last_s)}
        all_of_them = _listed(still) if len(still) > 1 else None
        yield Notice("at_rest", {"seconds": _seconds(still), **ends, "still": all_of_them, **analysed})


def _seconds(spans: Sequence[Span]) -> float:
    return sum(span.last_s - span.first_s for span in spans)


def _listed(spans: Sequence[Span]) -> str:
    return ", ".join(f"{span.first_s:.2f} to {span.last_s:.2f} s" for span in spans)
