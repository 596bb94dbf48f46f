"""DFRobot SEN0149, SEN0150 (URM06, RS-485, UART): polled, frames ``55 AA address length command H L SUM``.

Command 2 requests the distance in mm: the reply ``55 AA 11 02 02 12 34 5A`` is 4660 mm. Command 3 requests the
temperature in 0.1 degC, in two's complement. In either reply, FF FF means out of range.
"""

from __future__ import annotations

import math
from functools import partial

from acquisition.decoders.cycle import OPTIONS
from acquisition.decoders.family import Family, Poll
from acquisition.decoders.replies import ReplyDecoder, ReplyForm
from acquisition.decoders.sum_frames import with_sum
from acquisition.readings import NAN

__all__ = ["FAMILY"]

_HEAD = bytes([0x55, 0xAA, 0x11])
_DISTANCE, _TEMPERATURE = 0x02, 0x03
_INVALID = 0xFFFF
_FARTHEST_MM = 12_000


def _plausible(frame: bytes) -> bool:
    """Return whether a frame can be a reply of the sensor, whose address may have any value."""
    value = frame[5] << 8 | frame[6]
    if frame[1] != 0xAA or frame[3] != 2:
        return False
    return frame[4] == _TEMPERATURE or (frame[4] == _DISTANCE and (value <= _FARTHEST_MM or value == _INVALID))


def _metres(value: int) -> float:
    return NAN if value in (0, _INVALID) else value / 1000


def _celsius(value: int) -> float:
    return NAN if value == _INVALID else (value - 0x10000 if value & 0x8000 else value) / 10


def _distance_code(distance_m: float) -> int:
    mm = 0 if math.isnan(distance_m) else round(distance_m * 1000)
    return mm if 0 < mm <= _FARTHEST_MM else _INVALID


def _temperature_code(temperature_c: float) -> int:
    return _INVALID if math.isnan(temperature_c) else round(temperature_c * 10) & 0xFFFF


_FORM = ReplyForm(
    distance_head=_HEAD + bytes([2, _DISTANCE]),
    temperature_head=_HEAD + bytes([2, _TEMPERATURE]),
    ask_distance=with_sum(_HEAD + bytes([0, _DISTANCE])),
    ask_temperature=with_sum(_HEAD + bytes([0, _TEMPERATURE])),
    plausible=_plausible,
    metres=_metres,
    celsius=_celsius,
    distance_code=_distance_code,
    temperature_code=_temperature_code,
)

FAMILY = Family(
    name="sen0149",
    title="SEN0149, SEN0150 (URM06) frames 55 AA address length command H L SUM",
    baud=19200,
    rate_hz=10.0,
    resolution_m=1e-3,
    range_m=(0.2, 10.0),
    limits="Nothing nearer than 20 cm, and one request at a time on the bus.",
    decoder=partial(ReplyDecoder, _FORM),
    encoder=_FORM.encoder,
    poll=Poll(request=_FORM.ask_distance, interval_s=0.1, timeout_s=0.25),
    options=OPTIONS,
    source="DFRobot SEN0149, SEN0150: communication protocol",
)
