"""MaxBotix ASCII lines, sent without requests: ``R``, a fixed number of digits and a carriage return.

The digits are inches, centimetres or millimetres, depending on the model. The bytes do not show the unit, so the name
of the family selects it. Before the carriage return, LV models may add ``Pn`` (proximity) and HRUSB models a space. The
signal has RS-232 polarity at levels of 0 to Vcc, so a TTL adapter without an inverter reads noise.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from functools import partial

from acquisition.decoders.family import Family
from acquisition.decoders.framed import FramedDecoder
from acquisition.decoders.lines import LineSplitter
from acquisition.readings import NAN, Reading

__all__ = ["FAMILIES", "MaxbotixDecoder", "MaxbotixEncoder", "Variant"]

_LONGEST = 64  # bytes; the lines of the start-up banner are shorter, and are counted as faults like any other text


@dataclass(frozen=True, slots=True)
class Variant:
    """How a series of models writes a distance.

    Parameters
    ----------
    digits : int
        Number of digits, including leading zeros, so that a lost digit is detected.
    unit_m : float
        Value of the last digit, m.
    no_target : tuple of int
        Numbers that mean no target, in addition to 0; the encoder writes the last of them.
    tail : str
        Text that the encoder writes between the digits and the carriage return.
    """

    digits: int
    unit_m: float
    no_target: tuple[int, ...]
    tail: str = ""


class MaxbotixDecoder(FramedDecoder):
    """Decodes ``R`` lines.

    Parameters
    ----------
    variant : Variant

    Notes
    -----
    There is no checksum. A complete ``R`` line of the right length gives a reading, so a flipped bit that changes one
    digit to another cannot be detected.
    """

    def __init__(self, variant: Variant) -> None:
        super().__init__(LineSplitter(b"\r", _LONGEST, {"garbage_bytes": 0, "bad_frame": 0}))
        self._unit_m = variant.unit_m
        self._no_target = frozenset((0, *variant.no_target))
        self._form = re.compile(rb"R([0-9]{%d})(?: P[0-9]| )?" % variant.digits)

    def reading(self, host_ns: int, frame: bytes) -> Reading | None:
        """Return the reading of a line; count bytes before an ``R`` line, or a line that is invalid, as faults."""
        # The bytes before the last R are noise, or a line whose carriage return was lost; the rest may be a valid line.
        start = max(frame.rfind(b"R"), 0)
        match = self._form.fullmatch(frame, start)
        garbage = start if match else len(frame) + 1
        if frame[:garbage] == b"\n":  # some adapters end lines with CR LF
            self._frames.faults["garbage_bytes"] += garbage
        elif garbage:
            self._count("bad_frame", garbage)
        if match is None:
            return None
        number = int(match[1])
        return Reading(host_ns, distance_m=NAN if number in self._no_target else number * self._unit_m)


class MaxbotixEncoder:
    """Encodes distances as ``R`` lines.

    Parameters
    ----------
    variant : Variant
    """

    def __init__(self, variant: Variant) -> None:
        self._variant = variant

    def encode(self, *, distance_m: float, **_: float) -> bytes:
        """Return one line, which contains only the distance."""
        form = self._variant
        number = 0 if math.isnan(distance_m) else round(distance_m / form.unit_m)
        if not 0 < number < form.no_target[-1]:
            number = form.no_target[-1]
        return f"R{number:0{form.digits}d}{form.tail}\r".encode()


def _family(
    name: str, title: str, variant: Variant, *, rate_hz: float, range_m: tuple[float, float], limits: str, source: str
) -> Family:
    return Family(
        name=name,
        title=title,
        baud=9600,
        rate_hz=rate_hz,
        resolution_m=variant.unit_m,
        range_m=range_m,
        limits=limits,
        decoder=partial(MaxbotixDecoder, variant),
        encoder=partial(MaxbotixEncoder, variant),
        source=source,
    )


_EVERY = (
    _family(
        "maxbotix-lv",
        "MaxBotix LV-MaxSonar-EZ (Rddd, inches)",
        Variant(3, 0.0254, (255,)),
        rate_hz=20.0,
        range_m=(0.1524, 6.45),
        limits="Steps of one inch, and everything nearer than 6 inches reads 6.",
        source="MaxBotix LV-MaxSonar-EZ data sheet",
    ),
    _family(
        "maxbotix-lv-p",
        "MaxBotix LV-ProxSonar-EZ (Rddd Pn, inches)",
        Variant(3, 0.0254, (255,), " P0"),
        rate_hz=20.0,
        range_m=(0.1524, 6.45),
        limits="Steps of one inch, and everything nearer than 6 inches reads 6.",
        source="MaxBotix LV-ProxSonar-EZ data sheet",
    ),
    _family(
        "maxbotix-xl",
        "MaxBotix XL-MaxSonar, 7.6 m models (Rddd, cm)",
        Variant(3, 0.01, (765,)),
        rate_hz=10.0,
        range_m=(0.2, 7.65),
        limits="Steps of 1 cm at 10 Hz.",
        source="MaxBotix XL-MaxSonar-EZ and -WR data sheets",
    ),
    _family(
        "maxbotix-xl-long",
        "MaxBotix XL-MaxSonar, 10 m models (Rdddd, cm)",
        Variant(4, 0.01, (1068,)),
        rate_hz=10.0,
        range_m=(0.2, 10.68),
        limits="Steps of 1 cm at 10 Hz.",
        source="MaxBotix XL-MaxSonar-EZL and -WRL data sheets",
    ),
    _family(
        "maxbotix-hr",
        "MaxBotix HRLV- and HRUSB-MaxSonar (Rdddd, mm)",
        Variant(4, 0.001, (5000,)),
        rate_hz=10.0,
        range_m=(0.3, 5.0),
        limits="10 Hz, and everything nearer than 300 mm reads 300.",
        source="MaxBotix HRLV-MaxSonar-EZ and HRUSB-MaxSonar-EZ data sheets",
    ),
    _family(
        "maxbotix-wr",
        "MaxBotix HRXL-MaxSonar-WR (Rdddd, mm)",
        Variant(4, 0.001, (4999, 9999)),
        rate_hz=7.5,
        range_m=(0.3, 9.998),
        limits="The free-running output is filtered to 1.2 to 1.5 Hz, useless for oscillations: trigger each reading.",
        source="MaxBotix HRXL-MaxSonar-WR data sheet",
    ),
)
FAMILIES = {family.name: family for family in _EVERY}
"""The families, by name."""
