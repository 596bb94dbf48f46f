"""The progress of a recording in a line."""

from __future__ import annotations

from pipeline.streaming import LiveMotion
from springmass.session.console import Console
from springmass.session.progress import Progress

__all__ = ["ProgressLine", "line_of"]

# Off a terminal one line of so many is printed: working out the motion for each is a tenth of what recording costs.
UNWATCHED_LINES = 30
PATIENCE_S = 0.2  # a progress line that nobody reads is left out
SILENT_S = 3.0  # of a sensor, said in the progress line


class ProgressLine:
    """The progress line on stderr: rewritten in place on a terminal; elsewhere after 1, 10, 40, 70 s and so on."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._terminal = console.terminal
        self._shown = 0

    def __call__(self, progress: Progress) -> None:
        """Show where the recording stands."""
        self._shown += 1
        if self._terminal:
            self._console.write(f"\r\x1b[K{line_of(progress)}", PATIENCE_S)
        elif self._shown == 1 or self._shown % UNWATCHED_LINES == 10:
            self._console.write(f"{line_of(progress)}\n", PATIENCE_S)

    def end(self) -> None:
        """Leave the line standing."""
        if self._terminal and self._shown:
            self._console.write("\n", PATIENCE_S)


def line_of(progress: Progress) -> str:
    """Return a progress line: time, period, amplitude, rate, drop-outs, what is safe on the disk."""
    state = "waiting for the bob" if progress.waiting else f"{progress.seconds:6.0f} s"
    found = progress.motion()
    motion = f"T {found.period}, A {found.amplitude}" if isinstance(found, LiveMotion) else found.why
    parts = [state, motion, f"{progress.rate_hz:.0f} Hz", f"{progress.missing} missing, {progress.gaps} gaps"]
    parts += progress.gone
    if not progress.gone and progress.silent_s > SILENT_S:
        parts.append(f"no reading for {progress.silent_s:.0f} s")
    if progress.unshown:
        parts.append(f"{progress.unshown} samples recorded and not shown")
    if progress.status is not None:
        parts.append(f"{progress.status.synced_bytes / 1e3:.0f} kB safe")
        if progress.disk_free_bytes is not None:
            parts.append(f"{progress.disk_free_bytes / 1e9:.1f} GB left")
        parts += [told for told in (progress.status.astray, progress.status.error) if told]
    return " | ".join(parts)
