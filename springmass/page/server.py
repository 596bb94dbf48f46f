"""The page's server: its files, the messages to whoever looks, and the few that come back."""

from __future__ import annotations

import asyncio
import json
import math
import socket
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from springmass.page.security import Gate
from springmass.page.view import View
from springmass.page.watching import Watcher

if TYPE_CHECKING:
    from starlette.applications import Starlette
    from starlette.websockets import WebSocket

__all__ = ["Controls", "application", "serve"]

STATIC = Path(__file__).parent / "static"
FRAME_S = 1 / 30
MANY, MANY_FRAME_S = 4, 0.1
"""More viewers than these get their samples ten times a second."""
STATE_S = 0.5
LAST_S = 1.5
"""So much longer it serves when it shall end: whoever looks sees that the run has."""
MOST_VIEWERS = 32
LONGEST_MESSAGE = 4096
"""Bytes that a browser may send at a time."""
LONGEST_MARK = 500

Controls = Callable[[str, str], None]
"""Takes "mark" with its text, or "stop" with none: to the recording, which acknowledges through its log."""


def application(view: View, watcher: Watcher, poll: Callable[[], None], controls: Controls | None) -> Starlette:
    """Return the page as an ASGI application, without its gate.

    Parameters
    ----------
    view : View
    watcher : Watcher
    poll : callable
        Brings the view up to date; called thirty times a second, also while nobody looks.
    controls : callable or None
        None where there is nothing to control.
    """
    import contextlib
    from collections.abc import AsyncIterator

    from starlette.applications import Starlette
    from starlette.responses import FileResponse
    from starlette.routing import Mount, Route, WebSocketRoute
    from starlette.staticfiles import StaticFiles

    server = _Server(view, watcher, poll, controls)

    @contextlib.asynccontextmanager
    async def lifespan(_: Starlette) -> AsyncIterator[None]:
        polling = asyncio.create_task(server.poll_often())
        try:
            yield
        finally:
            polling.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await polling

    async def page(_: Any) -> FileResponse:
        return FileResponse(STATIC / "page.html")

    routes = [
        Route("/", page),
        WebSocketRoute("/v1/run", server.attend),
        Mount("/static", StaticFiles(directory=STATIC)),
    ]
    return Starlette(routes=routes, lifespan=lifespan)


class _Server:
    def __init__(self, view: View, watcher: Watcher, poll: Callable[[], None], controls: Controls | None) -> None:
        self._view, self._watcher, self._poll, self._controls = view, watcher, poll, controls
        self._viewers = 0
        self._motion: dict[str, Any] = {}
        self._motion_text = self._state_text = ""

    async def poll_often(self) -> None:
        """Bring the view up to date as long as the page is served; texts are made once for all who look."""
        due_s = 0.0
        while True:
            self._poll()
            if self._watcher.message is not self._motion:
                self._motion = self._watcher.message
                self._motion_text = _json(self._motion)
            if due_s <= 0.0:
                due_s = STATE_S
                self._state_text = _json(self._view.state())
            due_s -= FRAME_S
            await asyncio.sleep(FRAME_S)

    async def attend(self, socket_: WebSocket) -> None:
        """Serve one browser: what it has not seen yet is taken from the view whenever it has taken the last."""
        from starlette.websockets import WebSocketDisconnect

        if self._viewers >= MOST_VIEWERS:
            await socket_.close(1013)
            return
        await socket_.accept()
        self._viewers += 1
        sending = asyncio.create_task(self._send(socket_))
        try:
            while True:
                await self._take(socket_, await socket_.receive_text())
        except WebSocketDisconnect:
            pass  # the browser went; there is nothing to keep of it
        finally:
            self._viewers -= 1
            sending.cancel()

    async def _send(self, socket_: WebSocket) -> None:
        view = self._view
        await socket_.send_text(_json(view.hello(controls=self._controls is not None)))
        sent, state, motion = [0] * len(view.series), "", ""
        while True:
            for number, series in enumerate(view.series):
                while sent[number] < len(series):
                    message = series.message(number, sent[number])
                    sent[number] += (len(message) - 16) // 16
                    await socket_.send_bytes(message)
            if state is not self._state_text and state != self._state_text:
                state = self._state_text
                await socket_.send_text(state)
            if motion is not self._motion_text:
                motion = self._motion_text
                await socket_.send_text(motion)
            await asyncio.sleep(FRAME_S if self._viewers <= MANY else MANY_FRAME_S)

    async def _take(self, socket_: WebSocket, text: str) -> None:
        """Do what a browser asks for; what it may not ask for closes the connection."""
        try:
            asked = json.loads(text)
            kind = asked["type"]
            if kind == "region":
                low, high = float(asked["from"]), float(asked["to"])
                if not (math.isfinite(low) and math.isfinite(high)):
                    raise ValueError(text)
                await socket_.send_text(_json(await asyncio.to_thread(self._watcher.region, low, high)))
            elif kind in ("mark", "stop") and self._controls is not None:
                self._controls(kind, " ".join(str(asked.get("text", "")).split())[:LONGEST_MARK])
            else:
                raise ValueError(text)
        except (ValueError, KeyError, TypeError, AttributeError):
            await socket_.close(1003)


def _json(content: Any) -> str:
    """Return JSON that browsers read: what is no number is null."""
    return json.dumps(_finite(content), allow_nan=False)


def _finite(content: Any) -> Any:
    if isinstance(content, dict):
        return {key: _finite(value) for key, value in content.items()}
    if isinstance(content, (list, tuple)):
        return [_finite(value) for value in content]
    return None if isinstance(content, float) and not math.isfinite(content) else content


def serve(
    view: View,
    watcher: Watcher,
    poll: Callable[[], None],
    controls: Controls | None,
    *,
    port: int,
    ready: Callable[[str], None],
    until: Callable[[], bool],
) -> None:
    """Serve the page on this computer until somebody ends it.

    Parameters
    ----------
    view, watcher, poll, controls
        As of :func:`application`.
    port : int
        0 for any that is free.
    ready : callable
        Takes the address to open, with its token, once the page answers.
    until : callable
        Whether it shall end; asked as often as the view is brought up to date.

    Raises
    ------
    OSError
        If the port is taken.
    """
    import uvicorn

    with socket.create_server(("127.0.0.1", port)) as listener:
        port = listener.getsockname()[1]
        gate = Gate(application(view, watcher, lambda: polled(), controls), port)
        config = uvicorn.Config(
            gate,
            log_level="error",
            access_log=False,
            ws_max_size=LONGEST_MESSAGE,
            ws_ping_interval=20,
            timeout_graceful_shutdown=2,
        )
        server = uvicorn.Server(config)
        told, left_s = False, LAST_S

        def polled() -> None:
            nonlocal told, left_s
            poll()
            if not told:
                told = True
                ready(f"http://127.0.0.1:{port}/?token={gate.token}")
            if until():
                left_s -= FRAME_S
            server.should_exit = server.should_exit or left_s <= 0.0

        server.run(sockets=[listener])
