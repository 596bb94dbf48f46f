"""A template: copy it, and change what is marked. The recipe for a new family of rangefinders.

1. Copy this file to ``acquisition/decoders/NAME.py``. Say in the docstring what a frame looks like, with one real
   frame and its value, the no-target codes, and the data sheet.
2. Frames: lines come from :class:`acquisition.decoders.lines.LineSplitter`, frames of one size with a sum at the end
   from :class:`acquisition.decoders.sum_frames.SumFrames`. Both give the same frames however the stream is cut,
   count what is none, and hold a bounded number of bytes.
3. What a frame must be is written as strictly as the data sheet allows: fixed digits, range, checksum. A code for
   "no target" is NaN; a number that is no distance never passes for one.
4. :func:`acquisition.decoders.rows.rows` makes the readings. Echo times go in as echo times.
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
from collections.abc import Mapping
from types import MappingProxyType

from acquisition.decoders.family import Family
from acquisition.decoders.lines import LineSplitter
from acquisition.decoders.rows import NAN, rows
from acquisition.readings import Readings

__all__ = ["FAMILY", "ExampleDecoder", "ExampleEncoder"]

_LONGEST = 32  # change: longer than any line of the device
_FORM = re.compile(rb":([0-9]{4}),([0-9A-F]{2})\r?")  # change


class ExampleDecoder:
    """Decodes the example's lines."""

    def __init__(self) -> None:
        self._faults = {"garbage_bytes": 0, "bad_frame": 0, "bad_checksum": 0}
        self._lines = LineSplitter(b"\n", _LONGEST, self._faults)

    @property
    def faults(self) -> Mapping[str, int]:
        """Counts of what was no reading."""
        return MappingProxyType(self._faults)

    @property
    def pending(self) -> int:
        """Bytes held until the line they began is whole."""
        return self._lines.pending

    def feed(self, host_ns: int, data: bytes) -> Readings:
        """Return the distances whose lines these bytes end."""
        found = [mm for line in self._lines.split(data) if (mm := self._millimetres(line)) is not None]
        return rows(host_ns, distance_m=[mm / 1000 if mm else NAN for mm in found])

    def flush(self) -> None:
        """Forget a half-received line."""
        self._lines.flush()

    def _millimetres(self, line: bytes) -> int | None:
        """Return a line's number, or count why it has none."""
        found = _FORM.fullmatch(line)
        if found is not None and sum(found[1]) & 0xFF == int(found[2], 16):
            return int(found[1])
        self._faults["bad_frame" if found is None else "bad_checksum"] += 1
        self._faults["garbage_bytes"] += len(line) + 1
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
