"""Rights to view and to act: for the person who started the page, for viewers if admitted, and for nobody else.

As with notebooks, the page by default listens only on the loopback interface. A token in the first address is exchanged
for a cookie. Host and origin must be the page's own, so that no foreign page can reach this one through the browser. If
the user opens the page to the local network, another token lets everybody who has it view the page, but not act.
"""

from __future__ import annotations

import hashlib
import hmac
import secrets
from collections.abc import Iterable
from urllib.parse import urlsplit

from starlette.authentication import AuthCredentials, AuthenticationBackend, AuthenticationError, BaseUser, SimpleUser
from starlette.datastructures import MutableHeaders
from starlette.middleware.authentication import AuthenticationMiddleware
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.requests import HTTPConnection
from starlette.responses import PlainTextResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from springmass.report.script import script_sha256

__all__ = ["ACT", "LOOK", "Access", "guarded"]

LOOK, ACT = "look", "act"
"""Rights of a request; the controller has both."""
LOOPBACK = ("127.0.0.1", "localhost", "[::1]")
PAGE_POLICY = "default-src 'self'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'"
REPORT_POLICY = (
    f"default-src 'none'; script-src 'sha256-{script_sha256()}'; style-src 'unsafe-inline'; img-src data:; "
    "frame-ancestors 'none'; base-uri 'none'"
)
"""The policy for a report: a single file with inline styles and pictures, which runs only the script of its charts."""
HEADERS = {"X-Content-Type-Options": "nosniff", "Referrer-Policy": "no-referrer", "Cache-Control": "no-store"}


def guarded(app: ASGIApp, access: Access, hosts: Iterable[str] = ()) -> ASGIApp:
    """Return an application protected by checks of host, origin and cookie, with security headers.

    Parameters
    ----------
    app : ASGI application
        ``auth.scopes`` of its requests contains :data:`LOOK` and, for the controller, :data:`ACT`.
    access : Access
    hosts : iterable of str
        Hosts, besides the names of the loopback, under which the page answers.
    """
    known = AuthenticationMiddleware(app, access, access.answer)
    return _Headers(TrustedHostMiddleware(known, [*LOOPBACK, *hosts], www_redirect=False))


class Access(AuthenticationBackend):
    """Recognises browsers by the page's cookie, and exchanges a token for it.

    Parameters
    ----------
    port : int
        Part of the cookie's name, so that two pages on one machine have different cookies.
    secret : str
        Secret from which cookies and tokens are derived. A restarted page with the same secret recognises its browsers.
        If empty, a new secret is made.
    viewers : bool
        Whether viewers are admitted.
    used : bool
        Whether the controller's link has been used before.

    Attributes
    ----------
    token : str or None
        Token that lets one browser act; None once it has been used.
    viewers_token : str
        Token that lets any browser view the page.
    """

    def __init__(self, port: int, secret: str = "", *, viewers: bool = False, used: bool = False) -> None:
        self._secret = (secret or secrets.token_urlsafe(24)).encode()
        self._cookie = f"springmass-{port}"
        self._viewers = viewers
        self._controls, self._looks = self._made("act"), self._made("look")
        self.token: str | None = None if used else self._made("act once")
        self.viewers_token = self._made("view")

    def _made(self, what: str) -> str:
        return hmac.new(self._secret, what.encode(), hashlib.sha256).hexdigest()[:32]

    async def authenticate(self, conn: HTTPConnection) -> tuple[AuthCredentials, BaseUser]:
        """Return the rights of a request.

        Raises
        ------
        AuthenticationError
            If the request comes from another page, or has no cookie of this page.
        """
        origin = conn.headers.get("origin")
        # Browsers send cookies with the requests of any page, and state its origin; only a page opens a socket.
        if (origin is not None or conn.scope["type"] == "websocket") and _host(origin or "") != conn.headers["host"]:
            raise _ForeignOrigin("this page answers to its own address alone")
        given = conn.cookies.get(self._cookie, "")
        if _same(given, self._controls):
            return AuthCredentials([LOOK, ACT]), SimpleUser("controller")
        if _same(given, self._looks):
            return AuthCredentials([LOOK]), SimpleUser("viewer")
        raise AuthenticationError("open the address that springmass printed: it works once, in one browser")

    def answer(self, conn: HTTPConnection, error: AuthenticationError) -> Response:
        """Exchange a token for its cookie, or refuse the request."""
        cookie = None if isinstance(error, _ForeignOrigin) else self._exchanged(conn.query_params.get("token", ""))
        if cookie is None:
            return PlainTextResponse(f"springmass: {error}\n", 403)
        response = RedirectResponse("/", 303)
        response.set_cookie(self._cookie, cookie, httponly=True, samesite="strict")
        return response

    def _exchanged(self, given: str) -> str | None:
        if self.token is not None and _same(given, self.token):
            self.token = None
            return self._controls
        return self._looks if self._viewers and _same(given, self.viewers_token) else None


class _ForeignOrigin(AuthenticationError):
    """A request that another page made."""


class _Headers:
    """ASGI middleware that adds security headers to every answer and closes refused sockets."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        policy = REPORT_POLICY if scope.get("path") == "/v1/report" else PAGE_POLICY

        async def sending(message: Message) -> None:
            if message["type"] == "http.response.start":
                MutableHeaders(scope=message).update({**HEADERS, "Content-Security-Policy": policy})
            # uvicorn logs an error if a socket gets an answer instead of its handshake, but not if it is closed.
            if message["type"] == "websocket.http.response.start":
                message = {"type": "websocket.close", "code": 1008}
            if message["type"] != "websocket.http.response.body":
                await send(message)

        await self._app(scope, receive, sending)


def _same(given: str, wanted: str) -> bool:
    return hmac.compare_digest(given.encode(), wanted.encode())


def _host(address: str) -> str:
    """Return host and port of an address; empty if the address is invalid."""
    try:
        return urlsplit(address).netloc
    except ValueError:
        return ""
