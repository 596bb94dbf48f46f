"""What a record holds beside the part that was analysed: at rest, in the hand, or another oscillation."""

from __future__ import annotations

from collections.abc import Iterator

from pipeline.numerics.quantity import noun
from pipeline.oscillation.condition import Conditioned
from pipeline.oscillation.rows import count_doubled, count_lost
from pipeline.oscillation.segments import Break, Segments, Span
from pipeline.results.checks.contact import Contact
from pipeline.results.checks.finding import Checked, Finding, Misfit

__all__ = ["judge_rows", "judge_segments"]

LEFT = 3.0  # times the neighbours' noise that a fit must leave for lost rows to be looked for

SHOWN = 5  # spans that are told by their times


def judge_segments(segments: Segments | None, contact: Contact | None = None) -> Iterator[Finding]:
    """Yield which seconds were left out, and why.

    Parameters
    ----------
    segments : Segments or None
        None: the whole record was analysed.
    contact : Contact, optional
        With what the bob came into contact: then that is why the motion breaks.
    """
    if segments is None:
        return
    others = [span for span in segments.left_out if span.kind == "free"]
    if contact is not None:
        yield contact.finding(_part(segments))
    for kind in dict.fromkeys(one.kind for one in segments.breaks if contact is None):
        breaks = [one for one in segments.breaks if one.kind == kind]
        times = _listed([f"at {one.time_s:.1f} s ({_words_on(one)})" for one in breaks])
        what = {
            "restarted": "the bob was stopped and released again",
            "touched": "amplitude and phase change at once, as by a touch",
            "phase_jump": "the phase jumps, as where rows are lost or a clock stood still",
        }[kind]
        yield Finding(
            kind,
            "warning",
            f"{what}, {times}: the longest part was analysed{_part(segments)}; the others are {_spans(others)}, "
            "for --from and --to",
        )
    handled = [span for span in segments.left_out if span.kind == "handled"]
    if handled and not segments.breaks:
        yield Finding(
            "handled",
            "warning",
            f"the bob does not move freely in {_spans(handled)}: left out; amplitude, phase and damping rate are those "
            f"at the start of what was analysed{_part(segments)}",
        )
    for span in segments.left_out:
        if span.kind == "waiting":
            yield Finding(
                "at_rest",
                "info",
                f"the bob hangs still until {span.last_s:.2f} s, the moment that triggered the recording: "
                f"{_spans([span])} is left out",
            )
    still = [span for span in segments.left_out if span.kind == "at_rest"]
    if still:
        yield Finding("at_rest", "info", f"nothing but noise moves in {_spans(still)}: left out")


def judge_rows(conditioned: Conditioned, rms_m: float) -> Checked:
    """Return whether rows were lost or doubled all over the record while their times were counted on.

    Parameters
    ----------
    conditioned : Conditioned
    rms_m : float
        What the fit of the motion leaves, m.

    Notes
    -----
    All times are too short by the share of the rows that is gone, or too long by that of rows written twice: that is
    what they are uncertain by.
    """
    if doubled := count_doubled(conditioned):
        what = noun(conditioned.track.unit)
        return Checked(
            (
                Finding(
                    "rows_doubled",
                    "error",
                    f"about {doubled} rows repeat the {what} before them while the motion goes on, and times count "
                    "them as new: rows written twice, or a sensor asked more often than it measures; period, "
                    "frequency, spring constant and damping rate are wrong by as much as the times, which their "
                    "uncertainties hold",
                ),
            ),
            (Misfit(name="rows_doubled", clock=doubled / len(conditioned.track)),),
        )
    if rms_m <= LEFT * conditioned.noise_m or not (lost := count_lost(conditioned)):
        return Checked()
    return Checked(
        (
            Finding(
                "rows_lost",
                "error",
                f"about {lost} rows are missing where times go on as if there were none: the "
                f"{noun(conditioned.track.unit)} makes two steps at once there; period, frequency, spring constant and "
                "damping rate are wrong by as much as the times, which their uncertainties hold",
            ),
        ),
        (Misfit(name="rows_lost", clock=lost / len(conditioned.track)),),
    )


def _words_on(one: Break) -> str:
    return f"amplitude {one.amplitude:+.0%}, phase {one.phase:+.2g} rad"


def _part(segments: Segments) -> str:
    first = f" from {segments.first_s:.2f} s" if segments.first_s > 0.0 else ""
    last = f" to {segments.last_s:.2f} s" if segments.last_s < float("inf") else ""
    return f",{first}{last}" if first or last else ""


def _spans(spans: list[Span]) -> str:
    return _listed([f"{span.first_s:.2f} to {span.last_s:.2f} s" for span in spans])


def _listed(words: list[str]) -> str:
    more = f" and {len(words) - SHOWN} more" if len(words) > SHOWN else ""
    return ", ".join(words[:SHOWN]) + more
