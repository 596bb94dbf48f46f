"""Nobody but whoever started the page sees it."""

import asyncio
import re
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest

from springmass.charts.browser import script_sha256
from springmass.page.web.security import ACT, VIEW, Access, guarded

HOST = "127.0.0.1:8000"


class Page:
    """A page behind its checks: an access, and what each request that came through may do."""

    def __init__(self, **options: Any) -> None:
        self.access = Access(8000, **options)
        self.served: list[list[str]] = []
        self._guarded = guarded(self._serve, self.access, ["192.168.1.5"] if options.get("viewers") else [])

    async def _serve(self, scope: Any, receive: Any, send: Any) -> None:
        self.served.append(scope["auth"].scopes)
        await send({"type": "http.response.start", "status": 200, "headers": []})
        await send({"type": "http.response.body", "body": b"page"})

    def ask(
        self, *, kind: str = "http", path: str = "/", query: str = "", **headers: str
    ) -> tuple[int, dict[str, str]]:
        """Return the status and the headers that a request gets; of a refused WebSocket 0."""
        sent: list[dict[str, Any]] = []

        async def send(message: Any) -> None:
            sent.append(message)

        async def receive() -> dict[str, str]:
            return {"type": "websocket.connect"}

        given = [(name.encode(), value.encode("latin-1")) for name, value in headers.items()]
        scope = {"type": kind, "path": path, "query_string": query.encode(), "headers": given}
        # A browser of other tests may keep a loop running in this thread.
        with ThreadPoolExecutor(1) as thread:
            thread.submit(asyncio.run, self._guarded(scope, receive, send)).result()
        first = sent[0]
        got = {name.decode(): value.decode() for name, value in first.get("headers", ())}
        return int(first.get("status", 0)), got

    def cookie_for(self, token: str, host: str = HOST) -> str:
        """Exchange a token for its cookie."""
        status, headers = self.ask(query=f"token={token}", host=host)
        assert (status, headers["location"]) == (303, "/")
        value, *flags = headers["set-cookie"].split("; ")
        assert {"HttpOnly", "SameSite=strict"} <= set(flags)
        return value


@pytest.fixture
def page() -> Page:
    """Return a page for this computer alone."""
    return Page()


@pytest.fixture
def known(page: Page) -> str:
    """Return the cookie of the page's controller."""
    return page.cookie_for(page.access.token)


def test_the_token_gives_the_cookie_and_leaves_the_address(page: Page, known: str) -> None:
    """Other tokens are refused, a link is never served as it stands; what is served carries the policies."""
    for token in ("", "None", page.access.viewers_token):
        assert page.ask(query=f"token={token}", host=HOST)[0] == 403
    assert page.ask(query=f"token={page.access.token}", host=HOST, cookie=known)[0] == 303
    status, headers = page.ask(host=HOST, cookie=known)
    assert (status, page.served) == (200, [[VIEW, ACT]])
    assert headers["content-security-policy"].startswith("default-src 'self'")
    assert (headers["x-content-type-options"], headers["cache-control"]) == ("nosniff", "no-store")


def test_a_report_runs_its_script_alone(page: Page, known: str) -> None:
    """Its policy allows its styles and pictures, and one script by its digest."""
    policy = page.ask(path="/v2/report", host=HOST, cookie=known)[1]["content-security-policy"]
    assert policy.startswith("default-src 'none'")
    assert re.findall(r"script-src ([^;]*);", policy) == [f"'sha256-{script_sha256()}'"]


def test_refusals_carry_the_policies_too(page: Page) -> None:
    """Of a host, and of a browser that is not known."""
    for host in ("evil.example", HOST):
        status, headers = page.ask(host=host)
        assert status in (400, 403)
        assert headers["content-security-policy"].startswith("default-src 'self'")


def test_viewers_look_and_do_not_act() -> None:
    """Their token opens as often as it is used, by the network's address; without viewers it opens nothing."""
    shared = Page(viewers=True)
    for _ in range(2):
        cookie = shared.cookie_for(shared.access.viewers_token, "192.168.1.5:8000")
        assert shared.ask(host="192.168.1.5:8000", cookie=cookie)[0] == 200
    assert shared.served == [[VIEW], [VIEW]]
    alone = Page()
    assert alone.ask(query=f"token={alone.access.viewers_token}", host=HOST)[0] == 403


@pytest.mark.parametrize("host", ["evil.example", "127.0.0.1.evil.example", "", "[", "10.0.0.7:8000"])
def test_other_hosts_are_refused(page: Page, known: str, host: str) -> None:
    """A name that somebody else's server may give to this computer is no name of the page."""
    assert page.ask(host=host, cookie=known)[0] == 400
    assert page.ask(kind="websocket", host=host, origin=f"http://{host}", cookie=known)[0] == 0
    assert not page.served


@pytest.mark.parametrize("host", ["127.0.0.1:8000", "localhost:1234", "[::1]:8000"])
def test_the_loopback_is_served_by_any_name_and_port(page: Page, known: str, host: str) -> None:
    """Behind a tunnel the port is another."""
    assert page.ask(host=host, cookie=known)[0] == 200


@pytest.mark.parametrize("origin", [None, "http://evil.example", "http://127.0.0.1:9000", "null"])
def test_a_socket_from_another_page_is_refused(page: Page, known: str, origin: str | None) -> None:
    """Cookie or no cookie: browsers send it along, whatever page asks."""
    extra = {} if origin is None else {"origin": origin}
    assert page.ask(kind="websocket", host=HOST, cookie=known, **extra)[0] == 0
    assert not page.served


@pytest.mark.parametrize("known", ["", "springmass-8000=wrong", "springmass-8001=x", '"', "springmass-8000=\xff"])
def test_without_the_cookie_nothing_is_served(page: Page, known: str) -> None:
    """And the answer says how to get it."""
    assert page.ask(host=HOST, cookie=known)[0] == 403
    assert not page.served
