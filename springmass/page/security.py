"""Who may look: the person who started the page, by a link that works once, and nobody from elsewhere.

As notebooks do it: loopback alone, a token in the first address that is exchanged for a cookie, hosts and origins held
to the loopback's names, so that no page of somebody else's can reach this one through the browser.
"""

from __future__ import annotations

import hmac
import secrets
from collections.abc import Awaitable, Callable, MutableMapping
from http.cookies import CookieError, SimpleCookie
from typing import Any
from urllib.parse import parse_qs, urlsplit

__all__ = ["Gate"]

Scope = MutableMapping[str, Any]
App = Callable[[Scope, Callable[[], Awaitable[Any]], Callable[[Any], Awaitable[None]]], Awaitable[None]]

LOOPBACK = frozenset({"127.0.0.1", "localhost", "::1"})
HEADERS = (
    (b"content-security-policy", b"default-src 'self'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'"),
    (b"x-content-type-options", b"nosniff"),
    (b"referrer-policy", b"no-referrer"),
    (b"cache-control", b"no-store"),
)


class Gate:
    """Lets through what comes from the page itself (ASGI middleware).

    Parameters
    ----------
    app : ASGI application
    port : int
        Names the cookie, so that two pages on one machine keep apart.
    """

    def __init__(self, app: App, port: int) -> None:
        self._app = app
        self._cookie = f"springmass-{port}"
        self._secret = secrets.token_urlsafe(24)
        self.token: str | None = secrets.token_urlsafe(24)

    async def __call__(self, scope: Scope, receive: Any, send: Any) -> None:
        """Serve, or refuse."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        headers = {name.lower(): value.decode("latin-1") for name, value in scope["headers"]}
        refusal = self._refusal(scope, headers)
        if refusal is None:
            await self._app(scope, receive, _with_headers(send))
        elif scope["type"] == "websocket":
            await receive()
            await send({"type": "websocket.close", "code": 1008})
        else:
            await self._refuse(scope, send, refusal)

    def _refusal(self, scope: Scope, headers: dict[bytes, str]) -> str | None:
        host = headers.get(b"host", "")
        if _name(f"//{host}") not in LOOPBACK:
            return "this page answers on this computer alone"
        origin = headers.get(b"origin")
        if (origin is not None or scope["type"] == "websocket") and urlsplit(origin or "").netloc != host:
            return "this page answers to its own address alone"
        if self._known(headers):
            return None
        return "open the address that springmass printed: it works once, in one browser"

    def _known(self, headers: dict[bytes, str]) -> bool:
        try:
            cookie = SimpleCookie(headers.get(b"cookie", "")).get(self._cookie)
        except CookieError:
            return False
        return cookie is not None and hmac.compare_digest(cookie.value.encode(), self._secret.encode())

    async def _refuse(self, scope: Scope, send: Any, why: str) -> None:
        given = parse_qs(scope.get("query_string", b"").decode("latin-1")).get("token", [""])[0]
        status, extra, body = 403, [], f"springmass: {why}\n".encode()
        if why.startswith("open") and self.token and hmac.compare_digest(given.encode(), self.token.encode()):
            self.token = None
            cookie = f"{self._cookie}={self._secret}; HttpOnly; SameSite=Strict; Path=/"
            status, extra, body = 303, [(b"location", b"/"), (b"set-cookie", cookie.encode())], b""
        plain = (b"content-type", b"text/plain; charset=utf-8")
        await send({"type": "http.response.start", "status": status, "headers": [plain, *HEADERS, *extra]})
        await send({"type": "http.response.body", "body": body})


def _name(address: str) -> str:
    """Return the host's name in an address, whatever its port; empty where it has none."""
    try:
        return urlsplit(address).hostname or ""
    except ValueError:
        return ""


def _with_headers(send: Any) -> Callable[[Any], Awaitable[None]]:
    async def sending(message: Any) -> None:
        if message["type"] == "http.response.start":
            message = {**message, "headers": [*message["headers"], *HEADERS]}
        await send(message)

    return sending
