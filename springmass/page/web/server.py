"""The page's server: its files, its messages to viewers, the few that they send, and the address to share."""

from __future__ import annotations

import asyncio
import contextlib
import io
import json
import logging
import socket
from collections.abc import AsyncIterator, Callable, Sequence
from pathlib import Path
from typing import Any

import uvicorn
from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.responses import FileResponse, HTMLResponse, Response
from starlette.routing import BaseRoute, Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.websockets import WebSocket, WebSocketDisconnect

from springmass import charts
from springmass.charts.looks import looks_script
from springmass.errors import LOG, SENSOR, ProgramError
from springmass.page.state import REQUESTS, PageState
from springmass.page.view import View, json_of
from springmass.page.web.security import ACT, REPORT, Access, guarded
from springmass.report.html import page_style
from springmass.session.failures import raised_at
from storage.errors import one_line

PAGE_LOG = logging.getLogger("page")  # not below "springmass", whose messages are all printed
PAGE_FILES = Path(__file__).parents[1] / "static"
"""The files of this page alone; those of all charts are in the room of charts."""
TURN_S = 0.0225
"""Time between two reads of the log: little longer than a screen frame; samples reach the screen within 40 ms."""
MANY_VIEWERS, EVERY = 4, 4
"""With more viewers than MANY_VIEWERS, samples are sent after every fourth read of the log, eleven times a second."""
STATE_S = 0.5
LAST_S = 1.5
"""Time for which the page is still served after the end, so that viewers see that the run has ended."""
ALONE_S = 30.0
"""Time after which a page without viewers ends, once the run that it recorded is saved."""
MOST_CONNECTIONS = 256
LONGEST_MESSAGE, LONGEST_TEXT = 4096, 500
"""Maximum size of a browser's message in bytes, and of a text in it in characters."""


class Refused(Exception):
    """A message that a browser may not send."""


def checked(text: str | None) -> dict[str, Any]:
    """Return a browser's request with only its own values; Refused for everything else."""
    try:
        request = json.loads(text or "")
        accepted = {"type": request["type"]}
        for name, limits in REQUESTS[request["type"]][0].items():
            if limits is None:
                accepted[name] = " ".join(request[name].split())[:LONGEST_TEXT]
            elif limits[0] <= (number := float(request[name])) <= limits[1]:
                accepted[name] = number
            else:
                raise ValueError
    # These include the errors for integers of thousands of digits and for deeply nested lists.
    except (ValueError, KeyError, TypeError, AttributeError, OverflowError, RecursionError) as error:
        raise Refused("a message that is none of the page's") from error
    return accepted


