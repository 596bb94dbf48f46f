"""A template for a new family of rangefinders: copy it and change the marked lines.

1. Copy this file to ``acquisition/decoders/NAME.py``. In its docstring, describe a frame, with one real frame and its
   value, the codes for no target, and the data sheet.
2. Choose how to find frames: :class:`acquisition.decoders.lines.LineSplitter` cuts lines, and
   :class:`acquisition.decoders.sum_frames.SumFrames` cuts frames of a fixed size with a sum at the end. For both, the
   boundaries of reads do not affect the frames. Both count faults, and keep a bounded number of bytes.
3. Check frames as strictly as the data sheet allows: number of digits, range, checksum. Turn a code for "no target"
   into NaN. Never interpret a number as a distance if it is not one.
4. Write ``reading``, which interprets a frame; :class:`acquisition.decoders.framed.FramedDecoder` does the rest. Pass
   echo times on as echo times.
5. Write the encoder from the data sheet and not from the decoder, so that each checks the other.
6. Add one line to ``_TABLE`` of ``acquisition/decoders/registry.py``, or, in a separate package, an entry point in the
   group ``springmass.sensors``.
7. Add one ``Case`` to ``tests/conformance/test_decoders.py``.

The device of this template is fictitious. It sends ``:dddd,cc`` and a line feed: the distance in mm with leading zeros,
and, in hexadecimal, the sum of the ASCII codes of its four digits. ``:0253,CA`` is 253 mm; 0 means no target.
"""

from __future__ import annotations

import math
import re

from acquisition.decoders.family import Family
from acquisition.decoders.framed import FramedDecoder
from acquisition.decoders.lines import LineSplitter
from acquisition.readings import NAN, Reading

__all__ = ["FAMILY", "ExampleDecoder", "ExampleEncoder"]

_LONGEST = 32  # change: longer than any line of the device
_FORM = re.compile(rb":([0-9]{4}),([0-9A-F]{2})\r?")  # change


class ExampleDecoder(FramedDecoder):
    """Decodes the lines of the example."""

    def __init__(self) -> None:
        super().__init__(LineSplitter(b"\n", _LONGEST, {"garbage_bytes": 0, "bad_frame": 0, "bad_checksum": 0}))

    def reading(self, host_ns: int, frame: bytes) -> Reading | None:
        """Return the reading of a line, or None; count the fault of an invalid line."""
        match = _FORM.fullmatch(frame)
        if match is not None and sum(match[1]) & 0xFF == int(match[2], 16):
            return Reading(host_ns, distance_m=int(match[1]) / 1000 or NAN)
        self._count("bad_frame" if match is None else "bad_checksum", len(frame) + 1)
        return None


class ExampleEncoder:
    """Encodes distances as the lines of the example."""

    def encode(self, *, distance_m: float, **_: float) -> bytes:
        """Return one line, which contains only the distance."""
        mm = 0 if math.isnan(distance_m) else round(distance_m * 1000)
        digits = b"%04d" % (mm if 0 <= mm <= 9999 else 0)
        return b":%s,%02X\n" % (digits, sum(digits) & 0xFF)


FAMILY = Family(
    name="example",  # change: all of it
    title="an invented device that shows how a family is written",
    baud=9600,
    rate_hz=10.0,
    resolution_m=1e-3,
    range_m=(0.02, 4.0),
    limits="It does not exist.",
    decoder=ExampleDecoder,
    encoder=ExampleEncoder,
    source="this file",
)
