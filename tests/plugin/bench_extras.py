"""A package of one's own: a format, a sensor, a damping law and an integrator, by ``springmass.extend`` alone."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

import numpy as np

from springmass.extend import (
    Equation,
    Formula,
    FramedDecoder,
    Header,
    Heading,
    LineSplitter,
    OneStep,
    Reading,
    Sensor,
    acceleration,
    make_law,
    text_format,
)

TITLE = re.compile(r"Height log, (\d*[1-9]\d*) Hz")


def header(lines: Sequence[str]) -> Header | None:
    """Say what the title of a height log means."""
    title = TITLE.fullmatch(lines[0])
    if title is None:
        return None
    return Header(
        why=f'line 1 is the title "{lines[0]}"',
        lines=1,
        delimiter=";",
        headings=[Heading("n", role="ignored"), Heading("height", "mm")],
        formula=Formula(start_s=0.0, step_s=1 / float(title[1])),
        title=lines[0],
    )


HEIGHT_LOG = text_format("height-log", "height log: number;millimetres", header)


class MillimetreDecoder(FramedDecoder):
    """Decodes lines such as ``0253``, in mm."""

    def __init__(self) -> None:
        super().__init__(LineSplitter(b"\n", 32, {"garbage_bytes": 0, "bad_frame": 0}))

    def reading(self, host_ns: int, frame: bytes) -> Reading | None:
        """Return a line's distance, or count it."""
        if re.fullmatch(rb"[0-9]{4}", frame):
            return Reading(host_ns, distance_m=int(frame) / 1000 or math.nan)
        self._count("bad_frame", len(frame) + 1)
        return None


class MillimetreEncoder:
    """Writes such lines."""

    def encode(self, *, distance_m: float, **_: float) -> bytes:
        """Return one line; 0000 where there is no target."""
        return b"%04d\n" % (0 if math.isnan(distance_m) else min(round(distance_m * 1000), 9999))


PLAIN_MILLIMETRES = Sensor(
    name="plain-millimetres",
    title="a device of this laboratory that prints millimetres",
    baud=9600,
    rate_hz=50.0,
    resolution_m=1e-3,
    range_m=(0.02, 4.0),
    limits="It has no checksum.",
    decoder=MillimetreDecoder,
    encoder=MillimetreEncoder,
)


def falling(t, A0, d):
    """Return the amplitude under drag between linear and quadratic."""
    return A0 / (1 + d * np.sqrt(A0) * t / 2) ** 2


def first_guess(t, amplitude):
    """Return A0 and d by a straight line through the reciprocal roots."""
    slope, level = np.polyfit(t, 1 / np.sqrt(amplitude), 1)
    return level**-2, 2 * slope


THREE_HALVES = make_law("three-halves", falling, {"d": (-1 / 2, -1)}, first_guess)


def _midpoint(equation: Equation, h: float):
    a = acceleration(equation)

    def step(y, v):
        y_half, v_half = y + 0.5 * h * v, v + 0.5 * h * a(y, v)
        return y + h * v_half, v + h * a(y_half, v_half)

    return step


MIDPOINT = OneStep("midpoint", "the explicit midpoint method", 2, _midpoint)