class Server:
    """Reads the log in turns, and sends each browser what it does not have yet; ``viewers`` is their number."""

    def __init__(self, page: PageState, share: str, polled: Callable[[int], None]) -> None:
        self._page, self._share, self._polled = page, share, polled
        self._viewers = 0
        self._turn, self._due_s, self._bench = 0, 0.0, page.bench
        self._turned = asyncio.Event()
        self._next: asyncio.TimerHandle | None = None
        # Texts by type, and frames by series and first sample; encoded once for all viewers.
        self._texts: dict[str, str] = {}
        self._frames: dict[tuple[int, int, int], bytes] = {}

    @contextlib.asynccontextmanager
    async def reading(self, _: Starlette) -> AsyncIterator[None]:
        """Read the log until the context ends."""
        self._look()
        try:
            yield
        finally:
            if self._next is not None:
                self._next.cancel()

    def _look(self) -> None:
        # This is a timer's callback because a sleeping task would wake twice per turn.
        self._next = asyncio.get_running_loop().call_later(TURN_S, self._look)
        try:
            self._update()
        except Exception:  # a defect; the next turn may succeed
            PAGE_LOG.exception("the page could not be brought up to date")
        self._polled(self._viewers)

    def _update(self) -> None:
        page = self._page
        page.poll()
        if page.watcher is not None:
            self._texts |= {"motion": page.watcher.text, "update": page.watcher.update}
        self._due_s -= TURN_S
        if self._due_s <= 0.0 or self._bench is not page.bench:
            self._due_s, self._bench = STATE_S, page.bench
            self._texts["state"] = json_of(page.state())
        self._frames.clear()
        self._turn += 1
        if self._viewers <= MANY_VIEWERS or self._turn % EVERY == 0:
            turned, self._turned = self._turned, asyncio.Event()
            turned.set()

    async def attend(self, browser: WebSocket) -> None:
        """Serve one browser until it leaves, or close its connection: 1003 for a forbidden message, 1011 for a defect.

        New data are taken from the view whenever the browser has received the previous data.
        """
        client = browser.client.host if browser.client else ""
        with contextlib.suppress(WebSocketDisconnect):
            await browser.accept()
            self._viewers += 1
            tasks = [asyncio.create_task(each(browser)) for each in (self._receive, self._send)]
            try:
                await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            finally:
                self._viewers -= 1
                for task in tasks:
                    task.cancel()
                ends = await asyncio.gather(*tasks, return_exceptions=True)
            error = next(end for end in ends if not isinstance(end, asyncio.CancelledError))
            if isinstance(error, Refused):
                PAGE_LOG.warning("%s sent %s; its connection is closed", client, error)
                await browser.close(1003)
            elif not isinstance(error, WebSocketDisconnect):
                PAGE_LOG.error("a defect of the page closed the connection of %s", client, exc_info=error)
                await browser.close(1011)

    async def _receive(self, browser: WebSocket) -> None:
        while True:
            message = await browser.receive()
            if message["type"] == "websocket.disconnect":
                raise WebSocketDisconnect(message.get("code", 1005))
            request = checked(message.get("text"))
            if request["type"] == "region":
                if (watcher := self._page.watcher) is not None:
                    await browser.send_text(await asyncio.to_thread(watcher.region, request["from"], request["to"]))
            elif ACT in browser.auth.scopes:
                self._page.ask(request)
            else:
                raise Refused("a command, and may only view")

    async def _send(self, browser: WebSocket) -> None:
        view: View | None = None
        sent: list[int] = []
        texts: dict[str, str] = {}
        while True:
            if self._page.view is not None and view is not self._page.view:
                view = self._page.view
                sent, texts = [0] * len(view.series), {}
                acts = ACT in browser.auth.scopes
                hello = view.hello(controls=acts and self._page.controls is not None)
                role = {"role": "controller" if acts else "viewer", "share": self._share}
                await browser.send_text(json_of(hello | role))
            if view is not None:
                for number, series in enumerate(view.series):
                    while sent[number] < len(series):
                        frame = self._frame(view, number, sent[number])
                        sent[number] += (len(frame) - 16) // 16
                        await browser.send_bytes(frame)
                for kind in ("state", "motion", "update"):
                    if view is not self._page.view:
                        break  # it was replaced meanwhile; texts about the next one must wait for its hello message
                    text = self._texts.get(kind, "")
                    if text and text is not texts.get(kind):
                        texts[kind] = text
                        await browser.send_text(text)
            await self._turned.wait()

    def _frame(self, view: View, number: int, first: int) -> bytes:
        key = (id(view), number, first)
        if key not in self._frames:
            self._frames[key] = view.series[number].message(number, first)
        return self._frames[key]


def page_of(name: str) -> HTMLResponse:
    """Return a page: the head that all pages share, with the name of its style sheet, and its body."""
    head, body = ((PAGE_FILES / f"{each}.html").read_text("utf-8") for each in ("head", name))
    return HTMLResponse(head.replace("PAGE", name) + body)


def application(page: PageState, share: str = "", polled: Callable[[int], None] = lambda _: None) -> Starlette:
    """Return the page as an ASGI application without access control.

    ``share`` is the address for viewers, if they are admitted; ``polled`` is called after every read of the log, with
    the number of viewers.
    """
    server = Server(page, share, polled)

    def report(_: Any) -> Response:
        if page.after is None or page.after.report is None:
            raise HTTPException(404, "springmass: no report has been made; the page makes one on O\n")
        return FileResponse(page.after.report, media_type="text/html")

    def code(_: Any) -> Response:
        if not share:
            raise HTTPException(404, "springmass: the page is not open to viewers; --lan opens it\n")
        return Response(code_svg(share), media_type="image/svg+xml")

    routes = [
        Route("/", lambda _: page_of("page")),
        Route(REPORT, report),
        Route("/v2/code.svg", code),
        WebSocketRoute("/v2/run", server.attend),
        *static_files(),
    ]
    return Starlette(routes=routes, lifespan=server.reading)


