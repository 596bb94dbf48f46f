"""Findings on parts: which seconds of a recording were analysed, and which were left out."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from pipeline.registry.found import Found
from pipeline.windows.segments import Segments, Span, SpanKind

SHOWN = 5  # maximum number of times listed in one text


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
    more = f" and {len(spans) - SHOWN} more" if len(spans) > SHOWN else ""
    return ", ".join(f"{span.first_s:.2f} to {span.last_s:.2f} s" for span in spans[:SHOWN]) + more
