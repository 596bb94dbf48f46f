"""``springmass ports``: the serial ports of this machine and what speaks on them."""

from __future__ import annotations

import argparse
import contextlib
import json
from typing import Any

from acquisition.clock import SystemClock
from acquisition.decoders.registry import describe_bytes, probe
from acquisition.errors import PortError
from acquisition.live.serial_port import SerialPort, list_ports
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


def _bytes_of(device: str, baud: int) -> bytes:
    clock, heard = SystemClock(), b""
    with contextlib.closing(SerialPort(device, baud)) as port:
        end_ns = clock.now_ns() + int(PROBE_S * 1e9)
        while (left_ns := end_ns - clock.now_ns()) > 0:
            heard += port.read(left_ns * 1e-9)
    return heard
