"""Interfaces used by the port reader: the port, the receiver of its bytes, and the polling of its sensor."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

from acquisition.decoders.family import Poll, Polled
from acquisition.readings import Read

__all__ = ["Line", "Proof", "Sink", "Transport"]


class Transport(Protocol):
    """A source of bytes: a serial port, a socket, a test double."""

    @property
    def name(self) -> str:
        """Name of the port in messages."""
        ...

    def fileno(self) -> int:
        """Return a file descriptor that can be waited on and read without blocking, or -1 if there is none."""
        ...

    def read(self, wait_s: float) -> bytes:
        """Return available bytes, or wait up to ``wait_s`` for some; only for a transport without a descriptor.

        Raises
        ------
        PortError
            If the port was lost.
        """
        ...

    def write(self, data: bytes) -> None:
        """Send a request.

        Raises
        ------
        PortError
            If the port was lost.
        """
        ...

    def discard_input(self) -> None:
        """Discard unread bytes."""
        ...

    @property
    def identified(self) -> bool:
        """Whether a serial number guarantees that :meth:`reopen` opens the same device."""
        ...

    def reopen(self) -> None:
        """Open the port again after it was lost.

        Raises
        ------
        PortError
            If the port is still unavailable.
        """
        ...

    def close(self) -> None:
        """Close the port. Further calls do nothing."""
        ...


class Proof(Protocol):
    """Checks whether the device on a reopened port is the sensor that was lost."""

    @property
    def facts(self) -> Mapping[str, Any]:
        """Additional facts for the event "reopened", available after the check."""
        ...

    def feed(self, host_ns: int, data: bytes) -> bool | None:
        """Check the bytes of one read; return whether the device is the sensor, or None while this is undecided."""
        ...


class Sink(Protocol):
    """The receiver of the bytes; it is called on the I/O threads, so it must not block."""

    def reads(self, reads: Sequence[Read]) -> None:
        """Receive reads that were made together; if some lines may block, several threads may call this method."""
        ...

    def event(self, channel: int, host_ns: int, kind: str, facts: Mapping[str, Any]) -> None:
        """Receive the event "lost", "reopened" (with gap_s), "refused" (another device was found) or "timeout"."""
        ...


@dataclass(slots=True)
class Line:
    """A port and the polling of its sensor.

    Parameters
    ----------
    transport : Transport
    channel : int
        Number of the sensor within the run.
    poll : Poll or None
        How to poll the sensor; None for a sensor that sends without requests.
    decoder : callable or None
        Returns the decoder of a polled sensor; only allowed if the sink feeds the decoder within ``reads`` and flushes
        it at "timeout". The decoder then chooses the next request. A reply that is incomplete when that request is
        due counts as timed out.
    proof : callable or None
        Returns the check that a reopened port must pass, or None for no check.
    greeting : bytes
        Bytes sent to a reopened port, so that the device identifies itself.
    """

    transport: Transport
    channel: int = 0
    poll: Poll | None = None
    decoder: Callable[[], Polled] | None = None
    proof: Callable[[], Proof | None] | None = None
    greeting: bytes = b""
    _lost_ns: int | None = field(default=None, init=False)
    """Host time at which the port was lost, ns; None if it is not lost."""
    _closed: bool = field(default=False, init=False)
    _proving: Proof | None = field(default=None, init=False)
    _unproven: list[Read] = field(default_factory=list, init=False)
    _retry_ns: int = field(default=0, init=False)
    _ask_ns: int = field(default=0, init=False)
    _answer_by_ns: int | None = field(default=None, init=False)
