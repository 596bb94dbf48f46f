"""The page's server: its files, the messages to viewers, and the few messages that they send."""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import math
import socket
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from springmass.page.state import PageState
from springmass.page.view import View, json_of
from springmass.page.web.bounds import bounded_protocol, most_connections
from springmass.page.web.security import ACT, Access, guarded
from springmass.page.web.sharing import code_svg

if TYPE_CHECKING:
    from starlette.applications import Starlette
    from starlette.websockets import WebSocket

__all__ = ["Opening", "application", "serve"]

LOG = logging.getLogger("springmass.page")
STATIC = Path(__file__).parents[1] / "static"
TURN_S = 0.0225
"""Time between two reads of the log: little longer than a screen frame; samples reach the screen within 40 ms."""
MANY, EVERY = 4, 4
"""With more viewers than MANY, samples are sent after every fourth read of the log, eleven times a second."""
STATE_S = 0.5
LAST_S = 1.5
"""Time for which the page is still served after the end, so that viewers see that the run has ended."""
ALONE_S = 30.0
"""Time after which a page without viewers ends, once the run that it recorded is saved."""
MOST_VIEWERS = 32
LONGEST_MESSAGE = 4096
"""Maximum size of a browser's message in bytes."""
LONGEST_TEXT = 500
LIMITS = {"known_m": (0.01, 20.0), "threshold_m": (1e-4, 1.0), "keep_s": (0.0, 60.0)}
"""Minimum and maximum of the numbers in requests, in m and s."""


@dataclass
class Opening:
    """The address of the page and its audience.

    Parameters
    ----------
    port : int
        TCP port; 0 for any free one.
    network : str
        This computer's address in the local network, for viewers; empty if only this computer may open the page.
    secret, used
        As in :class:`springmass.page.web.security.Access`.
    opened : callable
        Called once the page answers, with the port, the address to open (None if it has been used) and the viewers'
        address.
    was_used : callable
        Called when the controller's link has been used.
    """

    port: int = 0
    network: str = ""
    secret: str = ""
    used: bool = False
    opened: Callable[[int, str | None, str], None] = lambda _port, _address, _network: None
    was_used: Callable[[], None] = lambda: None


def application(
    page_state: PageState, share: Callable[[], str] = lambda: "", polled: Callable[[int], None] = print
) -> Starlette:
    """Return the page as an ASGI application without access control.

    Parameters
    ----------
    page_state : PageState
    share : callable
        Returns the address for viewers; empty if viewers are not admitted.
    polled : callable
        Called after every read of the log, with the number of viewers.
    """
    from collections.abc import AsyncIterator

    from starlette.applications import Starlette
    from starlette.responses import FileResponse, PlainTextResponse, Response
    from starlette.routing import Mount, Route, WebSocketRoute
    from starlette.staticfiles import StaticFiles

    server = _Server(page_state, share, polled)

    @contextlib.asynccontextmanager
    async def lifespan(_: Starlette) -> AsyncIterator[None]:
        server.look()
        try:
            yield
        finally:
            server.close()

    async def page(_: Any) -> Response:
        return FileResponse(STATIC / "page.html")

    async def report(_: Any) -> Response:
        made = None if page_state.after is None else page_state.after.report
        if made is None:
            return PlainTextResponse("springmass: no report has been made; the page makes one on O\n", 404)
        return FileResponse(made, media_type="text/html")

    async def code(_: Any) -> Response:
        if not share():
            return PlainTextResponse("springmass: the page is not open to viewers; --lan opens it\n", 404)
        return Response(code_svg(share()), media_type="image/svg+xml")

    routes = [
        Route("/", page),
        Route("/v1/report", report),
        Route("/v1/code.svg", code),
        WebSocketRoute("/v1/run", server.attend),
        Mount("/static", StaticFiles(directory=STATIC)),
    ]
    return Starlette(routes=routes, lifespan=lifespan)


