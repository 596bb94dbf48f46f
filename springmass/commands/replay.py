"""``springmass replay``: a recording through the interface of a live sensor."""

from __future__ import annotations

import math
import shlex
import sys
from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, Any

import numpy as np
from cyclopts import Parameter, Token

from acquisition.clock import Clock, SystemClock, VirtualClock
from acquisition.replay import Replay
from springmass.commands.options import PART, File, Overwrite, PageOptions, Recording, flag, option, output, refuse
from springmass.errors import OK, ProgramError, suggest, tell
from springmass.runs.loading import load
from springmass.runs.options import ReadOptions
from springmass.runs.outputs import save_run
from springmass.values import Finite


def _speed(_: Any, tokens: Sequence[Token]) -> float:
    text = tokens[0].value
    try:
        speed = float("inf") if text == "max" else float(text)
    except ValueError:
        speed = 0.0
    if not speed > 0.0 or (text != "max" and speed == float("inf")):
        raise ValueError("must be positive, or max")
    return speed


def replay(
    recording: Recording,
    /,
    *,
    page: Annotated[bool, flag("play it on a page in the browser instead")] = False,
    speed: Annotated[
        float, Parameter(metavar="X", help="speed, in multiples of real time, or max (default: 1)", converter=_speed)
    ] = 1.0,
    seek: Annotated[Finite | None, option("S", "start at this second of the recording")] = None,
    loop: Annotated[bool, flag("start again at the end, until Ctrl-C")] = False,
    output: Annotated[
        File | None, output("RUN.h5", "write the samples to a run file instead of standard output")
    ] = None,
    overwrite: Overwrite = False,
    of_page: PageOptions = PageOptions(),
    read: ReadOptions = ReadOptions(),
) -> int:
    """Play the input to stdout, one line per sample, or into a run file."""
    refuse("replay", read, *PART)
    if loop and output is not None:
        raise ProgramError("--loop never ends and a run file is written whole at the end; leave one of them out")
    if page:
        from springmass.commands.page import page as show

        return show(recording, page=of_page, read=read)
    loaded = load(recording, read)
    fast = math.isinf(speed)
    clock: Clock = VirtualClock() if fast else SystemClock()
    source = Replay(loaded.samples_in_blocks(), clock, info=loaded.info, speed=None if fast else speed, loop=loop)
    with source:
        if seek is not None:
            source.seek(seek)
        if output is not None:
            path = save_run(output, replace(loaded, info=source.info), blocks=source, overwrite=overwrite)
            tell(f"{path}: replayed from {loaded.path}")
            suggest(f"springmass analyse {shlex.quote(str(path))}")
            return OK
        samples = loaded.samples
        print("time_s", "distance_m" if samples.quantity == "length" else samples.quantity, "flags", sep="\t")
        for block in source:
            for t, distance, flags in zip(block.t, block.distance, block.flags, strict=True):
                shown = "NaN" if np.isnan(distance) else f"{distance:.6f}"
                print(f"{t:.6f}\t{shown}\t{flags}")
            sys.stdout.flush()
    return OK
