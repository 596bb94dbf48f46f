"""``springmass ports``: the serial ports of this machine and what speaks on them."""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping, Sequence
from typing import Any

from acquisition.clock import SystemClock
from acquisition.decoders.registry import describe_bytes, probe
from acquisition.errors import PortError
from acquisition.live.reader import Line, PortReader
from acquisition.live.serial_port import SerialPort, list_ports
from acquisition.readings import Read
from springmass.errors import OK

__all__ = ["run"]

PROBE_S = 1.0
BAUDS = (115200, 9600)


def run(options: argparse.Namespace) -> int:
    """List ports with what speaks on them: listens to each, a second at each of the usual speeds."""
    rows = [_row(port.device, port.description, not options.no_probe) for port in list_ports()]
    rows += [_row(address, "named on the command line", True) for address in options.port]
    if options.json:
        print(json.dumps(rows))
        return OK
    if not rows:
        print("no serial port on this machine; `springmass record --simulate SCENE.toml` runs without one")
    for row in rows:
        print(f"{row['device']:<16} {row['description']}")
        if row["heard"] is not None:
            print(f"{'':<16} {row['heard']}")
    return OK


def _row(device: str, description: str, listen: bool) -> dict[str, Any]:
    heard, families = _listen(device) if listen else (None, [])
    return {"device": device, "description": description, "heard": heard, "families": families}


def _listen(device: str) -> tuple[str, list[str]]:
    """What a port says at the usual speeds, and which families know it."""
    heard = b""
    for baud in BAUDS:
        try:
            heard = _bytes_of(device, baud)
        except PortError as error:
            return str(error), []
        found = probe(heard) if heard else []
        if found:
            return f"{describe_bytes(heard)} at {baud} baud", found
    return describe_bytes(heard), []


class _Heard:
    """Keeps the bytes of a port, and why it went away if it did."""

    def __init__(self) -> None:
        self.bytes = b""
        self.why = ""

    def reads(self, reads: Sequence[Read]) -> None:
        for _, _, data in reads:
            self.bytes += data

    def event(self, channel: int, host_ns: int, kind: str, facts: Mapping[str, Any]) -> None:  # noqa: ARG002 - a sink
        if kind == "lost":
            self.why = str(facts["why"])


def _bytes_of(device: str, baud: int) -> bytes:
    clock, heard = SystemClock(), _Heard()
    reader = PortReader([Line(SerialPort(device, baud))], heard, clock)
    reader.start()
    clock.sleep_until_ns(clock.now_ns() + int(PROBE_S * 1e9))
    reader.stop()
    if heard.why:
        raise PortError(heard.why)
    return heard.bytes
