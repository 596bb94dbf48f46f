r"""Small lidars of Benewake: TFmini, TFmini-S, TFmini Plus and TF-Luna, which send nine-byte frames without requests.

A frame is ``59 59``, distance, strength and temperature, each low byte first, and the sum of the eight bytes before it:
``59 59 1b 00 2c 05 18 0a ..`` is 27 cm. The output is in cm or, if it was set so, in mm. A strength below 100 or of
65535 means that the distance is not to be trusted, as do distances of 0 and of 65532 and more.
"""

from __future__ import annotations

from acquisition.decoders.frames import FramedDecoder, SumFrames
from acquisition.decoders.sensor import Sensor
from acquisition.errors import SensorError
from acquisition.readings import NAN, Reading

_UNITS_M = {"cm": 0.01, "mm": 0.001}
_WEAKEST, _OVEREXPOSED, _FIRST_CODE = 100, 0xFFFF, 65532


class LidarDecoder(FramedDecoder):
    """Decodes the frames; ``unit`` is that of the distances."""

    def __init__(self, unit: str = "cm") -> None:
        if unit not in _UNITS_M:
            raise SensorError(f"unit of tfmini must be one of {', '.join(_UNITS_M)}, got {unit!r}")
        super().__init__(SumFrames(9, b"\x59", lambda frame: frame[1] == 0x59))
        self._per_m = round(1.0 / _UNITS_M[unit])
        self.resolution_m = _UNITS_M[unit]

    def reading(self, host_ns: int, frame: bytes) -> Reading | None:
        """Return the reading of a frame."""
        value, strength = frame[2] | frame[3] << 8, frame[4] | frame[5] << 8
        known = _WEAKEST <= strength < _OVEREXPOSED and 0 < value < _FIRST_CODE
        return Reading(host_ns, distance_m=value / self._per_m if known else NAN)


FAMILY = Sensor(
    name="tfmini",
    title="Benewake lidars: TFmini, TFmini-S, TFmini Plus, TF-Luna (frames 59 59 ...)",
    baud=115200,
    rate_hz=100.0,
    resolution_m=_UNITS_M["cm"],
    range_m=(0.1, 12.0),
    limits="Steps of 1 cm, or of 1 mm if it is set so; errors of some cm that depend on the surface; no time is sent.",
    decoder=LidarDecoder,
    options={"unit": "of the distances: cm, or mm if the lidar is set so (default: cm)"},
    source="Benewake TFmini-S and TF-Luna manuals: serial port protocol",
)
