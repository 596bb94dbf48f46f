"""The window on the network: its page, what pages send and are sent, and when its server ends."""

from __future__ import annotations

import asyncio
import contextlib
import inspect
import json
import socket
from collections.abc import AsyncIterator, Callable, Mapping
from pathlib import Path
from typing import Any

from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect

from springmass.loading.load import sample_data
from springmass.page.web.security import ACT, Access
from springmass.page.web.server import page_of, server_of, static_files
from springmass.page.window.cards import Cards, NotTaken, checked
from springmass.page.window.recording import ports

DESERTED_S, FIRST_S = 60.0, 600.0
"""Time after which the server ends when the last page is gone, and when none ever came."""
LONGEST_REQUEST = 1 << 18
OWN_HEADER = ("x-springmass", "window")
"""A header that no page of another origin can send without being asked first, and the answer to that is no."""
MALFORMED = (KeyError, TypeError, ValueError, AttributeError, RecursionError)
"""What a request raises that does not have the form of one."""
TAKEN = {name: f"report/{name}" for name in ("results.csv", "amplitude.csv", "table.tex", "results.json")} | {
    name: name for name in ("figures.zip", "run.h5")
}
SHOWN = {"shown": "results.json", "report": "report/report.html"}
"""The files of a card that a page may load or show, by the end of their address."""
ACTIONS: Mapping[str, Callable[[Cards, str, Mapping[str, Any]], Any]] = {
    "open": lambda cards, card, asked: cards.open_drop(asked["drop"], card),
    "examples": lambda cards, *_: cards.examples(sample_data()),
    "change": lambda cards, card, asked: cards.change(card, asked["changes"]),
    "separate": lambda cards, card, _: cards.separate(card),
    "stop": lambda cards, card, _: cards.children.forget(card, "You stopped it"),
    "remove": lambda cards, card, _: cards.remove(card),
    "write": lambda cards, card, asked: cards.write(card, str(asked["what"])),
    "judge": lambda cards, card, asked: cards.of_card(card, "judge", **checked({"rows": asked["rows"]})),
    "compare": lambda cards, _, asked: cards.compare(asked),
    "ports": lambda *_: ports(),
    "record": lambda cards, _, asked: cards.record(asked),
    "end": lambda cards, *_: cards.recorder.end(),
    "restore": lambda cards, _, asked: cards.restore(asked["window"], forget=False),
    "forget": lambda cards, _, asked: cards.restore(asked["window"], forget=True),
}
"""What a page may ask, with the card that it is about and the whole request."""


class Window:
    """What pages may ask of the cards, and how many pages there are."""

    def __init__(self, cards: Cards) -> None:
        self._cards, self.pages = cards, 0
        self.quiet_s = DESERTED_S - FIRST_S

    def application(self, life: Callable[[Starlette], Any]) -> Starlette:
        """Return the window as an ASGI application without access control."""
        routes = [
            Route("/", lambda _: page_of("window")),
            Route("/window/files", self.receive, methods=["POST"]),
            Route("/window/do", self.do, methods=["POST"]),
            Route("/window/cards/{card}/{what}", self.taken),
            WebSocketRoute("/window/events", self.attend),
            *static_files(),
        ]
        answers: dict[Any, Any] = {NotTaken: lambda _, error: JSONResponse({"refused": str(error)}, 409)}
        malformed = JSONResponse({"refused": "the window takes no such request"}, 400)
        answers |= dict.fromkeys(MALFORMED, lambda *_: malformed)
        return Starlette(routes=routes, lifespan=life, exception_handlers=answers)

    async def receive(self, request: Request) -> Response:
        """Take a file of a drop."""
        demand_own(request)
        drop, folder, name = (request.query_params[each] for each in ("drop", "folder", "name"))
        await self._cards.receive(drop, folder, name, request.stream())
        return JSONResponse({})

    async def do(self, request: Request) -> Response:
        """Carry out what a page asks, and answer with the file that was made, or with what was found."""
        demand_own(request)
        content = b""
        async for data in request.stream():
            content += data
            if len(content) > LONGEST_REQUEST:
                raise ValueError
        asked = json.loads(content)
        act = ACTIONS.get(str(asked.get("do")))
        if act is None:
            raise NotTaken("the window does no such thing")
        done = act(self._cards, str(asked.get("card", "")), asked)
        found = await done if inspect.isawaitable(done) else done
        if isinstance(found, Path):
            return FileResponse(found, media_type="application/json")
        return JSONResponse(found or {})

    async def taken(self, request: Request) -> Response:
        """Answer with a file of a card, to show or to take away."""
        card, what = self._cards.cards.get(request.path_params["card"]), request.path_params["what"]
        if card is None or not (path := card.folder / (TAKEN | SHOWN).get(what, "nothing")).is_file():
            raise HTTPException(404, "springmass: this has not been made yet, or was removed\n")
        if what in SHOWN:
            return FileResponse(path)
        return FileResponse(path, filename=f"{Path(card.kept['name']).stem}{'.h5' if what == 'run.h5' else f'-{what}'}")

    async def attend(self, browser: WebSocket) -> None:
        """Send a page everything, and then what changes; it is gone when its connection closes."""
        await browser.accept()
        self.pages += 1
        sending = asyncio.create_task(self._send(browser))
        try:
            with contextlib.suppress(WebSocketDisconnect):
                await browser.receive_text()  # a page only listens here
                await browser.close(1003)
        finally:
            self.pages -= 1
            sending.cancel()
            await asyncio.gather(sending, return_exceptions=True)

    async def _send(self, browser: WebSocket) -> None:
        revision = -1
        while True:
            turned, messages = self._cards.turned, self._cards.since(revision)
            revision = self._cards.revision
            for message in messages:
                await browser.send_text(json.dumps(message))
            await turned.wait()

    async def reading(self, over: Callable[[], None]) -> None:
        """Call ``over`` once no page has been there for a while and nothing is recorded."""
        self._cards.children.prepare()
        while True:
            await asyncio.sleep(1.0)
            busy = self._cards.look()
            self.quiet_s = 0.0 if self.pages or busy else self.quiet_s + 1.0
            if self.quiet_s >= DESERTED_S:
                over()


def demand_own(request: Request) -> None:
    """Refuse a request that is not of the page itself, with its cookie, its origin and its header."""
    owns = ACT in request.auth.scopes and "origin" in request.headers
    if not owns or request.headers.get(OWN_HEADER[0]) != OWN_HEADER[1]:
        raise HTTPException(403, "springmass: only the window itself may change something\n")


def serve_window(cards: Cards, begin: Callable[[], None], *, port: int, opened: Callable[[str, str], None]) -> None:
    """Serve the window until nobody looks at it any more; OSError if the port is taken.

    ``begin`` is called once the server runs, ``opened`` with its address.
    """
    with socket.create_server(("127.0.0.1", port)) as listener:
        port = listener.getsockname()[1]
        access, window = Access(port), Window(cards)

        @contextlib.asynccontextmanager
        async def life(_: Starlette) -> AsyncIterator[None]:
            begin()
            opened(f"http://127.0.0.1:{port}/?token={access.token}", "")
            ticking = asyncio.create_task(window.reading(lambda: setattr(server, "should_exit", True)))
            try:
                yield
            finally:
                ticking.cancel()
                cards.close()

        # A page whose computer sleeps does not answer, and is not gone.
        server = server_of(window.application(life), access, ping_s=None)
        server.run(sockets=[listener])
