"""``springmass replay``: a recording through the interface of a live sensor."""

from __future__ import annotations

import math
import shlex
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from acquisition.clock import Clock, SystemClock, VirtualClock
from acquisition.replay import Replay
from springmass.commands.convert import write_loaded
from springmass.errors import OK, USAGE, ProgramError, suggest, tell
from springmass.options import PageOptions, ReplayOptions
from springmass.runs.loading import load
from springmass.runs.options import ReadOptions

__all__ = ["run"]


def run(recording: str | Path, options: ReplayOptions, page: PageOptions, read: ReadOptions) -> int:
    """Play the input to stdout, one line per sample, or into a run file."""
    if options.loop and options.output is not None:
        raise ProgramError("--loop never ends and a run file is written whole at the end; leave one of them out", USAGE)
    if options.page:
        from springmass.commands.page import run as show

        return show(recording, page, read)
    loaded = load(recording, read)
    fast = math.isinf(options.speed)
    clock: Clock = VirtualClock() if fast else SystemClock()
    source = Replay(
        loaded.samples_in_blocks(),
        clock,
        info=loaded.info,
        speed=None if fast else options.speed,
        loop=options.loop,
    )
    with source:
        if options.seek is not None:
            source.seek(options.seek)
        if options.output is not None:
            path = write_loaded(
                Path(options.output), replace(loaded, info=source.info), source, overwrite=options.overwrite
            )
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
