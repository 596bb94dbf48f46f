"""Findings on what was recorded: the part analysed, how many samples were usable, how they were measured, and when."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

from pipeline.bench.instrument import Instrument
from pipeline.checks.echoes import count_quality
from pipeline.checks.residual import COARSE
from pipeline.numerics.levels import NEGLIGIBLE, SIGNIFICANT
from pipeline.registry.found import Found
from pipeline.samples.condition import Conditioned
from pipeline.track import U8, Track
from pipeline.windows.segments import Segments, Span, SpanKind


def sample_findings(
    conditioned: Conditioned,
    flags: U8,
    noise_m: float,
    clusters: Mapping[str, float] | None = None,
    swing_m: tuple[float, float] | None = None,
    *,
    by_chance: bool = False,
) -> Iterator[Found]:
    """Yield what the final flags and the noise show of the samples of a run.

    Only a run that oscillates has clusters of false echoes and a swing (rest position and amplitude at the start).
    ``by_chance`` says whether noise explains all false echoes, so that they need no finding; they remain flagged.
    """
    track, quantum_m = conditioned.track, conditioned.quantum_m
    counts, n = count_quality(flags), len(track)
    levels_m = [cut.from_m for cut in conditioned.cuts] or conditioned.plateaus_m
    move = _distance_to_move(levels_m, swing_m) if swing_m is not None and track.unit == "m" else {}
    for cut in conditioned.cuts:
        numbers = {
            "samples": cut.samples,
            "n": n,
            "share": cut.samples / n,
            "above_m" if cut.end == "far" else "below_m": cut.from_m,
            "level_m": cut.level_m,
            "first_s": cut.first_s,
            "last_s": cut.last_s,
        }
        yield Found("clipped", {**numbers, **move})
    if counts["clipped"] and not conditioned.cuts:
        levels = {f"level_{i}_m": level for i, level in enumerate(conditioned.plateaus_m, 1)}
        yield Found("clipped", {"samples": counts["clipped"], "n": n, **levels, **move})
    if (echoes := counts["false_echo"]) and not by_chance:
        numbers = {"samples": echoes, "n": n, "share": echoes / n, **(clusters or {})}
        yield Found("false_echoes", numbers, "warning" if echoes > NEGLIGIBLE * n else "info")
    if counts["missing"]:
        yield Found("missing_samples", {"samples": counts["missing"], "n": n}, "info")
    for code in ("duplicate_time", "non_monotonic_time"):
        if counts[code]:
            yield Found(code, {"samples": counts[code]})
    if track.stated_error_m is not None and track.stated_error_m > SIGNIFICANT * noise_m:
        yield Found("stated_error_is_not_noise", {"stated_error_m": track.stated_error_m, "noise_m": noise_m})
    if quantum_m is not None and quantum_m > COARSE * noise_m:
        yield Found("quantised", {"step_m": quantum_m, "noise_m": noise_m})


def _distance_to_move(levels_m: Sequence[float], swing_m: tuple[float, float]) -> dict[str, float]:
    """Return how far to move the sensor if the motion is cut off at one end, with a margin of 1 cm."""
    rest_m, amplitude_m = swing_m
    lacks = [(amplitude_m - abs(level - rest_m), "nearer_cm" if level > rest_m else "away_cm") for level in levels_m]
    if not lacks or len({way for _, way in lacks}) > 1 or max(lacks)[0] <= 0.0:
        return {}
    lack_m, way = max(lacks)
    return {way: math.ceil(100.0 * lack_m + 1.0)}


def clock_findings(track: Track) -> Iterator[Found]:
    """Yield what is known of the clock of the sensor and of late readings."""
    if track.clock == "nominal":
        yield Found("nominal_clock")
    instrument = Instrument.of(track)
    if instrument.clock_refused:
        yield Found("clock_refused", {"why": instrument.clock_words})
    if track.held_samples:
        yield Found("late_readings", {"readings": track.held_samples, "longest_stall_s": track.longest_stall_s})


def part_findings(segments: Segments | None, first_s: float, last_s: float) -> Iterator[Found]:
    """Yield which parts of a recording from ``first_s`` to ``last_s`` were left out, and why."""
    if segments is None:
        return
    analysed = {"first_s": max(segments.first_s, first_s), "last_s": min(segments.last_s, last_s)}
    others = [span for span in segments.left_out if span.kind is SpanKind.FREE]
    handled = [span for span in segments.left_out if span.kind is SpanKind.HANDLED]
    still = [span for span in segments.left_out if span.kind is SpanKind.AT_REST]
    for kind in dict.fromkeys(one.kind for one in segments.breaks):
        breaks = [one for one in segments.breaks if one.kind == kind]
        numbers = {
            "time_s": breaks[0].time_s,
            "amplitude_ratio": 1.0 + breaks[0].amplitude,
            "phase_rad": breaks[0].phase,
            "times": len(breaks) if len(breaks) > 1 else None,
            "others": _listed(others) if others else None,
        }
        yield Found(kind.value, {**numbers, **analysed})
    gaps = [span for span in segments.left_out if span.kind is SpanKind.GAP]
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
        yield Found("long_gap", {**numbers, **analysed})
    if handled and not segments.breaks:
        yield Found("handled", {"seconds": _seconds(handled), "left_out": _listed(handled), **analysed})
    for span in segments.left_out:
        if span.kind is SpanKind.WAITING:
            yield Found("at_rest", {"seconds": span.last_s - span.first_s, "trigger_s": span.last_s})
    if still:
        ends = {"first_s": still[0].first_s, "last_s": still[0].last_s}
        all_of_them = _listed(still) if len(still) > 1 else None
        yield Found("at_rest", {"seconds": _seconds(still), **ends, "left_out": all_of_them})


def _seconds(spans: Sequence[Span]) -> float:
    return sum(span.last_s - span.first_s for span in spans)


def _listed(spans: Sequence[Span]) -> str:
    return ", ".join(f"{span.first_s:.2f} to {span.last_s:.2f} s" for span in spans)