def static_files() -> list[BaseRoute]:
    """Return the routes of the files that never change: those of the page and of all charts."""
    return [
        Route("/static/looks.js", lambda _: Response(looks_script(), media_type="text/javascript")),
        Route("/static/report.css", lambda _: Response(page_style(), media_type="text/css")),
        Mount("/static", StaticFiles(directory=PAGE_FILES, packages=[(charts.__name__, "static")])),
    ]


def serve(
    page: PageState, *, port: int, network: str, opened: Callable[[str, str], None], over: Callable[[], bool]
) -> None:
    """Serve the page until somebody ends it; OSError if the port is taken.

    ``port`` 0 is any free one. ``network`` is this computer's address in the local network, for viewers; if it is
    empty, only this computer may open the page. ``opened`` is called once the page answers, with its address and that
    for viewers; ``over`` returns whether the recording has ended.
    """
    with socket.create_server(("0.0.0.0" if network else "127.0.0.1", port)) as listener:
        port = listener.getsockname()[1]
        access = Access(port, viewers=bool(network))
        share = f"http://{network}:{port}/?token={access.viewers_token}" if network else ""
        announced, left_s, alone_s = False, LAST_S, ALONE_S

        def polled(viewers: int) -> None:
            nonlocal announced, left_s, alone_s
            if not announced:
                announced = True
                opened(f"http://127.0.0.1:{port}/?token={access.token}", share)
            left_s -= TURN_S if over() else 0.0
            after = page.after is not None and page.after.ours
            alone_s = alone_s - TURN_S if after and not viewers else ALONE_S
            server.should_exit = server.should_exit or page.closed or left_s <= 0.0 or alone_s <= 0.0

        server = server_of(application(page, share, polled), access, [network] if network else [])
        server.run(sockets=[listener])


def server_of(app: Starlette, access: Access, hosts: Sequence[str] = (), ping_s: float | None = 20.0) -> uvicorn.Server:
    """Return the server of an application with access control; ``ping_s`` is how often sockets must answer."""
    config = uvicorn.Config(
        guarded(app, access, hosts),
        http="h11",
        limit_concurrency=MOST_CONNECTIONS,
        log_config=None,
        log_level="warning",
        access_log=False,
        ws_max_size=LONGEST_MESSAGE,
        ws_ping_interval=ping_s,
        ws_per_message_deflate=False,  # it does not shorten a few samples, and costs more time than everything else
        timeout_graceful_shutdown=2,
    )
    logging.getLogger().addHandler(_Lines())
    logging.captureWarnings(True)
    return uvicorn.Server(config)


class _Lines(logging.Handler):
    """Writes each kind of message once, as one line without a traceback, whatever clients do and however often."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self._written: set[str] = set()

    def emit(self, record: logging.LogRecord) -> None:
        if record.msg in self._written:
            return
        self._written.add(record.msg)
        text = " ".join(record.getMessage().split())[:300]
        if record.exc_info and (error := record.exc_info[1]) is not None:
            text += f": {type(error).__name__} at {raised_at(error)}: {one_line(error)[:200]}"
        LOG.warning(f"page: {text}")


ELSEWHERE = ("192.0.2.1", 9)
"""An address for documentation (RFC 5737): nothing is sent to it; the system only chooses the route to it."""


def address_in_network() -> str:
    """Return this computer's address in the network through which it would send."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(ELSEWHERE)
        except OSError as error:
            raise ProgramError(
                f"--lan: no network ({error.strerror})", "join one, or leave --lan out", SENSOR
            ) from error
        return str(probe.getsockname()[0])


def code_svg(address: str) -> bytes:
    """Return an address as a QR code in SVG format, dark on light and with a quiet zone."""
    import segno

    made = io.BytesIO()
    segno.make(address, micro=False).save(made, kind="svg", scale=5, border=4, light="#ffffff", dark="#000000")
    return made.getvalue()


def code_for_terminal(address: str) -> str:
    """Return an address as a QR code of block characters."""
    import segno

    made = io.StringIO()
    segno.make(address, micro=False).terminal(made, compact=True)
    return made.getvalue()
