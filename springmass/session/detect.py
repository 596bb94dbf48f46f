"""Find the sensors on the ports of this machine by what they send."""

import contextlib
import shlex
from collections.abc import Sequence

from acquisition.clock import SystemClock
from acquisition.decoders.decoder import Guess
from acquisition.decoders.registry import describe_bytes, probe
from acquisition.errors import PortError
from acquisition.live.serial_port import SerialPort, list_ports
from springmass.errors import LOG, SENSOR, ProgramError

PROBE_S = 1.0
PROBED_BAUDS = (115200, 9600)


def described(guess: Guess) -> str:
    """Return what bytes look like, and the options of the command line that would read them."""
    offers = []
    for options, when in zip(guess.alternatives, (*guess.when, ""), strict=False):
        words = [
            f"--framing {text}" if name == "framing" else f"--option {shlex.quote(f'{name}={text}')}"
            for name, text in options.items()
        ]
        offers.append(" ".join(words) + (f" {when}" if when else ""))
    return f"{guess.looks}: add {', or '.join(offers)}" if offers else guess.looks


def name_sensors(
    ports: tuple[str, ...],
    sensors: tuple[str, ...],
    baud: int | None,
    framing: str = "8N1",
    wait_s: float = 0.0,
    send: bytes = b"",
) -> tuple[tuple[str, ...], tuple[str, ...], int | None]:
    """Return ports, families and speed of a recording; what was not named is known by what speaks on the ports."""
    if ports and sensors:
        return ports, sensors, baud
    addresses = ports or [port.device for port in list_ports()]
    descriptions, named = [], []
    for address in addresses:
        heard, families, speed = listen(address, PROBED_BAUDS if baud is None else (baud,), framing, wait_s, send)
        wanted = [name for name in families if not sensors or name in sensors]
        descriptions.append(f"{address}: {heard}")
        if wanted:
            named.append((address, wanted[0], speed))
    if len(named) != max(len(ports), 1):
        if named:
            demand = "name one with --port and --sensor; several speak"
        else:
            demand = "no rangefinder that is known speaks; name it with --port and --sensor, or take --simulate"
        listed = "; ".join(descriptions) or "this machine has no serial port"
        raise ProgramError(f"record looked for a rangefinder: {demand}: {listed}", exit_code=SENSOR)
    for address, name, speed in named:
        LOG.info(f"{address}: a {name} sensor at {speed} baud")
    measured = named[0][2] if len(named) == 1 else None
    return tuple(each[0] for each in named), tuple(each[1] for each in named), baud or measured


def listen(
    device: str,
    bauds: Sequence[int] = PROBED_BAUDS,
    framing: str = "8N1",
    wait_s: float = 0.0,
    send: bytes = b"",
) -> tuple[str, list[str], int]:
    """Return what a port sends at the usual speeds, which families recognise it, and at which speed."""
    heard = b""
    for baud in bauds:
        try:
            heard = _bytes_of(device, baud, framing, wait_s, send)
        except PortError as error:
            return str(error), [], baud
        families = probe(heard) if heard else []
        if families:
            return f"{described(describe_bytes(heard))} at {baud} baud", families, baud
    return described(describe_bytes(heard)), [], bauds[-1]


def _bytes_of(device: str, baud: int, framing: str, wait_s: float, send: bytes) -> bytes:
    """Return what a port sends in a second, or until it is recognised within ``wait_s``."""
    clock, heard = SystemClock(), b""
    with contextlib.closing(SerialPort(device, baud, framing)) as port:
        start_ns = second_ns = clock.now_ns()
        while (now_ns := clock.now_ns()) < start_ns + int(max(PROBE_S, wait_s) * 1e9):
            if now_ns >= second_ns:
                if now_ns > start_ns and probe(heard):
                    break
                second_ns += int(PROBE_S * 1e9)
                port.write(send)
            heard += port.read((second_ns - now_ns) * 1e-9)
    return heard
