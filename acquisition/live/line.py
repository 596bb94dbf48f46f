"""The interfaces of the reader of ports: the port, the receiver of its bytes, and how to poll its sensor."""

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
        """Name for messages."""
        ...

    def fileno(self) -> int:
        """Return a descriptor to wait on and to read without blocking; -1 if there is none."""
        ...

    def read(self, wait_s: float) -> bytes:
        """Return the bytes that are there or arrive within that time; only for a transport without a descriptor.

        Raises
        ------
        PortError
            If the port is gone.
        """
        ...

    def write(self, data: bytes) -> None:
        """Send a request.

        Raises
        ------
        PortError
            If the port is gone.
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
        """Open again after the port was lost.

        Raises
        ------
        PortError
            If it is still gone.
        """
        ...

    def close(self) -> None:
        """Close. Further calls do nothing."""
        ...


class Proof(Protocol):
    """Checks whether the device on a port that came back is the sensor that was lost."""

    @property
    def facts(self) -> Mapping[str, Any]:
        """Further facts for the event "reopened", after the check."""
        ...

    def feed(self, host_ns: int, data: bytes) -> bool | None:
        """Check the bytes of one read; return whether it is the sensor, or None while this is undecided."""
        ...


class Sink(Protocol):
    """The receiver of the bytes. It is called on the I/O thread, so it must not block."""

    def reads(self, reads: Sequence[Read]) -> None:
        """Receive the reads of one wake-up, one for each port. Several threads may call this if lines block."""
        ...

    def event(self, channel: int, host_ns: int, kind: str, facts: Mapping[str, Any]) -> None:
        """Receive "lost", "reopened" (with gap_s), "refused" (another device came back) or "timeout"."""
        ...


@dataclass(slots=True)
class Line:
    """One port and how to poll its sensor.

    Parameters
    ----------
    transport : Transport
    channel : int
        Number of the sensor within the run.
    poll : Poll or None
    decoder : callable or None
        Returns the decoder of a polled sensor, if the sink feeds it within ``reads`` and flushes it at "timeout". The
        decoder then chooses the next request, and an incomplete reply counts as timed out before that request.
    proof : callable or None
        Returns the check that a port must pass after it came back; None for no check.
    greeting : bytes
        Sent to a port that came back; makes the device identify itself.
    """

    transport: Transport
    channel: int = 0
    poll: Poll | None = None
    decoder: Callable[[], Polled] | None = None
    proof: Callable[[], Proof | None] | None = None
    greeting: bytes = b""
    _lost_ns: int | None = field(default=None, init=False)
    """Host time at which it was lost."""
    _closed: bool = field(default=False, init=False)
    _proving: Proof | None = field(default=None, init=False)
    _unproven: list[Read] = field(default_factory=list, init=False)
    _retry_ns: int = field(default=0, init=False)
    _ask_ns: int = field(default=0, init=False)
    _answer_by_ns: int | None = field(default=None, init=False)
