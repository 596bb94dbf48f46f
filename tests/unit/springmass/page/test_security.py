"""Nobody but whoever started the page sees it."""

from __future__ import annotations

import contextlib
from typing import Any

import pytest

from springmass.page.web.security import Gate


class Served:
    """Counts what came through the gate."""

    def __init__(self) -> None:
        self.count = 0

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        """Answer."""
        self.count += 1
        await send({"type": "http.response.start", "status": 200, "headers": []})
        await send({"type": "http.response.body", "body": b"page"})


def ask(gate: Gate, *, kind: str = "http", query: str = "", **headers: str) -> tuple[int, dict[bytes, bytes]]:
    """Return the status and the headers that a request gets; of a refused WebSocket its closing code."""
    sent: list[dict[str, Any]] = []

    async def send(message: dict[str, Any]) -> None:
        sent.append(message)

    async def receive() -> dict[str, str]:
        return {"type": "websocket.connect"}

    given = [(name.encode(), value.encode("latin-1")) for name, value in headers.items()]
    scope = {"type": kind, "query_string": query.encode(), "headers": given}
    with contextlib.suppress(StopIteration):  # nothing in it waits, so one step is all of it
        gate(scope, receive, send).send(None)
    first = sent[0]
    return int(first.get("status", first.get("code"))), dict(first.get("headers", ()))


@pytest.fixture
def served() -> Served:
    """Return the page behind the gate."""
    return Served()


@pytest.fixture
def cookie(served: Served) -> tuple[Gate, str]:
    """Return a gate and the cookie that its token was exchanged for."""
    gate = Gate(served, 8000)
    status, headers = ask(gate, query=f"token={gate.token}", host="127.0.0.1:8000")
    assert status == 303
    assert headers[b"location"] == b"/"
    assert b"HttpOnly; SameSite=Strict" in headers[b"set-cookie"]
    return gate, headers[b"set-cookie"].split(b";")[0].decode()


def test_the_token_opens_once_and_the_cookie_from_then_on(served: Served, cookie: tuple[Gate, str]) -> None:
    """The second use of the link is refused; what is served carries the policies."""
    gate, known = cookie
    assert gate.token is None
    assert ask(gate, query="token=", host="127.0.0.1:8000")[0] == 403
    assert ask(gate, query="token=None", host="127.0.0.1:8000")[0] == 403
    status, headers = ask(gate, host="127.0.0.1:8000", cookie=known)
    assert status == 200
    assert headers[b"content-security-policy"].startswith(b"default-src 'self'")
    assert served.count == 1


@pytest.mark.parametrize("host", ["evil.example", "127.0.0.1.evil.example", "", "[", "10.0.0.7:8000"])
def test_other_hosts_are_refused(served: Served, cookie: tuple[Gate, str], host: str) -> None:
    """A name that somebody else's server may give to this computer is no name of the page."""
    gate, known = cookie
    assert ask(gate, host=host, cookie=known)[0] == 403
    assert served.count == 0


@pytest.mark.parametrize("host", ["127.0.0.1:8000", "localhost:1234", "[::1]:8000"])
def test_the_loopback_is_served_by_any_name_and_port(cookie: tuple[Gate, str], host: str) -> None:
    """Behind a tunnel the port is another."""
    gate, known = cookie
    assert ask(gate, host=host, cookie=known)[0] == 200


@pytest.mark.parametrize("origin", [None, "http://evil.example", "http://127.0.0.1:9000", "null"])
def test_a_socket_from_another_page_is_refused(served: Served, cookie: tuple[Gate, str], origin: str | None) -> None:
    """Cookie or no cookie: browsers send it along, whatever page asks."""
    gate, known = cookie
    extra = {} if origin is None else {"origin": origin}
    assert ask(gate, kind="websocket", host="127.0.0.1:8000", cookie=known, **extra)[0] == 1008
    assert served.count == 0


@pytest.mark.parametrize("known", ["", "springmass-8000=wrong", "springmass-8001=x", '"', "springmass-8000=\xff"])
def test_without_the_cookie_nothing_is_served(served: Served, known: str) -> None:
    """And the answer says how to get it."""
    gate = Gate(served, 8000)
    assert ask(gate, host="127.0.0.1:8000", cookie=known)[0] == 403
    assert served.count == 0
