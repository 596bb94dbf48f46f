"""The page on the local network: this computer's address there, and that address as a QR code."""

from __future__ import annotations

import io
import socket

from springmass.errors import SENSOR, ProgramError

ELSEWHERE = ("192.0.2.1", 9)
"""An address for documentation (RFC 5737): nothing is sent to it; the system only chooses the route to it."""


def address_in_network() -> str:
    """Return this computer's address in the network through which it would send."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(ELSEWHERE)
        except OSError as error:
            raise ProgramError(f"--lan: no network ({error.strerror}); join one, or leave --lan out", SENSOR) from error
        return str(probe.getsockname()[0])


def code_svg(address: str) -> bytes:
    """Return an address as a QR code in SVG format, dark on light and with a quiet zone."""
    import segno

    made = io.BytesIO()
    segno.make(address, micro=False).save(made, kind="svg", scale=5, border=4, light="#ffffff", dark="#000000")
    return made.getvalue()


def code_for_terminal(address: str) -> str:
    """Return an address as a QR code of block characters."""
    import segno

    made = io.StringIO()
    segno.make(address, micro=False).terminal(made, compact=True)
    return made.getvalue()
