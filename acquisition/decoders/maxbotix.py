"""MaxBotix ASCII lines, sent without requests: ``R``, a fixed number of digits and a carriage return.

The digits are inches, centimetres or millimetres, depending on the model. The bytes do not show the unit, so the name
of the family selects it. Before the carriage return, LV models may add ``Pn`` (proximity) and HRUSB models a space. The
signal has RS-232 polarity at levels of 0 to Vcc, so a TTL adapter without an inverter reads noise.
"""

from __future__ import annotations

import re
from functools import partial
from typing import NamedTuple

from acquisition.decoders.frames import FramedDecoder, LineSplitter
from acquisition.decoders.sensor import Sensor
from acquisition.readings import NAN, Reading

_LONGEST = 64  # bytes; the lines of the start-up banner are shorter, and are counted as faults like any other text


class DistanceForm(NamedTuple):
    """How a model writes a distance: number of digits, value of the last one in m, codes for no target besides 0."""

    digits: int
    unit_m: float
    no_target: tuple[int, ...]


class MaxbotixDecoder(FramedDecoder):
    """Decodes ``R`` lines.

    There is no checksum. A complete ``R`` line of the right length gives a reading, so a flipped bit that changes one
    digit to another cannot be detected.
    """

    def __init__(self, form: DistanceForm) -> None:
        super().__init__(LineSplitter(b"\r", _LONGEST, {"garbage_bytes": 0, "bad_frame": 0}))
        self._unit_m = form.unit_m
        self._no_target = frozenset((0, *form.no_target))
        self._line = re.compile(rb"R([0-9]{%d})(?: P[0-9]| )?" % form.digits)

    def reading(self, host_ns: int, frame: bytes) -> Reading | None:
        """Return the reading of a line; count bytes before an ``R`` line, or a line that is invalid, as faults."""
        # The bytes before the last R are noise, or a line whose carriage return was lost; the rest may be a valid line.
        start = max(frame.rfind(b"R"), 0)
        match = self._line.fullmatch(frame, start)
        garbage = start if match else len(frame) + 1
        if frame[:garbage] == b"\n":  # some adapters end lines with CR LF
            self._frames.faults["garbage_bytes"] += garbage
        elif garbage:
            self._count("bad_frame", garbage)
        if match is None:
            return None
        number = int(match[1])
        return Reading(host_ns, distance_m=NAN if number in self._no_target else number * self._unit_m)


_LV = "Steps of one inch, and everything nearer than 6 inches reads 6."
_XL = "Steps of 1 cm at 10 Hz."
_HR = "10 Hz, and everything nearer than 300 mm reads 300."
_WR = "The free-running output is filtered to 1.2 to 1.5 Hz, useless for oscillations: trigger each reading."
_TABLE = (
    ("lv", "LV-MaxSonar-EZ", "Rddd, inches", DistanceForm(3, 0.0254, (255,)), 20.0, (0.1524, 6.45), _LV),
    ("lv-p", "LV-ProxSonar-EZ", "Rddd Pn, inches", DistanceForm(3, 0.0254, (255,)), 20.0, (0.1524, 6.45), _LV),
    ("xl", "XL-MaxSonar, 7.6 m models", "Rddd, cm", DistanceForm(3, 0.01, (765,)), 10.0, (0.2, 7.65), _XL),
    ("xl-long", "XL-MaxSonar, 10 m models", "Rdddd, cm", DistanceForm(4, 0.01, (1068,)), 10.0, (0.2, 10.68), _XL),
    ("hr", "HRLV- and HRUSB-MaxSonar", "Rdddd, mm", DistanceForm(4, 0.001, (5000,)), 10.0, (0.3, 5.0), _HR),
    ("wr", "HRXL-MaxSonar-WR", "Rdddd, mm", DistanceForm(4, 0.001, (4999, 9999)), 7.5, (0.3, 9.998), _WR),
)

FAMILIES = {
    f"maxbotix-{name}": Sensor(
        name=f"maxbotix-{name}",
        title=f"MaxBotix {model} ({lines})",
        baud=9600,
        rate_hz=rate_hz,
        resolution_m=form.unit_m,
        range_m=range_m,
        limits=limits,
        decoder=partial(MaxbotixDecoder, form),
        source=f"MaxBotix {model.partition(',')[0]} data sheet",
    )
    for name, model, lines, form, rate_hz, range_m, limits in _TABLE
}
