"""Sensors whose frames end in the sum of their bytes: waterproof FF H L SUM modules, and DFRobot's URM37 and SEN0149.

- FF H L SUM is sent without requests by modules of many names (A02YYUW, ME007YS, A01NYUB, DYP-A01/A02/ME007, JSN-SR04T
  in serial mode): ``FF 07 A1 A7`` is 1953 mm. The value 0 means no target, as do the codes FFFD (no target in range)
  and FFFE (disturbed by another sensor) of the newer DYP modules. The sum of some JSN-SR04T and AJ-SR04M leaves FF out.
- URM37 (SEN0001) is polled: the request ``22 00 00 22`` returns the distance in cm, ``22 H L SUM``.
- SEN0149 and SEN0150 (URM06, RS-485, UART) are polled with frames ``55 AA address length command H L SUM``: the reply
  ``55 AA 11 02 02 12 34 5A`` is 4660 mm.

The last two send FF FF for an invalid value. Logs of 0.2.0 may contain their replies to requests of the temperature
(11 and 03 instead of 22 and 02), which are skipped.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

from acquisition.decoders.frames import FramedDecoder, SumFrames, with_sum
from acquisition.decoders.sensor import Poll, Sensor
from acquisition.readings import NAN, Reading


class FrameForm(NamedTuple):
    """The frames of a family: size, first bytes, unit of the value before the sum, its largest one, and no target.

    The byte at index ``command`` is ``distance`` in a frame with a distance, ``temperature`` in one to be skipped; the
    upper four bits of a temperature are one of ``signs``. Other bytes are ``fixed``.
    """

    size: int
    starts: bytes
    unit_m: float
    farthest: int
    no_target: tuple[int, ...]
    command: int = 0
    distance: int = 0xFF
    temperature: int = -1
    signs: Sequence[int] = range(16)
    fixed: tuple[tuple[int, int], ...] = ()
    unsummed: tuple[int, ...] = (0,)


class SummedDecoder(FramedDecoder):
    """Decodes the frames of one form."""

    def __init__(self, form: FrameForm, temperature_every: int = 0) -> None:
        self._form = form
        super().__init__(SumFrames(form.size, form.starts, self._plausible, form.unsummed))

    def _plausible(self, frame: bytes) -> bool:
        form, value = self._form, frame[-3] << 8 | frame[-2]
        if any(frame[at] != byte for at, byte in form.fixed):
            return False
        if frame[form.command] == form.temperature:
            return value >> 12 in form.signs
        return frame[form.command] == form.distance and (value <= form.farthest or value in form.no_target)

    def reading(self, host_ns: int, frame: bytes) -> Reading | None:
        """Return the reading of a distance; a transducer cannot measure a distance of 0, so 0 means no target."""
        form, value = self._form, frame[-3] << 8 | frame[-2]
        if frame[form.command] == form.temperature:
            return None
        return Reading(host_ns, distance_m=NAN if value in (0, *form.no_target) else value / round(1 / form.unit_m))


# The largest value is beyond the range of every module, but its high byte is none that begins a frame.
_FFHLS = FrameForm(4, b"\xff", 1e-3, 10_000, (0xFFFD, 0xFFFE), unsummed=(0, 1))
# A temperature has twelve bits, and its upper four are all 1 below zero.
_URM37 = FrameForm(4, b"\x22\x11", 1e-2, 1000, (0xFFFF,), distance=0x22, temperature=0x11, signs=(0x0, 0xF))
# The address, the third byte, may have any value.
_SEN0149 = FrameForm(8, b"\x55", 1e-3, 12_000, (0xFFFF,), 4, distance=0x02, temperature=0x03, fixed=((1, 0xAA), (3, 2)))

FAMILIES = {
    family.name: family
    for family in (
        Sensor(
            name="ffhls",
            title="FF-H-L-SUM frames (A02YYUW, ME007YS, A01NYUB, DYP modules, JSN-SR04T, AJ-SR04M in serial mode)",
            baud=9600,
            rate_hz=10.0,
            resolution_m=_FFHLS.unit_m,
            range_m=(0.03, 4.5),
            limits="10 Hz at most, and only with the module's pin set to real-time output: "
            "the processed output is averaged.",
            decoder=partial(SummedDecoder, _FFHLS),
            source="DFRobot SEN0311 (A02YYUW), SEN0312 (ME007YS), SEN0313 (A01NYUB): UART output; DYP-A22 data sheet",
        ),
        Sensor(
            name="urm37",
            title="URM37 (SEN0001) replies of command, two bytes, sum",
            baud=9600,
            rate_hz=10.0,
            resolution_m=_URM37.unit_m,
            range_m=(0.02, 8.0),
            limits="Steps of 1 cm and 10 Hz: enough to see an oscillation of 10 cm, not to measure its damping.",
            decoder=partial(SummedDecoder, _URM37),
            poll=Poll(request=b"\x22\0\0\x22", interval_s=0.1, timeout_s=0.25, reply_bytes=4),
            past_options=("temperature_every",),
            source="DFRobot SEN0001 (URM37): communication protocol",
        ),
        Sensor(
            name="sen0149",
            title="SEN0149, SEN0150 (URM06) frames 55 AA address length command H L SUM",
            baud=19200,
            rate_hz=10.0,
            resolution_m=_SEN0149.unit_m,
            range_m=(0.2, 10.0),
            limits="Nothing nearer than 20 cm, and one request at a time on the bus.",
            decoder=partial(SummedDecoder, _SEN0149),
            poll=Poll(request=with_sum(b"\x55\xaa\x11\0\x02"), interval_s=0.1, timeout_s=0.25, reply_bytes=8),
            past_options=("temperature_every",),
            source="DFRobot SEN0149, SEN0150: communication protocol",
        ),
    )
}
