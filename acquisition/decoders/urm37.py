"""DFRobot URM37 (SEN0001): a polled sensor with frames of a command, two data bytes and a sum.

The request ``22 00 00 22`` returns the distance in cm (reply ``22 H L SUM``). The request ``11 00 00 11`` returns the
temperature in 0.1 degC (reply ``11 H L SUM``): twelve bits, with the upper four bits all 1 below zero. In both, the
value FF FF is invalid.
"""

from __future__ import annotations

import math
from functools import partial

from acquisition.decoders.cycle import OPTIONS
from acquisition.decoders.family import Family, Poll
from acquisition.decoders.replies import ReplyDecoder, ReplyForm
from acquisition.readings import NAN

__all__ = ["FAMILY"]

_DISTANCE, _TEMPERATURE = 0x22, 0x11
_INVALID = 0xFFFF
_FARTHEST_CM = 1000
_HOTTEST_DC = 1000  # 0.1 degC


def _plausible(frame: bytes) -> bool:
    value = frame[1] << 8 | frame[2]
    if value == _INVALID:
        return True
    return value <= _FARTHEST_CM if frame[0] == _DISTANCE else not math.isnan(_celsius(value))


def _metres(value: int) -> float:
    # The transducer cannot measure a distance of 0, so the value 0 means no target, like FF FF.
    return NAN if value in (0, _INVALID) else value / 100


def _celsius(value: int) -> float:
    """Return the temperature of a value, degC; NaN if it is invalid.

    Below zero, the value is in sign and magnitude as in the manual, or in two's complement as in some firmware. No
    value is valid in both forms: a possible temperature in one form is impossible in the other.
    """
    if value == _INVALID:
        return NAN
    if value >> 12 not in (0x0, 0xF):
        return NAN
    candidates = (-(value & 0x0FFF), value - 0x10000) if value & 0x8000 else (value,)
    return next((dc / 10 for dc in candidates if abs(dc) <= _HOTTEST_DC), NAN)


def _distance_code(distance_m: float) -> int:
    cm = 0 if math.isnan(distance_m) else round(distance_m * 100)
    return cm if 0 < cm <= _FARTHEST_CM else _INVALID


def _temperature_code(temperature_c: float) -> int:
    if math.isnan(temperature_c) or abs(temperature_c) * 10 > _HOTTEST_DC:
        return _INVALID
    dc = round(temperature_c * 10)
    return 0xF000 | -dc if dc < 0 else dc


_FORM = ReplyForm(
    distance_head=bytes([_DISTANCE]),
    temperature_head=bytes([_TEMPERATURE]),
    ask_distance=bytes([_DISTANCE, 0, 0, _DISTANCE]),
    ask_temperature=bytes([_TEMPERATURE, 0, 0, _TEMPERATURE]),
    plausible=_plausible,
    metres=_metres,
    celsius=_celsius,
    distance_code=_distance_code,
    temperature_code=_temperature_code,
)

FAMILY = Family(
    name="urm37",
    title="URM37 (SEN0001) replies of command, two bytes, sum",
    baud=9600,
    rate_hz=10.0,
    resolution_m=1e-2,
    range_m=(0.02, 8.0),
    limits="Steps of 1 cm and 10 Hz: enough to see an oscillation of 10 cm, not to measure its damping.",
    decoder=partial(ReplyDecoder, _FORM),
    encoder=_FORM.encoder,
    poll=Poll(request=_FORM.ask_distance, interval_s=0.1, timeout_s=0.25),
    options=OPTIONS,
    source="DFRobot SEN0001 (URM37): communication protocol",
)
