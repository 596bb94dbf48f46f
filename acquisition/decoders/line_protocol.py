"""The line protocol of this project, for a microcontroller that times a transducer at 100 Hz.

A reading is ``$R1,sequence,device_us,echo_us,temperature,status*CRC`` and a line feed. The specification is in
docs/reference/line-protocol.md; firmware/springmass_rangefinder is the firmware of a device that uses the protocol. The
device sends the echo time and not a distance, so the host can apply another speed of sound later. Lines ``$I1,...``
identify the device.
"""

from __future__ import annotations

import math
import re
from binascii import crc_hqx

from acquisition.decoders.decoder import Identity
from acquisition.decoders.frames import FramedDecoder, LineSplitter
from acquisition.decoders.sensor import Sensor
from acquisition.readings import NAN, Reading

LONGEST_LINE = 96  # maximum length of a line without its line feed, bytes

SETTINGS = ("rate_hz", "near_us", "far_us", "spread_us", "thermometer")
"""Settings in an identity line, after model, version and name: rate, gate limits, ping spread, thermometer."""

_WRAP = 1 << 32
_FIELDS = rb"R1,([0-9]{1,10}),([0-9]{1,10}),([0-9]{1,6}\.[0-9]{2})?,(-?[0-9]{1,5})?,([A-Z])"
_LINE = re.compile(rb"\$(" + _FIELDS + rb")\*([0-9A-F]{4})\r?")
_IDENTITY = re.compile(
    rb"I1,([a-z0-9-]{1,32}),([0-9]{1,3}\.[0-9]{1,3}\.[0-9]{1,3}),([A-Za-z0-9._-]{0,12}),"
    rb"([0-9]{1,3}),([0-9]{1,5}),([0-9]{1,5}),([0-9]{1,4}),([01])"
)
_FIRST_GREETING = b"# springmass rangefinder, line protocol R1"
_FIRST = Identity("springmass-rangefinder", "1.0.0")

CONDITIONS = {b"N": "no_echo", b"B": "busy", b"C": "too_close", b"F": "too_far", b"A": "no_answer", b"S": "stuck"}
"""Names of the conditions, by status letter; an unknown letter of a later version is counted as ``other``."""

COMPLAINTS = {
    b"A": "the transducer does not answer its trigger: check its 5 V and ground, TRIG on D9 and ECHO on D8",
    b"S": "ECHO stays high: check its wire on D8, and switch the transducer off and on",
}
"""Advice on what to check, for each status letter that indicates a fault of the wiring or the transducer."""
_ENVELOPE = re.compile(rb"\$([ -#%-)+-~]+)\*([0-9A-F]{4})\r?")  # printable characters except $ and *


def checksum(body: bytes) -> int:
    """Return the CRC-16/CCITT-FALSE (polynomial 1021, initial value FFFF) of the bytes between ``$`` and ``*``.

    >>> f"{checksum(b'123456789'):04X}"
    '29B1'
    """
    return crc_hqx(body, 0xFFFF)


def frame(body: bytes) -> bytes:
    """Return the line that contains a body, with its CRC and line feed."""
    return b"$%s*%04X\n" % (body, checksum(body))


