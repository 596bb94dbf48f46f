"""``springmass ports``: the serial ports of this machine, what speaks on them, and the sensors that can be recorded."""

from __future__ import annotations

import contextlib
import json
import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from acquisition.clock import SystemClock
from acquisition.decoders.registry import describe_bytes, families, probe
from acquisition.errors import PortError, visible
from acquisition.live.serial_port import SerialPort, list_ports
from springmass.commands.options import Json, flag, option
from springmass.errors import OK, SENSOR, ProgramError, suggest, tell
from springmass.terminal.printing import wrapped

PROBE_S = 1.0
BAUDS = (115200, 9600)


def ports(
    *,
    no_probe: Annotated[bool, flag("only list the ports; do not open them")] = False,
    port: Annotated[tuple[str, ...], option("P", "also listen on this address; may be repeated")] = (),
    as_json: Json = False,
) -> int:
    """List ports, listening to each for a second at each of the usual speeds, and the families of sensors."""
    rows = [_row(each.device, each.description or "", not no_probe) for each in list_ports()]
    rows += [_row(address, "named on the command line", True) for address in port]
    if as_json:
        print(json.dumps({"ports": rows, "sensors": [family.describe() for family in families()]}))
        return OK
    if not rows:
        print("no serial port on this machine; `springmass record --simulate` runs without one")
    for row in rows:
        print(visible(f"{row['device']:<16} {row['description']}"))
        if row["heard"] is not None:
            print(visible(f"{'':<16} {row['heard']}"))
    print(f"\n{'sensor':<18} {'rate / Hz':>9} {'step / mm':>9} {'range / m':>13} {'baud':>7}")
    for family in families():
        reach, step = "{:g} to {:g}".format(*family.range_m), f"{family.resolution_m * 1e3:.3g}"
        print(f"{family.name:<18} {family.rate_hz:>9.3g} {step:>9} {reach:>13} {family.baud:>7}")
        print(wrapped(f"    {family.title}. {family.limits}", "    "))
    known = [row["device"] for row in rows if row["families"]]
    suggest(f"springmass record --port {shlex.quote(known[0])}" if known else "springmass record --simulate")
    return OK


@dataclass(frozen=True, slots=True)
class Named:
    """Ports of a recording, with the family of the sensor on each, and their speed if it was measured."""

    ports: tuple[str, ...]
    sensors: tuple[str, ...]
    baud: int | None


def name_sensors(ports: tuple[str, ...], sensors: tuple[str, ...], baud: int | None) -> Named:
    """Return ports and sensors of a recording; those that were not named are known by what speaks on the ports.

    Raises
    ------
    ProgramError
        With exit code 4 where no port, or more than one, has a sensor that is known; the line names them.
    """
    if ports and sensors:
        return Named(ports, sensors, baud)
    addresses = ports or [port.device for port in list_ports()]
    descriptions, known = [], []
    for address in addresses:
        heard, families, speed = _listen(address, BAUDS if baud is None else (baud,))
        wanted = [name for name in families if not sensors or name in sensors]
        descriptions.append(f"{address}: {heard}")
        if wanted:
            known.append((address, wanted[0], speed))
    if len(known) != max(len(ports), 1):
        if known:
            demand = "name one with --port and --sensor; several speak"
        else:
            demand = "no rangefinder that is known speaks; name it with --port and --sensor, or take --simulate"
        listed = "; ".join(descriptions) or "this machine has no serial port"
        raise ProgramError(f"record looked for a rangefinder: {demand}: {listed}", SENSOR)
    for address, name, speed in known:
        tell(f"{address}: a {name} sensor at {speed} baud")
    measured = known[0][2] if len(known) == 1 else None
    return Named(tuple(each[0] for each in known), tuple(each[1] for each in known), baud or measured)


def _row(device: str, description: str, listen: bool) -> dict[str, Any]:
    heard, families, _ = _listen(device) if listen else (None, [], 0)
    return {"device": device, "description": description, "heard": heard, "families": families}


def _listen(device: str, bauds: Sequence[int] = BAUDS) -> tuple[str, list[str], int]:
    """What a port sends at the usual speeds, which families recognise it, and at which speed."""
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
