"""``springmass ports``: the serial ports of this machine and what speaks on them."""

from __future__ import annotations

import argparse
import contextlib
import json
import shlex
from collections.abc import Sequence
from typing import Any

from acquisition.clock import SystemClock
from acquisition.decoders.registry import describe_bytes, probe
from acquisition.errors import PortError, visible
from acquisition.live.serial_port import SerialPort, list_ports
from springmass.errors import OK, SENSOR, ProgramError, suggest, tell

__all__ = ["name_sensors", "run"]

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
        print(visible(f"{row['device']:<16} {row['description']}"))
        if row["heard"] is not None:
            print(visible(f"{'':<16} {row['heard']}"))
    known = [row["device"] for row in rows if row["families"]]
    suggest(f"springmass record --port {shlex.quote(known[0])}" if known else "springmass record --simulate SCENE.toml")
    return OK


def name_sensors(options: argparse.Namespace) -> None:
    """Fill in ports and sensors of a recording that the command line left out, by what speaks on the ports.

    Raises
    ------
    ProgramError
        With exit code 4 where no port, or more than one, has a sensor that is known; the line names them.
    """
    if options.port and options.sensor:
        return
    addresses = options.port or [port.device for port in list_ports()]
    told, known = [], []
    for address in addresses:
        heard, families, baud = _listen(address, BAUDS if options.baud is None else (options.baud,))
        wanted = [name for name in families if not options.sensor or name in options.sensor]
        told.append(f"{address}: {heard}")
        if wanted:
            known.append((address, wanted[0], baud))
    if len(known) != max(len(options.port), 1):
        if known:
            demand = "name one with --port and --sensor; several speak"
        else:
            demand = (
                "no rangefinder that is known speaks; name it with --port and --sensor, or take --simulate SCENE.toml"
            )
        listed = "; ".join(told) or "this machine has no serial port"
        raise ProgramError(f"record looked for a rangefinder: {demand}: {listed}", SENSOR)
    for address, name, baud in known:
        tell(f"{address}: a {name} sensor at {baud} baud")
    options.port = [address for address, _, _ in known]
    options.sensor = [name for _, name, _ in known]
    options.baud = options.baud or (known[0][2] if len(known) == 1 else None)


def _row(device: str, description: str, listen: bool) -> dict[str, Any]:
    heard, families, _ = _listen(device) if listen else (None, [], 0)
    return {"device": device, "description": description, "heard": heard, "families": families}


def _listen(device: str, bauds: Sequence[int] = BAUDS) -> tuple[str, list[str], int]:
    """What a port says at the usual speeds, which families know it, and at which speed."""
    heard = b""
    for baud in bauds:
        try:
            heard = _bytes_of(device, baud)
        except PortError as error:
            return str(error), [], baud
        found = probe(heard) if heard else []
        if found:
            return f"{describe_bytes(heard)} at {baud} baud", found, baud
    return describe_bytes(heard), [], bauds[-1]


def _bytes_of(device: str, baud: int) -> bytes:
    clock, heard = SystemClock(), b""
    with contextlib.closing(SerialPort(device, baud)) as port:
        end_ns = clock.now_ns() + int(PROBE_S * 1e9)
        while (left_ns := end_ns - clock.now_ns()) > 0:
            heard += port.read(left_ns * 1e-9)
    return heard
