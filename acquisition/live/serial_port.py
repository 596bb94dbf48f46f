"""Serial and network ports: pyserial opens and configures them."""

from __future__ import annotations

import contextlib
import errno
import os
import re
import select
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
except ImportError:  # on Windows, where the use of a port is always exclusive
    termios = None  # type: ignore[assignment]
    _TERMIOS_ERRORS = ()

READ_BYTES = 65536
EMPTY_READS = 3
"""Number of reads without a byte, though some were announced, that show another reader."""
SEVEN_BITS = bytes(byte & 0x7F for byte in range(256))
KEEPALIVE_S = {"TCP_KEEPIDLE": 5, "TCP_KEEPINTVL": 2, "TCP_KEEPCNT": 3}
"""A silently lost connection is closed after five seconds without data and three probes, two seconds apart."""
OTHER_TRIES = 10
"""Number of tries that must find another device on the name of a lost port before it is opened. When a hub is plugged
in, its ports may get each other's names for a moment."""


def list_ports() -> list[Any]:
    """Return the serial ports of this computer as pyserial describes them, sorted by ``device``, their address."""
    from serial.tools.list_ports import comports

    return sorted(comports(), key=lambda port: port.device)


class SerialPort:
    """A device (``/dev/ttyUSB0``, ``COM3``) or a pyserial address (``socket://host:port``, ``rfc2217://...``).

    The PortError of an absent port lists the existing ports; that of a port without permission names the group that may
    use it.
    """

    def __init__(self, address: str, baud: int, framing: str = "8N1") -> None:
        self.name = address
        self._empty_reads = 0
        self.shared = False  # whether another program took bytes since a reader set this to False
        self._baud = baud
        self._framing = framing
        if re.fullmatch("[5-8][NEOMS][12]", framing) is None:
            raise PortError(
                f"{address}: a framing is data bits, parity (N, E, O, M, S) and stop bits, got {framing!r}",
                "state it as in 7E1",
            )
        self._port: Any = None
        self._descriptor = -1
        self._others = 0  # number of consecutive tries that found another device
        try:
            self._open(address)
        except PortError as error:
            raise _explained(address, error.__cause__ or error) from error.__cause__
        self._device = _devices().get(os.path.realpath(address))

    @property
    def is_network(self) -> bool:
        """Whether the port is a network address."""
        return "://" in self.name

    def reopen(self) -> str:
        """Reopen a lost port; return "identified" for the same USB serial number, "another", or else "assumed".

        The device with the serial number of the lost one is opened even under another name. The PortError does not
        explain the cause, because a reader calls this method twice a second.
        """
        self.close()
        if self.is_network:
            self._open(self.name)
            return "assumed"
        there, lost = _devices(), self._device
        if lost is not None and lost.serial_number:
            name = next((name for name, device in there.items() if device == lost), None)
            if name is not None:
                self._open(self.name if there.get(os.path.realpath(self.name)) == lost else name)
                self._others = 0
                return "identified"
        present = there.get(os.path.realpath(self.name))
        another = present != lost
        self._others = self._others + 1 if another and present is not None else 0
        if another and self._others < OTHER_TRIES:
            raise PortError(f"{self.name}: expected {lost or 'no USB device'}, got {present or 'none'}")
        self._open(self.name)
        self._device, self._others = present, 0
        return "another" if another else "assumed"

    def _open(self, address: str) -> None:
        import serial

        try:
            # The network ports of pyserial support neither a write timeout (RFC 2217 refuses it) nor exclusive use.
            options: dict[str, Any] = {} if "://" in address else {"exclusive": True, "write_timeout": 1.0}
            data_bits, parity, stop_bits = tuple(self._framing)
            if self._with_parity:  # on the line, seven bits and a parity are eight bits
                data_bits, parity = "8", "N"
            options |= {"bytesize": int(data_bits), "parity": parity, "stopbits": int(stop_bits)}
            port = serial.serial_for_url(address, baudrate=self._baud, timeout=0, **options)
        except (serial.SerialException, OSError, ValueError, NotImplementedError, *_TERMIOS_ERRORS) as error:
            raise PortError(f"{self.name}: cannot be opened ({error})") from error
        self._port = port
        self._descriptor = _descriptor(port)
        _ask_terminal(self._descriptor, "TIOCEXCL")
        _keep_alive(port)

    def read(self, wait_s: float) -> bytes:
        """Return available bytes, or wait up to ``wait_s`` for some; a PortError means that the port was lost."""
        data = self._read(wait_s)
        return data.translate(SEVEN_BITS) if self._with_parity else data

    @property
    def _with_parity(self) -> bool:
        """Whether seven data bits come with a parity bit above them."""
        return self._framing[0] == "7" and self._framing[1] != "N"

    def _read(self, wait_s: float) -> bytes:
        with self._as_port_error("the port was disconnected"):
            if self._descriptor < 0:  # RFC 2217, Windows
                if self._port.timeout != wait_s:  # setting the timeout makes RFC 2217 renegotiate all port settings
                    self._port.timeout = wait_s
                data = self._port.read(1)
                return bytes(data + self._port.read(min(self._port.in_waiting, READ_BYTES))) if data else b""
            if not select.select([self._descriptor], [], [], wait_s)[0]:
                return b""
            terminal, data = os.isatty(self._descriptor), b""
            try:
                data = os.read(self._descriptor, READ_BYTES)
            except BlockingIOError:
                if not terminal:
                    return b""
            if not data and (not terminal or _hung_up(self._descriptor)):
                raise OSError("end of file")
            if not data:  # a terminal had bytes, and another program was faster, or select was wrong, which is rare
                self._empty_reads += 1
                self.shared |= self._empty_reads >= EMPTY_READS
            return data

    def write(self, data: bytes) -> None:
        """Send all bytes."""
        with self._as_port_error("cannot be written to"):
            self._port.write(data)

    def discard_input(self) -> None:
        """Discard unread bytes."""
        with self._as_port_error("the port was disconnected"):
            self._port.reset_input_buffer()

    @contextlib.contextmanager
    def _as_port_error(self, what: str) -> Iterator[None]:
        import serial

        try:
            yield
        except (serial.SerialException, OSError, TypeError, AttributeError, ValueError, *_TERMIOS_ERRORS) as error:
            # If the cable is unplugged during a call, pyserial accesses attributes that it has already cleared.
            raise PortError(f"{self.name}: {what} ({error})") from error

    def close(self) -> None:
        """Close the port. Further calls do nothing."""
        port, descriptor = self._port, self._descriptor
        self._port, self._descriptor = None, -1
        if port is not None:
            _ask_terminal(descriptor, "TIOCNXCL")
            with contextlib.suppress(OSError):  # a disconnected device has nothing to release
                port.close()


