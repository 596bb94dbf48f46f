"""Encoders of every family, written from the data sheets and not from the decoders, so that each checks the other."""

import binascii
import math
from collections.abc import Callable, Iterable
from typing import Any

from acquisition.decoders.decoder import Encoder
from acquisition.decoders.line_protocol import LineProtocolEncoder

LENGTHS_M = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254}
TIMES_US = {"us": 1.0, "ms": 1e3, "s": 1e6}


def with_sum(body: bytes) -> bytes:
    """Return bytes followed by the low eight bits of their sum."""
    return body + bytes([sum(body) & 0xFF])


def crc16(data: bytes) -> int:
    """Return the CRC-16/CCITT-FALSE bit by bit: polynomial 1021, begun with FFFF, nothing reflected."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte << 8
        for _ in range(8):
            crc = (crc << 1 ^ 0x1021 if crc & 0x8000 else crc << 1) & 0xFFFF
    return crc


def sealed(body: str) -> bytes:
    """Return a line of the line protocol, as docs/reference/line-protocol.md has it."""
    return f"${body}*{binascii.crc_hqx(body.encode(), 0xFFFF):04X}\n".encode()


class Distances:
    """Writes distances alone, by a function of metres that may be NaN."""

    def __init__(self, frame_of: Callable[[float], bytes]) -> None:
        self._frame_of = frame_of

    def encode(self, *, distance_m: float, **_: float) -> bytes:
        """Return one frame."""
        return self._frame_of(distance_m)


def steps(distance_m: float, step_m: float, lowest: int, highest: int, none: int) -> int:
    """Return a distance in whole steps, or the code for none where it is NaN or out of range."""
    count = none if math.isnan(distance_m) else round(distance_m / step_m)
    return count if lowest <= count <= highest else none


def lidar(count: int) -> bytes:
    """Return a frame of a TFmini with a strength of 1324 and 25 degC, low bytes first."""
    return with_sum(b"\x59\x59" + count.to_bytes(2, "little") + bytes.fromhex("2c05180a"))


def maxbotix(digits: int, step_m: float, none: int, tail: str = "") -> Callable[[], Encoder]:
    """Return a maker of ``R`` lines."""
    return lambda: Distances(lambda d: f"R{steps(d, step_m, 1, none - 1, none):0{digits}d}{tail}\r".encode())


def binary(header: bytes, step_m: float, lowest: int, highest: int, none: int) -> Callable[[], Encoder]:
    """Return a maker of frames of a header, two bytes and the low eight bits of the sum of all."""
    return lambda: Distances(lambda d: with_sum(header + steps(d, step_m, lowest, highest, none).to_bytes(2, "big")))


class TextLines:
    """Writes lines in which every column and name that the options ask for has its number."""

    def __init__(self, **options: Any) -> None:
        self._unit = options.get("unit", "cm")
        self._time_us = TIMES_US[options.get("time_unit", "us")]
        self._separator = options.get("separator") or ","
        places = {"column": 0, **options}
        self._places = {what: places[what] for what in ("column", "sequence", "time", "temperature") if what in places}

    def encode(
        self, *, sequence: int, device_us: int, echo_us: float, distance_m: float, temperature_c: float
    ) -> bytes:
        """Return one line; the value 0 means no target."""
        value = echo_us if self._unit == "us" else distance_m / LENGTHS_M[self._unit]
        numbers = {
            "column": "0" if math.isnan(distance_m) or math.isnan(value) else f"{value:.8g}",
            "sequence": f"{sequence}",
            "time": f"{device_us / self._time_us:.10g}",
            "temperature": f"{temperature_c:.2f}",
        }
        placed = {where: numbers[what] for what, where in self._places.items() if isinstance(where, int)}
        cells = [placed.get(index, "0") for index in range(max(placed, default=-1) + 1)]
        cells += [f"{where}={numbers[what]}" for what, where in self._places.items() if not isinstance(where, int)]
        return self._separator.join(cells).encode() + b"\r\n"


ENCODERS: dict[str, Callable[..., Encoder]] = {
    "line-protocol": LineProtocolEncoder,
    "maxbotix-lv": maxbotix(3, 0.0254, 255),
    "maxbotix-lv-p": maxbotix(3, 0.0254, 255, " P0"),
    "maxbotix-xl": maxbotix(3, 0.01, 765),
    "maxbotix-xl-long": maxbotix(4, 0.01, 1068),
    "maxbotix-hr": maxbotix(4, 0.001, 5000),
    "maxbotix-wr": maxbotix(4, 0.001, 9999),
    "ffhls": binary(b"\xff", 1e-3, 0, 10_000, 0),
    "us100": lambda: Distances(lambda d: steps(d, 1e-3, 20, 4500, 0).to_bytes(2, "big")),
    "urm37": binary(b"\x22", 1e-2, 1, 1000, 0xFFFF),
    "sen0149": binary(bytes([0x55, 0xAA, 0x11, 2, 2]), 1e-3, 1, 12_000, 0xFFFF),
    "tfmini": lambda unit="cm": Distances(lambda d: lidar(steps(d, LENGTHS_M[unit], 1, 12_000, 0))),
    "text-lines": TextLines,
}


def frames(family: str, distances_m: Iterable[float]) -> list[bytes]:
    """Return what a sensor sends of distances at 100 Hz, at 21 degrees and 343 m/s; NaN for no target."""
    encode = ENCODERS[family]().encode
    return [
        encode(sequence=i, device_us=10_000 * i, echo_us=d / 171.5e-6, distance_m=d, temperature_c=21.0)
        for i, d in enumerate(distances_m)
    ]
