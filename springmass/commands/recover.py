"""``springmass recover``: build a run file from any wire log, however damaged."""

import shlex
from pathlib import Path
from typing import Annotated

from springmass.commands.options import DecoderOptions, FileArgument, Overwrite
from springmass.commands.parameters import SpeedOfSound, argument, output
from springmass.commands.parameters import option as declared
from springmass.errors import HINT, LOG, OK
from springmass.loading.save import made_now
from springmass.stops import STOPS
from storage.recovery.recover import recover as build


def recover(
    log: Annotated[FileArgument, argument("RUN.wire", "wire log")],
    /,
    *,
    output: Annotated[FileArgument | None, output("RUN.h5", "run file to create (default: next to the log)")] = None,
    overwrite: Overwrite = False,
    speed_of_sound: Annotated[
        SpeedOfSound | None, declared("C", "speed of sound for converting echo times, m/s (default: the log's)")
    ] = None,
    option: DecoderOptions = (),
) -> int:
    """Rebuild the run; the log stays."""
    out = None if output is None else Path(output)
    with STOPS.leaving(lambda: f"stopped immediately; the log stays: {log}"):
        report = build(
            log,
            out,
            overwrite=overwrite,
            speed_of_sound_m_per_s=speed_of_sound,
            options=dict(option),
            provenance=made_now(),
        )
    for line in report.describe():
        LOG.info(line)
    LOG.log(HINT, f"springmass analyse {shlex.quote(str(report.main.path))}")
    return OK
