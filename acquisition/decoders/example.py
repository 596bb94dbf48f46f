"""A template: copy it, and change what is marked. The recipe for a new family of rangefinders.

1. Copy this file to ``acquisition/decoders/NAME.py``. Say in the docstring what a frame looks like, with one real
   frame and its value, the no-target codes, and the data sheet.
2. Frames: lines come from :class:`acquisition.decoders.lines.LineSplitter`, frames of one size with a sum at the end
   from :class:`acquisition.decoders.sum_frames.SumFrames`. Both give the same frames however the stream is cut,
   count what is none, and hold a bounded number of bytes.
3. What a frame must be is written as strictly as the data sheet allows: fixed digits, range, checksum. A code for
   "no target" is NaN; a number that is no distance never passes for one.
4. ``reading`` says what a frame means; all else is :class:`acquisition.decoders.framed.FramedDecoder`'s. Echo times go
   in as echo times.
5. The encoder is written from the data sheet and not from the decoder, so that one checks the other.
6. One line in ``_TABLE`` of ``acquisition/decoders/registry.py``, or, in a package of your own, an entry point in the
   group ``springmass.sensors``.
7. One ``Case`` in ``tests/conformance/test_decoders.py``.

The device of this template is invented. It sends ``:dddd,cc`` and a line feed: mm with leading zeros, and the sum of
the four digits' codes in hex. ``:0253,CA`` is 253 mm; 0 says no target.
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
    """Decodes the example's lines."""

    def __init__(self) -> None:
        super().__init__(LineSplitter(b"\n", _LONGEST, {"garbage_bytes": 0, "bad_frame": 0, "bad_checksum": 0}))

    def reading(self, host_ns: int, frame: bytes) -> Reading | None:
        """Return a line's distance, or count why it has none."""
        found = _FORM.fullmatch(frame)
        if found is not None and sum(found[1]) & 0xFF == int(found[2], 16):
            return Reading(host_ns, distance_m=int(found[1]) / 1000 or NAN)
        self._count("bad_frame" if found is None else "bad_checksum", len(frame) + 1)
        return None


class ExampleEncoder:
    """Writes the example's lines."""

    def encode(self, *, distance_m: float, **_: float) -> bytes:
        """Return one line; it carries the distance alone."""
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
