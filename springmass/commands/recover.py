"""``springmass recover``: build a run file from any wire log, however damaged."""

from __future__ import annotations

import shlex
from pathlib import Path

from acquisition.errors import CalibrationError
from springmass.errors import OK, USAGE, ProgramError, suggest, tell
from springmass.options import RecoverOptions
from springmass.runs.analysing import made_now
from springmass.stops import STOPS
from storage.recovery.recover import recover

__all__ = ["run"]


def run(log: str | Path, options: RecoverOptions) -> int:
    """Rebuild the run; the log stays."""
    STOPS.last_words = lambda: f"stopped immediately; the log stays: {log}"
    try:
        report = recover(
            log,
            None if options.output is None else Path(options.output),
            overwrite=options.overwrite,
            speed_of_sound_m_per_s=options.speed_of_sound,
            provenance=made_now(),
        )
    except CalibrationError as error:
        raise ProgramError(str(error), USAGE) from error
    for line in report.describe():
        tell(line)
    suggest(f"springmass analyse {shlex.quote(str(report.main.path))}")
    return OK
