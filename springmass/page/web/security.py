"""Who may look, and who may act: the person who started the page, viewers where they are let in, nobody from elsewhere.

As notebooks do it: loopback alone, a token in the first address that is exchanged for a cookie, hosts and origins held
to the page's own names, so that no page of somebody else's can reach this one through the browser. On a local network,
where that was asked for, another token lets in as many as have it, to look and not to act.
"""

from __future__ import annotations

import hashlib
import hmac
import secrets
from collections.abc import Awaitable, Callable, MutableMapping
from http.cookies import CookieError, SimpleCookie
from typing import Any, Literal
from urllib.parse import parse_qs, urlsplit

__all__ = ["ROLE", "Gate", "Role"]

Scope = MutableMapping[str, Any]
App = Callable[[Scope, Callable[[], Awaitable[Any]], Callable[[Any], Awaitable[None]]], Awaitable[None]]
Role = Literal["controller", "viewer"]

ROLE = "springmass.role"
"""Where a request's scope says who asks."""
LOOPBACK = frozenset({"127.0.0.1", "localhost", "::1"})
PAGE_POLICY = b"default-src 'self'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'"
REPORT_POLICY = b"default-src 'none'; style-src 'unsafe-inline'; img-src data:; frame-ancestors 'none'; base-uri 'none'"
"""A report is one file with its styles and pictures in it, and runs nothing."""
HEADERS = (
    (b"x-content-type-options", b"nosniff"),
    (b"referrer-policy", b"no-referrer"),
    (b"cache-control", b"no-store"),
)


class Gate:
    """Lets through what comes from the page itself, and says as whom (ASGI middleware).

    Parameters
    ----------
    app : ASGI application
    port : int
        Names the cookie, so that two pages on one machine keep apart.
    secret : str
        What cookies and tokens are made of: with the same one, a page that was started again knows its browsers. Left
        out, one of its own.
    hosts : collection of str
        Addresses, beside the loopback's names, by which viewers may ask; none: nobody but this computer.
    used : bool
        Whether the controller's link has been used before.

    Attributes
    ----------
    token : str or None
        Lets in one browser, to act; None once it was used.
    viewers_token : str
        Lets in any, to look.
    """

    def __init__(
        self, app: App, port: int, secret: str = "", hosts: frozenset[str] = frozenset(), *, used: bool = False
    ) -> None:
        self._app = app
        self._secret = (secret or secrets.token_urlsafe(24)).encode()
        self._cookie = f"springmass-{port}"
        self._hosts = LOOPBACK | hosts
        self._open_to_viewers = bool(hosts)
        self._cookies: dict[Role, str] = {"controller": self._made("act"), "viewer": self._made("look")}
        self.token: str | None = None if used else self._made("act once")
        self.viewers_token = self._made("look on")

    def _made(self, what: str) -> str:
        return hmac.new(self._secret, what.encode(), hashlib.sha256).hexdigest()[:32]

    async def __call__(self, scope: Scope, receive: Any, send: Any) -> None:
        """Serve, or refuse."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        headers = {name.lower(): value.decode("latin-1") for name, value in scope["headers"]}
        refusal = self._refusal(scope, headers)
        role = self._role(headers)
        if refusal is None and role is not None:
            scope[ROLE] = role
            await self._app(scope, receive, _with_headers(send, scope.get("path", "")))
        elif scope["type"] == "websocket":
            await receive()
            await send({"type": "websocket.close", "code": 1008})
        else:
            await self._refuse(scope, send, refusal)

    def _refusal(self, scope: Scope, headers: dict[bytes, str]) -> str | None:
        host = headers.get(b"host", "")
        if _name(f"//{host}") not in self._hosts:
            return "this page answers to the addresses that springmass printed alone"
        origin = headers.get(b"origin")
        if (origin is not None or scope["type"] == "websocket") and _netloc(origin or "") != host:
            return "this page answers to its own address alone"
        return None

    def _role(self, headers: dict[bytes, str]) -> Role | None:
        try:
            cookie = SimpleCookie(headers.get(b"cookie", "")).get(self._cookie)
        except CookieError:
            return None
        given = "" if cookie is None else cookie.value
        return next((role for role, value in self._cookies.items() if _same(given, value)), None)

    async def _refuse(self, scope: Scope, send: Any, why: str | None) -> None:
        """Refuse, or exchange a token for its cookie."""
        given = parse_qs(scope.get("query_string", b"").decode("latin-1")).get("token", [""])[0]
        status, extra = 403, []
        body = f"springmass: {why or 'open the address that springmass printed: it works once, in one browser'}\n"
        role = None if why else self._exchanged(given)
        if role is not None:
            cookie = f"{self._cookie}={self._cookies[role]}; HttpOnly; SameSite=Strict; Path=/"
            status, extra, body = 303, [(b"location", b"/"), (b"set-cookie", cookie.encode())], ""
        policy = (b"content-security-policy", PAGE_POLICY)
        plain = (b"content-type", b"text/plain; charset=utf-8")
        await send({"type": "http.response.start", "status": status, "headers": [plain, policy, *HEADERS, *extra]})
        await send({"type": "http.response.body", "body": body.encode()})

    def _exchanged(self, given: str) -> Role | None:
        if self.token is not None and _same(given, self.token):
            self.token = None
            return "controller"
        return "viewer" if self._open_to_viewers and _same(given, self.viewers_token) else None


def _same(given: str, wanted: str) -> bool:
    return hmac.compare_digest(given.encode(), wanted.encode())


def _netloc(address: str) -> str:
    """Return host and port of an address; empty where it is none."""
    try:
        return urlsplit(address).netloc
    except ValueError:
        return ""


def _name(address: str) -> str:
    """Return the host's name in an address, whatever its port; empty where it has none."""
    try:
        return urlsplit(address).hostname or ""
    except ValueError:
        return ""


def _with_headers(send: Any, path: str) -> Callable[[Any], Awaitable[None]]:
    policy = (b"content-security-policy", REPORT_POLICY if path == "/v1/report" else PAGE_POLICY)

    async def sending(message: Any) -> None:
        if message["type"] == "http.response.start":
            message = {**message, "headers": [*message["headers"], policy, *HEADERS]}
        await send(message)

    return sending