class _Server:
    def __init__(self, page_state: PageState, share: Callable[[], str], polled: Callable[[int], None]) -> None:
        self._page_state, self._share, self._polled = page_state, share, polled
        self._viewers = 0
        self._turn = 0
        self._turned = asyncio.Event()
        self._motion_text = self._now_text = self._state_text = ""
        self._frames: dict[tuple[int, int, int], bytes] = {}
        self._due_s, self._bench = 0.0, page_state.bench
        self._next: asyncio.TimerHandle | None = None

    def look(self) -> None:
        """Update the view now, and repeatedly as long as the page is served.

        Texts and frames are encoded once for all viewers. This is a timer's callback because a sleeping task would wake
        twice per turn.
        """
        self._next = asyncio.get_running_loop().call_later(TURN_S, self.look)
        try:
            self._update()
        except Exception:  # a defect; the next turn may succeed
            LOG.exception("the page could not be brought up to date")
        self._polled(self._viewers)

    def _update(self) -> None:
        page_state = self._page_state
        page_state.poll()
        if page_state.watcher is not None:
            self._motion_text, self._now_text = page_state.watcher.text, page_state.watcher.now_text
        if self._due_s <= 0.0 or self._bench is not page_state.bench:
            self._due_s, self._bench = STATE_S, page_state.bench
            self._state_text = json_of({"type": "state", **page_state.state()})
        self._due_s -= TURN_S
        self._frames.clear()
        self._turn += 1
        if self._viewers <= MANY or self._turn % EVERY == 0:
            turned, self._turned = self._turned, asyncio.Event()
            turned.set()

    def close(self) -> None:
        """Stop reading the log."""
        if self._next is not None:
            self._next.cancel()

    async def attend(self, socket_: WebSocket) -> None:
        """Serve one browser until it leaves, or close its connection with a code.

        New data are taken from the view whenever the browser has received the previous data. The codes are 1003 for a
        forbidden message, 1011 for a defect of the page, and 1013 for too many viewers.
        """
        from starlette.websockets import WebSocketDisconnect

        with contextlib.suppress(WebSocketDisconnect):
            if self._viewers >= MOST_VIEWERS:
                _log(socket_, "more than %d viewers; the newest is closed", MOST_VIEWERS)
                await socket_.close(1013)
                return
            await socket_.accept()
            error = await self._converse(socket_)
            if isinstance(error, _Refused):
                _log(socket_, f"{error}; its connection is closed with 1003")
                await socket_.close(1003)
            elif error is not None:
                _log(socket_, "a defect of the page; its connection is closed with 1011", error=error)
                await socket_.close(1011)

    async def _converse(self, socket_: WebSocket) -> Exception | None:
        """Send and receive until an error, which is returned; raise WebSocketDisconnect when the browser leaves."""
        from starlette.websockets import WebSocketDisconnect

        self._viewers += 1
        tasks = [asyncio.create_task(each(socket_)) for each in (self._receive, self._send)]
        try:
            await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        finally:
            self._viewers -= 1
            for task in tasks:
                task.cancel()
            received, sent = await asyncio.gather(*tasks, return_exceptions=True)
        ended = sent if isinstance(received, asyncio.CancelledError) else received
        if isinstance(ended, WebSocketDisconnect):
            raise ended
        return ended if isinstance(ended, Exception) else None

    async def _receive(self, socket_: WebSocket) -> None:
        from starlette.websockets import WebSocketDisconnect

        while True:
            message = await socket_.receive()
            if message["type"] == "websocket.disconnect":
                raise WebSocketDisconnect(message.get("code", 1005))
            text = message.get("text")
            if text is None:
                raise _Refused("a binary message")
            await self._take(socket_, text)

    async def _send(self, socket_: WebSocket) -> None:
        view: View | None = None
        sent, state, motion, now = [0], "", "", ""
        while True:
            if self._page_state.view is not None and view is not self._page_state.view:
                view, sent, motion, now = (
                    self._page_state.view,
                    [0] * len(self._page_state.view.series),
                    "",
                    self._now_text,
                )
                await socket_.send_text(json_of(self._hello(view, acts=ACT in socket_.auth.scopes)))
            for number in range(0 if view is None else len(sent)):
                while view is not None and sent[number] < len(view.series[number]):
                    message = self._frame(view, number, sent[number])
                    sent[number] += (len(message) - 16) // 16
                    await socket_.send_bytes(message)
            # If the view was replaced while its samples were sent, data of the next view must wait for its hello
            # message.
            if state != self._state_text and view is not None and view is self._page_state.view:
                state = self._state_text
                await socket_.send_text(state)
            if motion is not self._motion_text and view is self._page_state.view:
                motion = self._motion_text
                await socket_.send_text(motion)
            if now is not self._now_text and view is self._page_state.view:
                now = self._now_text
                await socket_.send_text(now)
            await self._turned.wait()

    def _frame(self, view: View, number: int, first: int) -> bytes:
        key = (id(view), number, first)
        if key not in self._frames:
            self._frames[key] = view.series[number].message(number, first)
        return self._frames[key]

    def _hello(self, view: View, *, acts: bool) -> dict[str, Any]:
        controls = acts and self._page_state.controls is not None
        role = "controller" if acts else "viewer"
        return {**view.hello(controls=controls), "role": role, "share": self._share()}

    async def _take(self, socket_: WebSocket, text: str) -> None:
        """Carry out a browser's request.

        Raises
        ------
        _Refused
            If the browser may not make this request.
        """
        try:
            request = json.loads(text)
            kind = str(request["type"])
            low = _number(request, "from") if kind == "region" else -math.inf
            high = _number(request, "to") if kind in ANALYSES else math.inf
            checked = {} if kind in ANALYSES else _checked(kind, request)
        # These include the errors for integers of thousands of digits and for deeply nested lists.
        except (ValueError, KeyError, TypeError, AttributeError, OverflowError, RecursionError) as error:
            raise _Refused("a message that is none of the page's") from error
        if kind in ANALYSES:
            if (watcher := self._page_state.watcher) is not None:
                answer = await (
                    asyncio.to_thread(watcher.region, low, high)
                    if kind == "region"
                    else asyncio.to_thread(watcher.moment, high)
                )
                await socket_.send_text(answer)
        elif ACT in socket_.auth.scopes:
            self._act(kind, checked)
        else:
            raise _Refused("a command of a viewer")

    def _act(self, kind: str, checked: Mapping[str, Any]) -> None:
        """Carry out a request that is possible now and ignore others; the page shows the state."""
        page_state = self._page_state
        if not page_state.may(kind):
            return
        if page_state.after is None:
            if page_state.controls is not None:
                page_state.controls(checked)
        elif kind == "report":
            page_state.after.make_report()
        elif kind == "note":
            page_state.after.note(checked["text"])
        elif kind == "discard":
            page_state.after.discard()
        elif kind == "close":
            page_state.closed = True


