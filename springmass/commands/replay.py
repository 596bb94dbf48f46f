"""``springmass replay``: a recording through the interface of a live sensor, on standard output."""

import math
import sys
from typing import Annotated

import numpy as np

from acquisition.clock import SystemClock, VirtualClock
from acquisition.replay import Replay
from springmass.commands.options import ReadPairs, RecordingArgument, converted
from springmass.commands.parameters import Finite, flag, option
from springmass.errors import OK
from springmass.loading.load import load


def _speed(text: str) -> float:
    try:
        speed = float("inf") if text == "max" else float(text)
    except ValueError:
        speed = 0.0
    if not speed > 0.0 or (text != "max" and speed == float("inf")):
        raise ValueError("must be positive, or max")
    return speed


def replay(
    recording: RecordingArgument,
    /,
    *,
    speed: Annotated[
        float, converted("X", "speed, in multiples of real time, or max (default: 1)", _speed, repeated=False)
    ] = 1.0,
    seek: Annotated[Finite | None, option("S", "start at this second of the recording")] = None,
    loop: Annotated[bool, flag("start again at the end, until Ctrl-C")] = False,
    reading: ReadPairs = ReadPairs(),
) -> int:
    """Play the input to stdout, one line per sample."""
    loaded = load(recording, reading.options)
    fast = math.isinf(speed)
    clock, pace = (VirtualClock(), None) if fast else (SystemClock(), speed)
    begin_s = -math.inf if seek is None else seek
    with Replay(loaded.samples, clock, info=loaded.info, speed=pace, from_s=begin_s, loop=loop) as source:
        samples = loaded.samples
        print("time_s", "distance_m" if samples.quantity == "length" else samples.quantity, "flags", sep="\t")
        for block in source:
            for t, distance, flags in zip(block.t, block.distance, block.flags, strict=True):
                shown = "NaN" if np.isnan(distance) else f"{distance:.6f}"
                print(f"{t:.6f}\t{shown}\t{flags}")
            sys.stdout.flush()
    return OK
