"""One port as the reader sees it: where bytes come from, who takes them, and how its sensor is spoken to."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

from acquisition.decoders.family import Poll, Polled
from acquisition.readings import Read

__all__ = ["Line", "Proof", "Sink", "Transport"]


class Transport(Protocol):
    """Bytes from somewhere: a serial port, a socket, a test's own."""

    @property
    def name(self) -> str:
        """For people."""
        ...

    def fileno(self) -> int:
        """Return a descriptor to wait on and to read without blocking, or -1 where there is none."""
        ...

    def read(self, wait_s: float) -> bytes:
        """Return what is there, or what comes within that time; asked of a transport without a descriptor only.

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
        """Forget what came and was not read."""
        ...

    @property
    def identified(self) -> bool:
        """Whether a serial number makes sure that :meth:`reopen` opens the same device."""
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
        """Close; again does no harm."""
        ...


class Proof(Protocol):
    """Tells the sensor that was lost from another that came in its place."""

    @property
    def facts(self) -> Mapping[str, Any]:
        """What the event "reopened" shall say besides, once it is proven."""
        ...

    def feed(self, host_ns: int, data: bytes) -> bool | None:
        """Take the bytes of one read; return whether it is the sensor, None while that is open."""
        ...


class Sink(Protocol):
    """Who keeps the bytes; called on the I/O thread, so it must not block."""

    def reads(self, reads: Sequence[Read]) -> None:
        """Take what one wake-up read, of each port its bytes; called by several threads where lines may block."""
        ...

    def event(self, channel: int, host_ns: int, kind: str, facts: Mapping[str, Any]) -> None:
        """Take "lost", "reopened" (with gap_s), "refused" (another device came back) or "timeout"."""
        ...


@dataclass(slots=True)
class Line:
    """One port and how its sensor is spoken to.

    Parameters
    ----------
    transport : Transport
    channel : int
        Number of the sensor within the run.
    poll : Poll or None
    decoder : callable or None
        Returns a polled sensor's decoder, where the sink feeds it within ``reads`` and flushes it at "timeout": then
        that says what to ask next, and a reply that came short counts as timed out before the next request.
    proof : callable or None
        Returns what a port that came back has to prove before its bytes are the sensor's again; None: nothing.
    greeting : bytes
        Sent to a port that came back: makes the device say what it is.
    """

    transport: Transport
    channel: int = 0
    poll: Poll | None = None
    decoder: Callable[[], Polled] | None = None
    proof: Callable[[], Proof | None] | None = None
    greeting: bytes = b""
    _lost_ns: int | None = field(default=None, init=False)
    """Since when its readings are missing."""
    _closed: bool = field(default=False, init=False)
    _proving: Proof | None = field(default=None, init=False)
    _unproven: list[Read] = field(default_factory=list, init=False)
    _retry_ns: int = field(default=0, init=False)
    _ask_ns: int = field(default=0, init=False)
    _answer_by_ns: int | None = field(default=None, init=False)