@dataclass(frozen=True, slots=True)
class _Device:
    """Identity of a USB adapter; adapters of the same model without serial numbers are equal."""

    vendor: int
    product: int
    serial_number: str

    def __str__(self) -> str:
        number = f" with serial number {self.serial_number}" if self.serial_number else ""
        return f"the USB device {self.vendor:04x}:{self.product:04x}{number}"


def _devices() -> dict[str, _Device]:
    """Return the USB devices among the ports, by port name with symbolic links resolved."""
    return {
        os.path.realpath(port.device): _Device(port.vid, port.pid or 0, port.serial_number or "")
        for port in list_ports()
        if port.vid is not None
    }


def _hung_up(descriptor: int) -> bool:
    """Return whether the device of a terminal is gone."""
    if not hasattr(select, "poll"):
        return True
    poll = select.poll()
    poll.register(descriptor, select.POLLIN)
    return any(event & (select.POLLHUP | select.POLLERR | select.POLLNVAL) for _, event in poll.poll(0))


def _ask_terminal(descriptor: int, request: str) -> None:
    """Let only this program open a terminal device, or any: the lock of pyserial stops only those that check it."""
    if termios is not None and descriptor >= 0:
        with contextlib.suppress(OSError):  # the descriptor is a socket, or the device is disconnected
            fcntl.ioctl(descriptor, getattr(termios, request))


def _keep_alive(port: Any) -> None:
    """Let the system detect that the other end of a network connection has disappeared."""
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


def _explained(address: str, error: BaseException) -> PortError:
    """Return what an error of pyserial or of the system means, and what to do."""
    code = getattr(error, "errno", None)
    text = str(error)
    if code == errno.ENOENT or "FileNotFoundError" in text:
        there = ", ".join(port.device for port in list_ports()) or "none"
        remedy = f"check the cable, or use one of the ports of this computer: {there}"
        return PortError(f"{address}: no such port", remedy)
    if code in (errno.EACCES, errno.EPERM) or "PermissionError" in text:
        owner, remedy = _group(address)
        return PortError(f"{address}: no permission to open the port{owner}", remedy)
    if code in (errno.EBUSY, errno.EAGAIN):
        return PortError(f"{address}: the port is used by another program", "close that program")
    return PortError(f"{address}: cannot be opened ({' '.join(text.split())})", "check the address and the cable")


def _group(address: str) -> tuple[str, str]:
    """Return whose a port is, and how to get access: by its group, or by the administrator if that is unsafe."""
    try:
        import grp

        status = os.stat(address)
        name = grp.getgrgid(status.st_gid).gr_name
    except (ImportError, OSError, KeyError):
        return "", "ask the administrator of this computer"
    shared = stat.S_IRGRP | stat.S_IWGRP
    if status.st_gid == 0 or status.st_mode & shared != shared:
        rule = '(udev rule GROUP="dialout", MODE="0660")'
        return f": it belongs to {name} only", f"ask the administrator to give it to a group such as dialout {rule}"
    return f": it belongs to the group {name}", f"join it with `sudo usermod -aG {name} $USER` and log in again"
