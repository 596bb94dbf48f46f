"""Rights to view and to act: for the person who started the page, for viewers if admitted, and for nobody else.

As with notebooks, the page by default listens only on the loopback interface. The token in its address is exchanged for
a cookie. Host and origin must be the page's own, so that no foreign page can reach this one through the browser. If the
user opens the page to the local network, another token lets everybody who has it view the page, but not act.
"""

from __future__ import annotations

import hmac
import secrets
from collections.abc import Iterable

from starlette.authentication import AuthCredentials, AuthenticationBackend, AuthenticationError, BaseUser, SimpleUser
from starlette.datastructures import MutableHeaders
from starlette.middleware.authentication import AuthenticationMiddleware
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.requests import HTTPConnection
from starlette.responses import PlainTextResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from springmass.charts.browser import script_sha256

VIEW, ACT = "view", "act"
"""Rights of a request; the controller has both."""
LOOPBACK = ("127.0.0.1", "localhost", "[::1]")
REPORT = "/v2/report"
PAGE_POLICY = "default-src 'self'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'"
REPORT_POLICY = (
    f"default-src 'none'; script-src 'sha256-{script_sha256()}'; style-src 'unsafe-inline'; img-src data:; "
    "frame-ancestors 'none'; base-uri 'none'"
)
"""The policy for a report: a single file with inline styles and pictures, which runs only the script of its charts."""
HEADERS = {"X-Content-Type-Options": "nosniff", "Referrer-Policy": "no-referrer", "Cache-Control": "no-store"}


def guarded(app: ASGIApp, access: Access, hosts: Iterable[str] = ()) -> ASGIApp:
    """Return an application with security headers that serves only known browsers, and only under its own names.

    ``auth.scopes`` of its requests contains :data:`VIEW` and, for the controller, :data:`ACT`. ``hosts`` are names
    besides those of the loopback.
    """
    own_hosts_only = TrustedHostMiddleware(
        AuthenticationMiddleware(app, access, access.answer), [*LOOPBACK, *hosts], www_redirect=False
    )

    async def with_headers(scope: Scope, receive: Receive, send: Send) -> None:
        policy = REPORT_POLICY if scope.get("path", "").endswith("/report") else PAGE_POLICY

        async def sending(message: Message) -> None:
            if message["type"] == "http.response.start":
                MutableHeaders(scope=message).update({**HEADERS, "Content-Security-Policy": policy})
            # uvicorn logs an error if a socket gets an answer instead of its handshake, but not if it is closed.
            if message["type"] == "websocket.http.response.start":
                message = {"type": "websocket.close", "code": 1008}
            if message["type"] != "websocket.http.response.body":
                await send(message)

        await own_hosts_only(scope, receive, sending)

    return with_headers


class Access(AuthenticationBackend):
    """Recognises browsers by the page's cookie: ``token`` lets a browser act, ``viewers_token`` lets it view.

    The cookie's name contains the port, so that two pages on one machine have different cookies.
    """

    def __init__(self, port: int, *, viewers: bool = False) -> None:
        self._cookie = f"springmass-{port}"
        self._viewers = viewers
        self.token, self.viewers_token = secrets.token_urlsafe(24), secrets.token_urlsafe(24)

    async def authenticate(self, conn: HTTPConnection) -> tuple[AuthCredentials, BaseUser]:
        """Return the rights of a request; AuthenticationError if another page sent it, or a browser without cookie."""
        origin, host = conn.headers.get("origin"), conn.headers["host"]
        # Browsers send cookies with the requests of any page, and state its origin; only a page opens a socket.
        if origin not in (f"http://{host}", f"https://{host}") and (origin or conn.scope["type"] == "websocket"):
            raise AuthenticationError("this page answers to its own address alone")
        rights = self._rights(conn.cookies.get(self._cookie, ""))
        if not rights or self._rights(conn.query_params.get("token", "")):
            raise AuthenticationError("open the whole address that springmass printed")
        return AuthCredentials(rights), SimpleUser(rights[-1])

    def answer(self, conn: HTTPConnection, error: AuthenticationError) -> Response:
        """Exchange a token for its cookie, or refuse the request."""
        token = conn.query_params.get("token", "")
        if "origin" in conn.headers or not self._rights(token):  # a browser states none when it opens a link
            return PlainTextResponse(f"springmass: {error}\n", 403)
        response = RedirectResponse("/", 303)
        response.set_cookie(self._cookie, token, httponly=True, samesite="strict")
        return response

    def _rights(self, token: str) -> list[str]:
        if _same(token, self.token):
            return [VIEW, ACT]
        return [VIEW] if self._viewers and _same(token, self.viewers_token) else []


def _same(given: str, wanted: str) -> bool:
    return hmac.compare_digest(given.encode(), wanted.encode())
