"""What a recording shows on stderr: on a terminal a few lines in place, elsewhere a line now and then."""

from __future__ import annotations

from pipeline.streaming import LiveMotion, NotYet
from springmass.session.console import Console
from springmass.session.display.progress import Progress
from springmass.terminal.look import PLAIN, Look
from springmass.terminal.quantities import concise
from springmass.terminal.trace import trace_of

__all__ = ["ProgressLine", "line_of", "trust_in"]

# Off a terminal one line of so many is printed: working out the motion for each is a tenth of what recording costs.
UNWATCHED_LINES = 30
PATIENCE_S = 0.2  # a progress line that nobody reads is left out
SILENT_S = 1.5  # of a sensor, said in the progress line
FIRST_MOTION_S = 1.5
SHOWN_PERIODS, SHOWN_S = 4.0, 4.0
KEYS = "space marks, Ctrl-C stops"


class ProgressLine:
    """The progress on stderr: rewritten in place on a terminal; elsewhere after 1, 10, 40, 70 s and so on.

    Parameters
    ----------
    console : Console
    look : Look
        Of stderr; its width is asked for anew at every turn.
    trace : bool
        Whether the latest periods are drawn, where the terminal has braille.
    keys : bool
        Whether somebody can type marks.
    """

    def __init__(self, console: Console, look: Look = PLAIN, *, trace: bool = False, keys: bool = False) -> None:
        self._console = console
        self._look = look
        self._trace = trace and look.unicode
        self._keys = keys
        self._shown = 0
        self._drawn = 0
        self._trouble = ""

    def __call__(self, progress: Progress) -> None:
        """Show where the recording stands."""
        if progress.tick:
            self._shown += 1
        if self._look.terminal:
            self._draw(self._lines(progress))
            return
        trouble = progress.trouble.partition(":")[0]
        if progress.tick and (self._shown == 1 or self._shown % UNWATCHED_LINES == 10):
            self._console.write(f"{line_of(progress)}\n", PATIENCE_S)
        elif trouble and trouble != self._trouble:
            self._console.write(f"{progress.trouble}\n", PATIENCE_S)
        self._trouble = trouble

    def end(self) -> None:
        """Leave the lines standing."""
        if self._drawn:
            self._console.write("\n", PATIENCE_S)

    def _draw(self, lines: list[str]) -> None:
        """Write lines over those of the turn before; none is as wide as the terminal, so that nothing scrolls."""
        width = self._console.columns
        up = f"\x1b[{self._drawn - 1}A" if self._drawn > 1 else ""
        told = "\r\n".join(f"{line[: width - 1]}\x1b[K" for line in lines)
        self._console.write(f"\r{up}{told}\x1b[J", PATIENCE_S)
        self._drawn = len(lines)

    def _lines(self, progress: Progress) -> list[str]:
        # The first analysis loads what it needs: troubles and keys do not wait for that.
        found = progress.motion() if progress.seconds >= FIRST_MOTION_S else NotYet("listening")
        lines = [_head(progress, found, self._look, self._console.columns - 1)]
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
    """Return how far what is shown can be trusted: good, fair or poor.

    Parameters
    ----------
    found : LiveMotion
    missing_share : float
        Of the readings of the last second.

    Notes
    -----
    Good: the period to a thousandth, the amplitude to a fiftieth, and at most a twentieth of the readings missing.
    Fair: ten times that for period and amplitude, and a third of the readings. Else poor.
    """
    period, amplitude = found.period, found.amplitude
    off = max(period.u / period.value / 1e-3, amplitude.u / max(abs(amplitude.value), 1e-12) / 2e-2)
    if off <= 1.0 and missing_share <= 0.05:
        return "good"
    return "fair" if off <= 10.0 and missing_share <= 1 / 3 else "poor"


def _head(progress: Progress, found: LiveMotion | NotYet, look: Look, width: int) -> str:
    """As much as fits of: time, motion and trust in it, rate, what is missing, what is safe on the disk."""
    parts = ["waiting for the bob" if progress.waiting else f"{progress.seconds:.0f} s"]
    if isinstance(found, LiveMotion):
        parts += [f"T {concise(found.period, look)}", f"A {concise(found.amplitude, look)}"]
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
    """What is wrong at this moment, what to check with it."""
    parts = list(progress.gone)
    if not progress.gone and progress.silent_s > SILENT_S:
        parts.append(f"no reading for {progress.silent_s:.0f} s: check power, wiring and baud rate")
    elif progress.trouble:
        parts.append(progress.trouble)
    if progress.unshown:
        parts.append(f"{progress.unshown} samples recorded and not shown")
    if progress.status is not None:
        parts += [told for told in (progress.status.astray, progress.status.error) if told]
    return parts


def line_of(progress: Progress) -> str:
    """Return a progress line: time, period, amplitude, rate, drop-outs, what is safe on the disk, what is wrong."""
    state = "waiting for the bob" if progress.waiting else f"{progress.seconds:6.0f} s"
    found = progress.motion()
    motion = f"T {found.period}, A {found.amplitude}" if isinstance(found, LiveMotion) else found.why
    parts = [state, motion, f"{progress.rate_hz:.0f} Hz", f"{progress.missing} missing, {progress.gaps} gaps"]
    if progress.status is not None:
        parts.append(f"{progress.status.synced_bytes / 1e3:.0f} kB safe")
        if progress.disk_free_bytes is not None:
            parts.append(f"{progress.disk_free_bytes / 1e9:.1f} GB left")
    return " | ".join([*parts, *_troubles(progress)])
