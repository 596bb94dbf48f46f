"""``springmass firmware``: wiring and settings of the rangefinder that this project builds, and how to flash it."""

import contextlib
import shlex
from typing import Annotated

from acquisition.clock import SystemClock
from acquisition.decoders.decoder import Identity
from acquisition.decoders.line_protocol import FAMILY, LineProtocolDecoder
from acquisition.errors import visible
from acquisition.live.firmware import BOOTLOADER_BAUDS, FIRMWARE_VERSION, HEX, WIRING, avrdude_arguments
from acquisition.live.serial_port import SerialPort
from springmass.commands.options import converted
from springmass.commands.parameters import Whole, option
from springmass.errors import HINT, LOG, OK, SENSOR, ProgramError
from springmass.session.sensors import outdated, settings_of

ANSWER_S = 5.0
"""Longest time until a board answers: opening the port restarts it, and its bootloader waits for two seconds."""
ASK_EVERY_S = 0.5


def _gate(text: str) -> tuple[int, int]:
    near, comma, far = text.partition(",")
    if not (comma and near.isdecimal() and far.isdecimal()):
        raise ValueError("must be NEAR,FAR in whole us")
    return int(near), int(far)


def firmware(
    *,
    port: Annotated[str | None, option("P", "port of the board")] = None,
    rate: Annotated[Whole | None, option("R", "pings per second, 10 to 125; the board stores the setting")] = None,
    gate: Annotated[
        tuple[int, int] | None,
        converted("NEAR,FAR", "range of accepted times of flight, us; NEAR is at least 116", _gate, repeated=False),
    ] = None,
    spread: Annotated[Whole | None, option("US", "largest random delay of a ping, 0 to 2000 us")] = None,
    name: Annotated[str | None, option("NAME", "name of the board: at most 12 letters, digits, . _ or -")] = None,
) -> int:
    """Show the wiring and how to flash; with a port, show the board's settings, or change them."""
    settings = (("R", rate), ("G", None if gate is None else f"{gate[0]},{gate[1]}"), ("J", spread), ("N", name))
    commands = [f"{letter}{value}" for letter, value in settings if value is not None]
    if port is None:
        if commands:
            raise ProgramError("--port must name the board's port", "`springmass ports` lists them")
        print(WIRING)
        _show_flashing("PORT")
        return OK
    identity = _converse(port, commands)
    print(visible(f"{port}: {identity}{settings_of(identity)}"))
    if outdated(identity):
        _show_flashing(port)
    else:
        LOG.log(HINT, f"springmass record --port {shlex.quote(port)} --page")
    return OK


def _show_flashing(port: str) -> None:
    print(f"firmware {FIRMWARE_VERSION}: {HEX}")
    print("avrdude (Debian: apt install avrdude, macOS: brew install avrdude) writes it by the bootloader:")
    for baud, boards in zip(BOOTLOADER_BAUDS, ("Uno, Nano", "Nano with the old bootloader"), strict=True):
        print(f"  {shlex.join(avrdude_arguments(port, baud))}    # {boards}")
    print("or open firmware/springmass_rangefinder in the Arduino IDE, and press Upload")


def _converse(address: str, commands: list[str]) -> Identity:
    """Send commands, and return the identity that the device then reports."""
    clock, decoder = SystemClock(), LineProtocolDecoder()
    with contextlib.closing(SerialPort(address, FAMILY.baud)) as port:
        end_ns = clock.now_ns() + int(ANSWER_S * 1e9)
        _ask(port, decoder, clock, end_ns)
        for command in commands:
            refused = decoder.faults["refused_command"]
            decoder.status.identity = None
            port.write(f"{command}\n".encode("ascii", "replace"))
            while decoder.status.identity is None:
                if clock.now_ns() > end_ns:
                    raise ProgramError(f"{address}: no answer to {command!r}", "try again", SENSOR)
                decoder.feed(0, _heard(port, clock))
                if decoder.faults["refused_command"] > refused:
                    wrong = f"{address}: the device does not take {command!r}"
                    raise ProgramError(wrong, "docs/reference/line-protocol.md has the ranges", SENSOR)
        assert decoder.status.identity is not None
        return decoder.status.identity


def _ask(port: SerialPort, decoder: LineProtocolDecoder, clock: SystemClock, end_ns: int) -> None:
    """Ask the board for its identification until it answers."""
    heard = 0
    while decoder.status.identity is None:
        if clock.now_ns() > end_ns:
            what = "readings, but not what it is" if heard else "nothing"
            wrong = f"{port.name}: the device was asked what it is and said {what}"
            raise ProgramError(wrong, "is it the right port? `springmass firmware` shows how to flash it", SENSOR)
        port.write(FAMILY.identify)
        until_ns = clock.now_ns() + int(ASK_EVERY_S * 1e9)
        while decoder.status.identity is None and clock.now_ns() < until_ns:
            heard += len(decoder.feed(0, _heard(port, clock)))


def _heard(port: SerialPort, clock: SystemClock) -> bytes:
    """Return the bytes received; return after the timeout if there are none."""
    data = port.read(0.05)
    if not data:
        clock.sleep_until_ns(clock.now_ns() + 1_000_000)
    return data
