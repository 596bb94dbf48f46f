"""Serial ports through pyserial: opened and configured by it, read by descriptor where there is one."""

from __future__ import annotations

import contextlib
import errno
import os
import socket
import stat
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from acquisition.errors import PortError

try:
    import fcntl
    import termios

    _TERMIOS_ERRORS: tuple[type[Exception], ...] = (termios.error,)
except ImportError:  # Windows, where a port is exclusive anyway
    termios = None  # type: ignore[assignment]
    _TERMIOS_ERRORS = ()

__all__ = ["READ_BYTES", "PortFacts", "SerialPort", "list_ports"]

READ_BYTES = 65536
KEEPALIVE_S = {"TCP_KEEPIDLE": 5, "TCP_KEEPINTVL": 2, "TCP_KEEPCNT": 3}
"""A connection whose other side vanished without a word is given up after five seconds of silence and three probes."""


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
            self._open(address)
        except PortError as error:
            raise PortError(_explain(address, error.__cause__ or error)) from error.__cause__
        self._device = _devices().get(os.path.realpath(address))

    def reopen(self) -> None:
        """Open again after a loss: the same device, whatever name it has now, and no other that took its name.

        What stands in the way is not looked into, for a reader may try twice a second.
        """
        self.close()
        if self._device is None and "://" not in self.name:
            other = _devices().get(os.path.realpath(self.name))
            if other is not None:
                raise PortError(f"{self.name}: what is there now is {other}, what was lost was no USB device")
        self._open(self.name if self._device is None else self._found(self._device))

    @property
    def identified(self) -> bool:
        """Whether the port is a USB device's that has a serial number, so that no other is taken for it."""
        return self._device is not None and bool(self._device.serial_number)

    def _found(self, device: _Device) -> str:
        """Return the name under which a USB device stands now: its own, or that of its serial number."""
        there = _devices()
        if there.get(os.path.realpath(self.name)) == device:
            return self.name
        for name, other in there.items():
            if other == device and device.serial_number:
                return name
        raise PortError(f"{self.name}: {device} is not there")

    def _open(self, address: str) -> None:
        import serial

        try:
            # pyserial's network ports know no write timeout (RFC 2217 refuses one) and no exclusive use.
            options: dict[str, Any] = {} if "://" in address else {"exclusive": True, "write_timeout": 1.0}
            port = serial.serial_for_url(address, baudrate=self._baud, timeout=0, **options)
        except (serial.SerialException, OSError, ValueError, NotImplementedError) as error:
            raise PortError(f"{self.name}: cannot be opened ({error})") from error
        self._port = port
        self._descriptor = _descriptor(port)
        _claim(self._descriptor)
        _keep_alive(port)

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
        except (serial.SerialException, OSError, TypeError, AttributeError, ValueError, *_TERMIOS_ERRORS) as error:
            # pyserial trips over its own closed members where the cable goes in the middle of a call.
            raise PortError(f"{self.name}: {what} ({error})") from error

    def close(self) -> None:
        """Close; again does no harm."""
        port, descriptor = self._port, self._descriptor
        self._port, self._descriptor = None, -1
        if port is not None:
            _claim(descriptor, release=True)
            try:
                port.close()
            except OSError:
                # The device is gone already; there is nothing left to give back.
                return


@dataclass(frozen=True, slots=True)
class _Device:
    """What a USB adapter says of itself; one without a serial number is like all others of its make."""

    vendor: int
    product: int
    serial_number: str

    def __str__(self) -> str:
        number = f" with serial number {self.serial_number}" if self.serial_number else ""
        return f"the USB device {self.vendor:04x}:{self.product:04x}{number}"


def _devices() -> dict[str, _Device]:
    """Return the USB devices among the ports, by the names without links."""
    from serial.tools.list_ports import comports

    return {
        os.path.realpath(port.device): _Device(port.vid, port.pid or 0, port.serial_number or "")
        for port in comports()
        if port.vid is not None
    }


def _claim(descriptor: int, *, release: bool = False) -> None:
    """Keep other programs from opening a terminal device: pyserial's lock stops only those that ask for one."""
    if termios is not None and descriptor >= 0:
        with contextlib.suppress(OSError):  # a socket, or a device that is gone
            fcntl.ioctl(descriptor, termios.TIOCNXCL if release else termios.TIOCEXCL)


def _keep_alive(port: Any) -> None:
    """Have the system notice a network connection whose other side vanished without a word."""
    connection = getattr(port, "_socket", None)
    if isinstance(connection, socket.socket):
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        for name, value in KEEPALIVE_S.items():
            if hasattr(socket, name):
                connection.setsockopt(socket.IPPROTO_TCP, getattr(socket, name), value)


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
    """Which group may use the port, and how to join it; none that would open more than ports."""
    try:
        import grp

        found = os.stat(address)
        name = grp.getgrgid(found.st_gid).gr_name
    except (ImportError, OSError, KeyError):
        return "; ask whoever runs this machine"
    shared = stat.S_IRGRP | stat.S_IWGRP
    if found.st_gid == 0 or found.st_mode & shared != shared:
        return (
            f": it is {name}'s alone; have whoever runs this machine give it to a group of its own, "
            'such as dialout (a udev rule with GROUP="dialout", MODE="0660")'
        )
    return f": it belongs to the group {name}; join it with `sudo usermod -aG {name} $USER` and log in again"
