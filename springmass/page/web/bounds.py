"""What a client may take: a connection among a bounded number, and seconds for a request.

uvicorn bounds neither: it waits for the end of a request for as long as the client likes, and accepts connections until
the process has no file left to open.
"""

from __future__ import annotations

import asyncio
import logging
import sys
from typing import TYPE_CHECKING, cast

if sys.platform != "win32":
    import resource

if TYPE_CHECKING:
    from uvicorn.protocols.http.h11_impl import H11Protocol

__all__ = ["bounded_protocol", "most_connections"]

LOG = logging.getLogger("springmass.page")
REQUEST_WITHIN_S = 10.0
"""A request is whole within this time of its first byte, the first one of the connection."""
MOST_CONNECTIONS = 256
"""More than the 32 viewers need that may look, with six connections each, as browsers open them."""


def most_connections() -> int:
    """Return how many connections there may be: a third of the files that this process may open, or 256.

    A request for a file opens it, so that each connection may need two files; the last third is for all the others.
    """
    if sys.platform == "win32":
        return MOST_CONNECTIONS
    soft, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    return MOST_CONNECTIONS if soft == resource.RLIM_INFINITY else min(MOST_CONNECTIONS, soft // 3)


def bounded_protocol(most: int) -> type[H11Protocol]:
    """Return uvicorn's protocol of HTTP/1.1, with at most so many connections and a time limit for each request."""
    import h11
    from uvicorn.protocols.http.h11_impl import H11Protocol

    class BoundedProtocol(H11Protocol):
        _deadline: asyncio.TimerHandle | None = None

        def connection_made(self, transport: asyncio.BaseTransport) -> None:
            super().connection_made(cast(asyncio.Transport, transport))
            if len(self.connections) > most:
                self._close("more than %d connections; the newest is closed", most)
            else:
                self._wait_for_request()

        def data_received(self, data: bytes) -> None:
            super().data_received(data)
            upgraded = self.transport.get_protocol() is not self
            if not upgraded and self.conn.their_state in (h11.IDLE, h11.SEND_BODY):
                self._wait_for_request()
            else:
                self._stop_waiting()

        def connection_lost(self, exc: Exception | None) -> None:
            self._stop_waiting()
            super().connection_lost(exc)

        def _wait_for_request(self) -> None:
            if self._deadline is None:
                what = "a request that is not whole after %g s; its connection is closed"
                self._deadline = self.loop.call_later(REQUEST_WITHIN_S, self._close, what, REQUEST_WITHIN_S)

        def _stop_waiting(self) -> None:
            if self._deadline is not None:
                self._deadline.cancel()
                self._deadline = None

        def _close(self, message: str, number: float) -> None:
            LOG.warning(message, number, extra={"client": self.client[0] if self.client else ""})
            self.transport.abort()

    return BoundedProtocol