class LineProtocolDecoder(FramedDecoder):
    """Decodes the line protocol.

    The CRC detects every change of one or two bits, every burst error of up to 16 bits within the body, and all but one
    in 65536 of the other changes. Comment lines (``#``) are counted as ``comment``, and valid lines of a later version
    as ``unknown_record``. Reports that the device did not understand a command are counted as ``refused_command``.
    """

    def __init__(self) -> None:
        faults = dict.fromkeys(
            ("garbage_bytes", "bad_checksum", "bad_frame", "unknown_record", "refused_command", "comment"), 0
        )
        super().__init__(LineSplitter(b"\n", LONGEST_LINE, faults))

    def reading(self, host_ns: int, frame: bytes) -> Reading | None:
        """Return the reading of a line, or None; count the fault of a line without a reading."""
        row = _reading(host_ns, frame)
        if row is None:
            return self._other(host_ns, frame)
        if row[3] != row[3]:  # there was no echo; the status letter gives the reason
            self._count_no_echo(frame)
        elif self.status.complaint:
            self.status.complaint = ""
        return row

    def _count_no_echo(self, frame: bytes) -> None:
        """Count a reading without an echo under the reason that the device gives."""
        letter = frame[frame.rindex(b"*") - 1 :][:1]
        name = CONDITIONS.get(letter, "other")
        self.status.conditions[name] = self.status.conditions.get(name, 0) + 1
        self.status.complaint = COMPLAINTS.get(letter, "")

    def _other(self, host_ns: int, line: bytes) -> Reading | None:
        """Return the reading after noise in a line, or None; store an identity, and count the fault of the line."""
        # The bytes before the last $ are noise, or a line whose end was lost; the rest may be a valid line.
        start = max(line.rfind(b"$"), 0)
        reading = _reading(host_ns, line[start:]) if start else None
        envelope = _ENVELOPE.fullmatch(line, start)
        sound = envelope is not None and checksum(envelope[1]) == int(envelope[2], 16)
        identity = _IDENTITY.fullmatch(envelope[1]) if envelope is not None and sound else None
        if identity is not None:
            model, version, name, *numbers = (field.decode("ascii") for field in identity.groups())
            settings = dict(zip(SETTINGS, map(int, numbers), strict=True))
            self.status.identity = Identity(model, version, name, settings)
        if reading is not None or identity is not None:
            if start:
                self._count("bad_frame", start)
            return reading
        if line.startswith(_FIRST_GREETING):
            self.status.identity = _FIRST
        if envelope is None:
            fault = "comment" if line.startswith(b"#") else "bad_frame"
        elif not sound:
            fault = "bad_checksum"
        else:
            fault = "refused_command" if envelope[1] == b"X1,command" else "unknown_record"
        self._count(fault, len(line) + 1)
        return None


def _reading(host_ns: int, line: bytes) -> Reading | None:
    """Return the reading of a line without its line feed, or None if the line is not a valid reading."""
    fields = _LINE.fullmatch(line)
    if fields is None:
        return None
    body, sequence, device_us, echo, temperature, status, crc = fields.groups()
    count, clock_us = int(sequence), int(device_us)
    if crc_hqx(body, 0xFFFF) != int(crc, 16) or count >= _WRAP or clock_us >= _WRAP:
        return None
    # Only status E means an echo; with any other letter there is no measurement. An echo time of 0 is impossible.
    echo_us = float(echo) if status == b"E" and echo else 0.0
    celsius = int(temperature) / 100 if temperature else NAN
    return Reading(host_ns, count, clock_us, echo_us or NAN, NAN, celsius)


class LineProtocolEncoder:
    """Encodes readings in the line protocol, with echo times in steps of 0.25 us as in the firmware."""

    def encode(
        self, *, sequence: int, device_us: int, echo_us: float, distance_m: float, temperature_c: float
    ) -> bytes:
        """Return one line; a NaN distance or echo time means no target."""
        silent = math.isnan(echo_us) or math.isnan(distance_m)
        echo = b"" if silent else b"%.2f" % (round(echo_us * 4) / 4)
        temperature = b"" if math.isnan(temperature_c) else b"%d" % round(temperature_c * 100)
        status = b"N" if silent else b"E"
        return frame(b"R1,%d,%d,%s,%s,%s" % (sequence % _WRAP, device_us % _WRAP, echo, temperature, status))


FAMILY = Sensor(
    name="line-protocol",
    title="springmass line protocol ($R1 lines of a microcontroller that times the echo)",
    baud=115200,
    rate_hz=100.0,
    resolution_m=43e-6,
    range_m=(0.02, 1.6),
    limits="At 100 Hz an echo from beyond 1.6 m arrives after the next ping.",
    decoder=LineProtocolDecoder,
    encoder=LineProtocolEncoder,
    has_device_time=True,
    identify=b"?\n",
    source="docs/reference/line-protocol.md",
)