KINDS: dict[str, tuple[str, ...]] = {
    "zero": (),
    "ruler": ("known_m",),
    "arm": ("threshold_m", "keep_s"),
    "disarm": (),
    "record": (),
    "mark": ("text",),
    "note": ("text",),
    "stop": (),
    "report": (),
    "discard": (),
    "close": (),
}
"""Requests of the controller, with the names of their values."""
ANALYSES = frozenset({"region", "moment"})
"""Requests that any viewer may make, because they change nothing."""


class _Refused(Exception):
    """A message that a browser may not send."""


def _log(socket_: WebSocket, message: str, *values: object, error: Exception | None = None) -> None:
    """Log an action of a browser, or a failure while it was served."""
    client = socket_.client.host if socket_.client else ""
    LOG.warning(message, *values, exc_info=error, extra={"client": client})


def _checked(kind: str, request: Mapping[str, Any]) -> dict[str, Any]:
    """Return a command with only its own values; raise ValueError, or the error of a wrong value."""
    if kind not in KINDS:
        raise ValueError(kind)
    return {"type": kind} | {name: _text(request) if name == "text" else _number(request, name) for name in KINDS[kind]}


def _number(request: Mapping[str, Any], name: str) -> float:
    value = float(request[name])
    low, high = LIMITS.get(name, (-1e12, 1e12))
    if not (math.isfinite(value) and low <= value <= high):
        raise ValueError(name)
    return value


def _text(request: Mapping[str, Any]) -> str:
    return " ".join(str(request.get("text", "")).split())[:LONGEST_TEXT]


def serve(page_state: PageState, opening: Opening, *, until: Callable[[], bool]) -> None:
    """Serve the page until somebody ends it.

    Parameters
    ----------
    page_state : PageState
    opening : Opening
    until : callable
        Returns whether the page should end; called after every read of the log.

    Raises
    ------
    OSError
        If the port is taken.
    """
    import uvicorn

    with socket.create_server(("0.0.0.0" if opening.network else "127.0.0.1", opening.port)) as listener:
        port = listener.getsockname()[1]
        access = Access(port, opening.secret, viewers=bool(opening.network), used=opening.used)
        network = f"http://{opening.network}:{port}/?token={access.viewers_token}" if opening.network else ""
        announced, left_s, alone_s = False, LAST_S, ALONE_S

        def polled(viewers: int) -> None:
            nonlocal announced, left_s, alone_s
            if not announced:
                announced = True
                token = access.token
                opening.opened(port, None if token is None else f"http://127.0.0.1:{port}/?token={token}", network)
            if access.token is None and not opening.used:
                opening.used = True
                opening.was_used()
            left_s -= TURN_S if until() else 0.0
            after = page_state.after is not None and page_state.after.ours
            alone_s = alone_s - TURN_S if after and not viewers else ALONE_S
            server.should_exit = server.should_exit or page_state.closed or left_s <= 0.0 or alone_s <= 0.0

        page = application(page_state, lambda: network, polled)
        most = most_connections()
        config = uvicorn.Config(
            guarded(page, access, [opening.network] if opening.network else []),
            http=bounded_protocol(most),
            backlog=most // 2,  # maximum number accepted in one turn, before they can be counted
            log_config=None,  # the caller decides where the log of its process goes
            log_level="error",
            access_log=False,
            ws_max_size=LONGEST_MESSAGE,
            ws_ping_interval=20,
            ws_per_message_deflate=False,  # it does not shorten a few samples, and costs more time than everything else
            timeout_graceful_shutdown=2,
        )
        server = uvicorn.Server(config)
        server.run(sockets=[listener])
