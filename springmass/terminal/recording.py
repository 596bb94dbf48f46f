"""Show a recording on stderr: a few lines rewritten in place on a terminal, occasional lines elsewhere."""

from __future__ import annotations

from pipeline.streaming import LiveMotion, NotYet
from springmass.session.display.progress import Progress, Trouble, TroubleKind
from springmass.stops import EndReason
from springmass.terminal.console import Console
from springmass.terminal.quantities import concise
from springmass.terminal.style import PLAIN, TerminalStyle
from springmass.terminal.trace import trace_of

__all__ = ["END_WORDS", "ProgressLine", "line_of", "trust_in"]

# Without a terminal, one of this many lines is printed: the motion for each would add a tenth to the recording's cost.
UNWATCHED_LINES = 30
PATIENCE_S = 0.5  # output not written within this time has no reader, which is noted in the run
SILENT_S = 1.5  # silence of a sensor that the progress line reports
FIRST_MOTION_S = 1.5
SHOWN_PERIODS, SHOWN_S = 4.0, 4.0
KEYS = "space marks, Ctrl-C stops"
END_WORDS = {
    EndReason.SECONDS: "its time",
    EndReason.CTRL_C: "Ctrl-C",
    EndReason.SIGTERM: "SIGTERM",
    EndReason.HANGUP: "a closed terminal",
    EndReason.PAGE: "its page",
    EndReason.DISK: "the disk",
}
"""Words for the end of a recording, after "stopped by"."""


class ProgressLine:
    """Shows the progress on stderr: rewritten in place on a terminal, elsewhere after 1, 10, 40, 70 s and so on.

    Parameters
    ----------
    console : Console
    style : TerminalStyle
        Style of stderr; the current width is determined at every update.
    trace : bool
        Whether to draw the latest periods if the terminal supports Unicode.
    keys : bool
        Whether marks can be typed.
    """

    def __init__(
        self, console: Console, style: TerminalStyle = PLAIN, *, trace: bool = False, keys: bool = False
    ) -> None:
        self._console = console
        self._style = style
        self._trace = trace and style.unicode
        self._keys = keys
        self._shown = 0
        self._trouble: TroubleKind | None = None

    def __call__(self, progress: Progress) -> None:
        """Show the progress of the recording."""
        if progress.tick:
            self._shown += 1
        if self._style.terminal:
            self._console.draw(self._lines(progress))
            self._console.wait(PATIENCE_S)
            return
        trouble = progress.trouble
        if progress.tick and (self._shown == 1 or self._shown % UNWATCHED_LINES == 10):
            self._console.line(line_of(progress))
            self._console.wait(PATIENCE_S)
        elif trouble is not None and trouble.kind is not self._trouble:
            self._console.line(_worded(trouble))
        self._trouble = None if trouble is None else trouble.kind

    def end(self) -> None:
        """Leave the lines in place."""
        self._console.settle()

    def _lines(self, progress: Progress) -> list[str]:
        # The first analysis loads its libraries; troubles and keys are shown without waiting for this.
        found = progress.motion() if progress.seconds >= FIRST_MOTION_S else NotYet("listening")
        lines = [_head(progress, found, self._style, self._console.columns - 1)]
        if troubles := _troubles(progress):
            lines.append("; ".join(troubles))
        if self._trace:
            seconds = SHOWN_PERIODS * found.period.value if isinstance(found, LiveMotion) else SHOWN_S
            t, y = progress.latest()
            lines += trace_of(t, y, min(self._console.columns - 1, 100), min(seconds, 10.0))
        keys = KEYS if self._keys else "Ctrl-C stops"
        if progress.marks:
            at, text = progress.marks[-1]
            keys += f" | mark {len(progress.marks)} at {at:.1f} s: {text}"
        return [*lines, keys]


def trust_in(found: LiveMotion, missing_share: float) -> str:
    """Return how reliable the displayed motion is: good, fair or poor.

    Parameters
    ----------
    found : LiveMotion
    missing_share : float
        Fraction of missing values in the latest readings.

    Notes
    -----
    Good: the relative uncertainty is at most 1/1000 for the period and 1/50 for the amplitude, and at most 1/20 of the
    readings are missing. Fair: these uncertainties are at most ten times as large, and at most 1/3 of the readings are
    missing. Otherwise poor.
    """
    period, amplitude = found.period, found.amplitude
    off = max(period.u / period.value / 1e-3, amplitude.u / max(abs(amplitude.value), 1e-12) / 2e-2)
    if off <= 1.0 and missing_share <= 0.05:
        return "good"
    return "fair" if off <= 10.0 and missing_share <= 1 / 3 else "poor"


def _head(progress: Progress, found: LiveMotion | NotYet, style: TerminalStyle, width: int) -> str:
    """Return as many parts as fit: time, motion and its reliability, rate, missing values, bytes safe on disk."""
    parts = ["waiting for the bob" if progress.waiting else f"{progress.seconds:.0f} s"]
    if isinstance(found, LiveMotion):
        parts += [f"T {concise(found.period, style)}", f"A {concise(found.amplitude, style)}"]
        parts.append(f"trust {trust_in(found, progress.missing_share)}")
    else:
        parts.append(found.why)
    parts.append(f"{progress.rate_hz:.0f} Hz")
    parts.append(f"{progress.missing} missing" + (f", {progress.gaps} gaps" if progress.gaps else ""))
    if progress.status is not None:
        parts.append(f"{progress.status.synced_bytes / 1e3:.0f} kB safe")
        if progress.disk_free_bytes is not None:
            parts.append(f"{progress.disk_free_bytes / 1e9:.1f} GB left")
    while len(parts) > 2 and len(" | ".join(parts)) > width:
        parts.pop()
    return " | ".join(parts)


def _troubles(progress: Progress) -> list[str]:
    """Return the current troubles, with what to check."""
    parts = list(progress.gone)
    if not progress.gone and progress.silent_s > SILENT_S:
        parts.append(f"no reading for {progress.silent_s:.0f} s: check power, wiring and baud rate")
    elif progress.trouble is not None:
        parts.append(_worded(progress.trouble))
    if progress.unshown:
        parts.append(f"{progress.unshown} samples recorded and not shown")
    if progress.status is not None:
        parts += [progress.status.error] if progress.status.error else []
    return parts


def _worded(trouble: Trouble) -> str:
    return trouble.text if trouble.channel is None else f"sensor {trouble.channel}: {trouble.text}"


def line_of(progress: Progress) -> str:
    """Return a progress line: time, period, amplitude, rate, missing values, bytes safe on disk, troubles."""
    state = "waiting for the bob" if progress.waiting else f"{progress.seconds:6.0f} s"
    found = progress.motion()
    motion = f"T {found.period}, A {found.amplitude}" if isinstance(found, LiveMotion) else found.why
    parts = [state, motion, f"{progress.rate_hz:.0f} Hz", f"{progress.missing} missing, {progress.gaps} gaps"]
    if progress.status is not None:
        parts.append(f"{progress.status.synced_bytes / 1e3:.0f} kB safe")
        if progress.disk_free_bytes is not None:
            parts.append(f"{progress.disk_free_bytes / 1e9:.1f} GB left")
    return " | ".join([*parts, *_troubles(progress)])
