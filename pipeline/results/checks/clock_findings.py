"""What the stamps of a record say against its clock, or of what it went through on its way to the host."""

from __future__ import annotations

from collections.abc import Iterator

from pipeline.bench.instrument import Instrument
from pipeline.results.checks.finding import Finding
from pipeline.track import Track

__all__ = ["judge_clock"]


def judge_clock(track: Track, instrument: Instrument) -> Iterator[Finding]:
    """Yield what is said of the sensor's clock and of readings that came late.

    Parameters
    ----------
    track : Track
    instrument : Instrument
        Of this track.
    """
    if instrument.clock_refused:
        yield Finding(
            "clock_refused",
            "warning",
            f"{instrument.clock_words}; where the clock is of another kind, say so with --clock-ppm",
        )
    if track.held_samples:
        yield Finding(
            "late_readings",
            "info",
            f"{track.held_samples} readings came up to {track.longest_stall_s:.3g} s late, at once behind a silence: "
            "the link stalled. Their times are the device's and stand; the clocks were compared by the other readings",
        )
