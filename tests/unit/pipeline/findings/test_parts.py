"""Findings on parts: what was left out, why, and for how long."""

from __future__ import annotations

import math

import pytest

from pipeline.findings.parts import part_findings
from pipeline.windows.segments import Break, BreakKind, Segments, Span, SpanKind


def broken(kind: str, time_s: float, amplitude: float, phase: float) -> Break:
    """Return a break."""
    return Break(kind=BreakKind(kind), time_s=time_s, u_s=0.1, amplitude=amplitude, phase=phase)


def test_a_whole_recording_has_no_finding() -> None:
    """Where nothing is left out there is nothing to report."""
    assert list(part_findings(None)) == []


@pytest.mark.parametrize("kind", ["restarted", "touched", "phase_jump"])
def test_breaks_of_one_kind_are_one_warning(kind: str) -> None:
    """The first break gives the numbers, however many follow, and the other parts are in the details."""
    breaks = tuple(broken(kind, 10.0 + k, -0.25, 0.5) for k in range(30))
    segments = Segments(40.0, 60.0, (Span(SpanKind.FREE, 0.0, 9.5),), breaks)
    (finding,) = part_findings(segments)
    assert (finding.code, finding.severity) == (kind, "warning")
    assert dict(finding.values) == {"time_s": 10.0, "amplitude_ratio": 0.75, "phase_rad": 0.5}
    assert "9.50 s" in finding.details
    assert len(finding.message) <= 110


def test_breaks_of_two_kinds_are_two_warnings() -> None:
    """A touch and a restart are reported each."""
    segments = Segments(0.0, 9.0, (), (broken("touched", 9.0, 0.1, 0.2), broken("restarted", 15.0, 3.0, 1.0)))
    assert [finding.code for finding in part_findings(segments)] == ["touched", "restarted"]


def test_a_hand_is_reported_with_its_seconds() -> None:
    """Both ends in a hand are one warning; beside a break they need none."""
    spans = (Span(SpanKind.HANDLED, 0.0, 3.0), Span(SpanKind.HANDLED, 20.0, 22.5))
    (finding,) = part_findings(Segments(3.0, 20.0, spans))
    assert (finding.code, finding.severity, dict(finding.values)) == ("handled", "warning", {"seconds": 5.5})
    codes = [f.code for f in part_findings(Segments(3.0, 9.0, spans, (broken("touched", 9.0, 0.1, 0.2),)))]
    assert codes == ["touched"]


@pytest.mark.parametrize("kind", ["waiting", "at_rest"])
def test_a_bob_at_rest_is_a_note_with_its_seconds(kind: str) -> None:
    """Before a trigger, or long after the stop."""
    (finding,) = part_findings(Segments(-math.inf, math.inf, (Span(SpanKind(kind), 1.0, 3.5),)))
    assert (finding.code, finding.severity, dict(finding.values)) == ("at_rest", "info", {"seconds": 2.5})
