"""Findings on parts: which seconds of a recording were analysed, and which were left out."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from pipeline.findings.finding import Finding
from pipeline.windows.segments import Break, BreakKind, Segments, Span, SpanKind

__all__ = ["part_findings"]

SHOWN = 5  # maximum number of times listed in one text

_WHAT = {
    BreakKind.RESTARTED: "The bob was released again",
    BreakKind.TOUCHED: "The motion was disturbed",
    BreakKind.PHASE_JUMP: "The phase jumps",
}


def part_findings(segments: Segments | None) -> Iterator[Finding]:
    """Yield findings that state which parts were left out, and why.

    Parameters
    ----------
    segments : Segments or None
        None if the whole recording was analysed.
    """
    if segments is None:
        return
    part = _part(segments)
    others = _spans([span for span in segments.left_out if span.kind is SpanKind.FREE])
    for kind in dict.fromkeys(one.kind for one in segments.breaks):
        breaks = [one for one in segments.breaks if one.kind == kind]
        more = f" and {len(breaks) - 1} more times" if len(breaks) > 1 else ""
        yield Finding(
            kind.value,
            "warning",
            f"{_WHAT[kind]} at {breaks[0].time_s:.1f} s{more}; only {part} was analysed.",
            f"{_listed([_change(one) for one in breaks])}." + (f" The other parts are {others}." if others else ""),
            {"time_s": breaks[0].time_s, "amplitude_ratio": 1.0 + breaks[0].amplitude, "phase_rad": breaks[0].phase},
        )
    handled = [span for span in segments.left_out if span.kind is SpanKind.HANDLED]
    if handled and not segments.breaks:
        yield Finding(
            "handled",
            "warning",
            f"The bob does not move freely for {_seconds(handled):.1f} s; only {part} was analysed.",
            f"Left out: {_spans(handled)}. Amplitude, phase and damping rate are those at the start of the analysed "
            "part.",
            {"seconds": _seconds(handled)},
        )
    for span in segments.left_out:
        if span.kind is SpanKind.WAITING:
            yield Finding(
                "at_rest",
                "info",
                f"The bob hangs still until the trigger at {span.last_s:.2f} s; that was left out.",
                values={"seconds": span.last_s - span.first_s},
            )
    if still := [span for span in segments.left_out if span.kind is SpanKind.AT_REST]:
        yield Finding(
            "at_rest",
            "info",
            f"The bob hangs still from {still[0].first_s:.2f} to {still[0].last_s:.2f} s; that was left out.",
            f"Left out: {_spans(still)}." if len(still) > 1 else "",
            {"seconds": _seconds(still)},
        )


def _change(one: Break) -> str:
    times = f"amplitude {1.0 + one.amplitude:.3g} times" if one.amplitude > 1.0 else f"amplitude {one.amplitude:+.0%}"
    return f"at {one.time_s:.1f} s: {times}, phase {one.phase:+.2g} rad"


def _seconds(spans: Sequence[Span]) -> float:
    return sum(span.last_s - span.first_s for span in spans)


def _part(segments: Segments) -> str:
    if segments.first_s > 0.0 and segments.last_s < math.inf:
        return f"the part from {segments.first_s:.2f} to {segments.last_s:.2f} s"
    if segments.first_s > 0.0:
        return f"the part from {segments.first_s:.2f} s on"
    return f"the part until {segments.last_s:.2f} s" if segments.last_s < math.inf else "the rest"


def _spans(spans: Sequence[Span]) -> str:
    return _listed([f"{span.first_s:.2f} to {span.last_s:.2f} s" for span in spans])


def _listed(words: list[str]) -> str:
    more = f" and {len(words) - SHOWN} more" if len(words) > SHOWN else ""
    return ", ".join(words[:SHOWN]) + more
