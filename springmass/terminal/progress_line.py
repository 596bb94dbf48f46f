"""Show a recording on stderr: a few lines rewritten in place on a terminal, occasional lines elsewhere."""

from springmass.runs.rolling import NotYet
from springmass.session.live_state import Progress, TroubleKind
from springmass.terminal.console import Console
from springmass.terminal.style import TerminalStyle, concise, shown

# Without a terminal, one of this many lines is printed: the motion for each would add a tenth to the recording's cost.
UNWATCHED_LINES = 30
READER_WAIT_S = 0.5  # output not written within this time has no reader, which is noted in the run
FIRST_MOTION_S = 1.5
SILENT_S = 1.5  # silence of a sensor that the progress line reports


class ProgressLine:
    """Shows the progress on stderr: rewritten in place on a terminal, elsewhere after 1, 10, 40, 70 s and so on.

    With ``keys``, marks can be typed.
    """

    def __init__(self, console: Console, style: TerminalStyle, *, keys: bool) -> None:
        self._console, self._style = console, style
        self._help = "space marks, Ctrl-C stops" if keys else "Ctrl-C stops"
        self._turns = 0
        self._trouble: TroubleKind | None = None

    def __call__(self, progress: Progress) -> None:
        """Show the progress of the recording."""
        self._turns += progress.tick
        if self._style.terminal:
            self._console.draw(self._lines(progress))
            self._console.wait(READER_WAIT_S)
            return
        trouble = progress.trouble
        if progress.tick and (self._turns == 1 or self._turns % UNWATCHED_LINES == 10):
            self._console.line(" | ".join([*_parts(progress, self._style), *_troubles(progress)]))
            self._console.wait(READER_WAIT_S)
        elif trouble is not None and trouble.kind is not self._trouble:
            self._console.line(trouble.text)
        self._trouble = None if trouble is None else trouble.kind

    def _lines(self, progress: Progress) -> list[str]:
        """Return the progress as far as it fits, the troubles, the keys and the last mark."""
        parts = _parts(progress, self._style)
        while len(parts) > 2 and len(" | ".join(parts)) >= self._style.width:
            parts.pop()
        lines, keys = [" | ".join(parts)], self._help
        if troubles := _troubles(progress):
            lines.append("; ".join(troubles))
        if progress.marks:
            at, text = progress.marks[-1]
            keys += f" | mark {len(progress.marks)} at {at:.1f} s: {text}"
        return [*lines, keys]


def _parts(progress: Progress, style: TerminalStyle) -> list[str]:
    """Return time, motion, rate, missing values, gaps, and bytes safe on disk."""
    parts = ["waiting for the bob" if progress.status is None else f"{progress.seconds:.0f} s"]
    # On a terminal the first analysis, which loads its libraries, must not delay troubles and keys.
    listening = style.terminal and progress.seconds < FIRST_MOTION_S
    motion = NotYet("listening") if listening else progress.motion()
    if isinstance(motion, NotYet):
        parts.append(motion.why)
    elif motion.analysis.oscillation is not None:
        form, estimates = concise if style.terminal else shown, motion.analysis.estimates
        parts += [f"T {form(estimates['period'], style)}", f"A {form(estimates['amplitude'], style)}"]
    else:
        parts.append(motion.analysis.why)
    parts.append(f"{progress.rate_hz:.0f} Hz")
    parts.append(f"{progress.missing} missing" + (f", {progress.gaps} gaps" if progress.gaps else ""))
    if progress.status is not None:
        parts.append(f"{progress.status.synced_bytes / 1e3:.0f} kB safe")
        if progress.disk_free_bytes is not None:
            parts.append(f"{progress.disk_free_bytes / 1e9:.1f} GB left")
    return parts


def _troubles(progress: Progress) -> list[str]:
    """Return the current troubles, with what to check."""
    parts = list(progress.gone)
    if not progress.gone and progress.silent_s > SILENT_S:
        parts.append(f"no reading for {progress.silent_s:.0f} s: check power, wiring and baud rate")
    elif progress.trouble is not None:
        parts.append(progress.trouble.text)
    if progress.unshown:
        parts.append(f"{progress.unshown} samples recorded and not shown")
    if progress.status is not None and progress.status.error:
        parts.append(progress.status.error)
    return parts
