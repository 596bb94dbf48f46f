"""Limits for clients: a maximum number of connections, and a maximum time for a request.

uvicorn limits neither: it waits for the end of a request without a time limit, and accepts connections until the
process runs out of file descriptors.
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
"""Time within which a request must be complete after its first byte; the first request counts from the connection."""
MOST_CONNECTIONS = 256
"""More than the maximum of 32 viewers need, if each browser opens its usual six connections."""


def most_connections() -> int:
    """Return the maximum number of connections: a third of the files that this process may open, but at most 256.

    A request for a file opens that file, so each connection may need two descriptors; the last third is for other uses.
    """
    if sys.platform == "win32":
        return MOST_CONNECTIONS
    soft, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    return MOST_CONNECTIONS if soft == resource.RLIM_INFINITY else min(MOST_CONNECTIONS, soft // 3)


def bounded_protocol(most: int) -> type[H11Protocol]:
    """Return uvicorn's HTTP/1.1 protocol with a maximum number of connections and a time limit for each request."""
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
