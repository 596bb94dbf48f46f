"""Serial ports through pyserial: opened and configured by it, read by descriptor where there is one."""

from __future__ import annotations

import contextlib
import errno
import os
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from acquisition.errors import PortError

__all__ = ["READ_BYTES", "PortFacts", "SerialPort", "list_ports"]

READ_BYTES = 65536


@dataclass(frozen=True, slots=True)
class PortFacts:
    """One port of this machine.

    Parameters
    ----------
    device : str
        As ``--port`` takes it.
    description : str
        As the operating system names it.
    """

    device: str
    description: str


def list_ports() -> tuple[PortFacts, ...]:
    """Return the serial ports of this machine, in the order of their names."""
    from serial.tools.list_ports import comports

    found = (PortFacts(p.device, p.description or "") for p in comports())
    return tuple(sorted(found, key=lambda port: port.device))


class SerialPort:
    """A port that reads without blocking.

    Parameters
    ----------
    address : str
        A device (``/dev/ttyUSB0``, ``COM3``) or any address pyserial takes (``socket://host:port``, ``rfc2217://...``).
    baud : int

    Raises
    ------
    PortError
        One line: absent (with the ports that are there), no permission (with the group), busy.
    """

    def __init__(self, address: str, baud: int) -> None:
        self.name = address
        self._baud = baud
        self._port: Any = None
        self._descriptor = -1
        try:
            self.reopen()
        except PortError as error:
            raise PortError(_explain(address, error.__cause__ or error)) from error.__cause__

    def reopen(self) -> None:
        """Open, again after a loss; what stands in the way is not looked into, for a reader may try twice a second."""
        import serial

        self.close()
        try:
            # pyserial's network ports know no write timeout (RFC 2217 refuses one) and no exclusive use.
            options: dict[str, Any] = {} if "://" in self.name else {"exclusive": True, "write_timeout": 1.0}
            port = serial.serial_for_url(self.name, baudrate=self._baud, timeout=0, **options)
        except (serial.SerialException, OSError, ValueError, NotImplementedError) as error:
            raise PortError(f"{self.name}: cannot be opened ({error})") from error
        self._port = port
        self._descriptor = _descriptor(port)

    def fileno(self) -> int:
        """Return the descriptor to wait on, -1 where the address has none (RFC 2217, Windows)."""
        return self._descriptor

    def read(self, wait_s: float) -> bytes:
        """Return what comes within that time, at once what is there: for an address without a descriptor."""
        with self._or_gone("the port has gone"):
            try:
                if self._port.timeout != wait_s:  # RFC 2217 negotiates the whole port anew when it is set
                    self._port.timeout = wait_s
                data = self._port.read(1)
                return bytes(data + self._port.read(min(self._port.in_waiting, READ_BYTES))) if data else b""
            except BlockingIOError:
                return b""

    def write(self, data: bytes) -> None:
        """Send bytes whole."""
        with self._or_gone("cannot be written to"):
            self._port.write(data)

    def discard_input(self) -> None:
        """Forget what came and was not read."""
        with self._or_gone("the port has gone"):
            self._port.reset_input_buffer()

    @contextlib.contextmanager
    def _or_gone(self, what: str) -> Iterator[None]:
        import serial

        try:
            yield
        except (serial.SerialException, OSError, TypeError, AttributeError) as error:
            # pyserial trips over its own closed members where the cable goes in the middle of a call.
            raise PortError(f"{self.name}: {what} ({error})") from error

    def close(self) -> None:
        """Close; again does no harm."""
        port, self._port, self._descriptor = self._port, None, -1
        if port is not None:
            try:
                port.close()
            except OSError:
                # The device is gone already; there is nothing left to give back.
                return


def _descriptor(port: Any) -> int:
    if os.name == "nt":
        return -1
    try:
        descriptor = int(port.fileno())
    except (AttributeError, OSError, ValueError, TypeError):
        return -1
    os.set_blocking(descriptor, False)
    return descriptor


def _explain(address: str, error: BaseException) -> str:
    """One line from whatever pyserial or the system said."""
    code = getattr(error, "errno", None)
    text = str(error)
    if code == errno.ENOENT or "FileNotFoundError" in text:
        there = ", ".join(port.device for port in list_ports()) or "none"
        return f"{address}: no such port; this machine has: {there}. Is the cable in?"
    if code in (errno.EACCES, errno.EPERM) or "PermissionError" in text:
        return f"{address}: no permission to open the port{_group(address)}"
    if code == errno.EBUSY or "exclusively lock" in text or "Resource temporarily unavailable" in text:
        return f"{address}: the port is busy: another program holds it; close that one first"
    return f"{address}: cannot be opened ({' '.join(text.split())}); check the address and the cable"


def _group(address: str) -> str:
    """Which group owns the port, and how to join it."""
    try:
        import grp

        name = grp.getgrgid(os.stat(address).st_gid).gr_name
    except (ImportError, OSError, KeyError):
        return "; ask whoever runs this machine"
    return f": it belongs to the group {name}; join it with `sudo usermod -aG {name} $USER` and log in again"
