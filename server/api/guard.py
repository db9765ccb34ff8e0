"""The doorkeeper in front of every route: Host, Origin, who is asking, security headers, and the last resort.

Plain ASGI, no logic of any route; whether the role suffices is decided where the route is (`routing.py`). The one
rule: nothing gets past here under a name that is not ours (DNS rebinding) or on behalf of another site.
"""

import ipaddress
import logging
import socket
from collections.abc import Callable, Iterable
from http.cookies import CookieError, SimpleCookie
from typing import Protocol
from urllib.parse import parse_qsl, urlencode, urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import ClientDisconnect
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocket

from server.access.auth import NOBODY, Principal, is_loopback
from server.api.clientaddress import ADDRESS_KEY, TLS_KEY, Proxies
from server.api.problems import PROBLEM_KEY, internal_problem, problem_response, refuse_socket
from server.problems import ProblemError

logger = logging.getLogger(__name__)

PRINCIPAL_KEY = "millstream.principal"
ATTEMPT_KEY = "millstream.attempt"
"""Set where somebody has come with a token, right or wrong."""
UNAUDITED_KEY = "millstream.unaudited"
"""Set by a route where a request has only kept something alive."""
MADE_KEY = "millstream.made"
"""(column, id) of what a request has made, for the audit: `job`, or `target` (a program, a token)."""
SESSION_COOKIE = "millstream_session"
SAFE_METHODS = frozenset({"GET", "HEAD", "OPTIONS"})

GONE = 499
"""In the audit: the client went away before there was an answer."""

SECURITY_HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src 'self' data:; "
        "worker-src 'self'; frame-ancestors 'none'; base-uri 'none'; form-action 'self'"
    ),
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "X-Frame-Options": "DENY",
    "Permissions-Policy": "camera=(), microphone=(), geolocation=(), usb=(), serial=()",
}


TICKET = "ticket"
"""The parameter of a WebSocket's address that stands for a token once."""


class Redeem(Protocol):
    """`TokenStore.redeem`."""

    def __call__(self, ticket: str, /) -> Principal | None: ...


class Identify(Protocol):
    """`TokenStore.identify`."""

    async def __call__(self, *, bearer: str | None, cookie: str | None, address: str) -> Principal | None: ...


Record = Callable[[Scope, int], None]
"""Told of each request that may have changed something, and of the status of its answer (`audittrail.Trail`)."""


class HostRule:
    """Under which names the daemon may be spoken to, and from which sites.

    A page of another site can make a browser send requests to a name that it lets point at us, but then the Host
    header carries that name. An IP literal cannot be pointed anywhere, so addresses are let in.
    """

    def __init__(self, listen_host: str, allowed_hosts: Iterable[str]) -> None:
        self._loopback_only = is_loopback(listen_host)
        named = {host.lower().rstrip(".") for host in allowed_hosts}
        self._configured = frozenset(named)
        if not self._loopback_only:
            own = socket.gethostname().lower()
            named |= {listen_host.lower(), own, f"{own.partition('.')[0]}.local"}
        self._names = frozenset(named | {"localhost"})

    def knows(self, authority: str | None) -> bool:
        """Whether `authority` (a Host header) names this daemon."""
        host = hostname(authority)
        if host is None:
            return False
        try:
            address = ipaddress.ip_address(host)
        except ValueError:
            return host in self._names
        if host in self._configured:
            return True
        return address.is_loopback if self._loopback_only else not address.is_unspecified

    def same_site(self, origin: str, authority: str | None) -> bool:
        """Whether a request with this Origin comes from our own pages.

        The scheme is not compared: a proxy in front may speak TLS while we do not. A name from `allowed_hosts` is
        ours even when the proxy writes another Host.
        """
        try:
            parts = urlsplit(origin)
        except ValueError:
            return False
        if parts.scheme not in ("http", "https") or authority is None:
            return False
        return parts.netloc.lower() == authority.lower() or hostname(parts.netloc) in self._configured


def hostname(authority: str | None) -> str | None:
    """The name or address in `host:port`, lower case, without brackets and port; None for what is neither."""
    if authority is None or "@" in authority or "/" in authority:
        return None
    try:
        host = urlsplit(f"//{authority}").hostname
    except ValueError:
        return None
    return host.rstrip(".") if host else None


class Guard:
    """ASGI middleware around the whole application."""

    def __init__(
        self,
        app: ASGIApp,
        *,
        hosts: HostRule,
        identify: Identify,
        redeem: Redeem = lambda _ticket: None,
        proxies: Proxies | None = None,
        record: Record = lambda _scope, _status: None,
    ) -> None:
        self._app = app
        self._hosts = hosts
        self._identify = identify
        self._redeem = redeem
        self._proxies = proxies or Proxies()
        self._record = record

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        answer = _Answer(send)
        try:
            headers = Headers(scope=scope)
            self._check_site(scope, headers)
            scope[PRINCIPAL_KEY] = await self._who(scope, headers)
            await self._app(scope, receive, answer)
        except ProblemError as problem:
            await self._refuse(problem, scope, receive, answer)
        except ClientDisconnect:
            logger.info("the client went away in the middle of its request: %s", scope["path"])
        except Exception:  # the outermost loop of a request
            logger.exception("unexpected error in %s %s", scope.get("method", "WEBSOCKET"), scope["path"])
            if not answer.started:
                await self._refuse(internal_problem(), scope, receive, answer)
        if scope["type"] == "http" and scope["method"] not in SAFE_METHODS:
            self._record(scope, answer.status)

    async def _who(self, scope: Scope, headers: Headers) -> Principal:
        """Raises ProblemError for who guesses tokens."""
        secret = bearer(headers)
        scope[ATTEMPT_KEY] = secret is not None
        address = scope[ADDRESS_KEY] = self._proxies.address_of(scope)
        scope[TLS_KEY] = self._proxies.is_tls(scope)
        if scope["type"] == "websocket" and (ticket := take_ticket(scope)) is not None:
            return self._redeem(ticket) or NOBODY
        return await self._identify(bearer=secret, cookie=session_cookie(headers), address=address) or NOBODY

    def _check_site(self, scope: Scope, headers: Headers) -> None:
        """Raises ProblemError for a request that another site has sent through somebody's browser."""
        host = headers.get("host")
        if not self._hosts.knows(host):
            raise ProblemError(
                "bad_host",
                f"This daemon is not known as {(host or '(no Host header)')[:100]!r}. Use its address, or add the name "
                "to server.allowed_hosts.",
            )
        if scope["type"] == "http" and scope["method"] in SAFE_METHODS:
            return
        if self._is_foreign(headers, host):
            raise ProblemError(
                "bad_origin",
                "The request was made by a page of another site. Open the dashboard at this daemon's own address.",
            )

    def _is_foreign(self, headers: Headers, host: str | None) -> bool:
        origin = headers.get("origin")
        if origin is not None:
            return not self._hosts.same_site(origin, host)
        # No Origin: not a browser, unless Sec-Fetch-Site says that it is one on another site's behalf.
        return headers.get("sec-fetch-site", "none") not in ("none", "same-origin")

    async def _refuse(self, problem: ProblemError, scope: Scope, receive: Receive, answer: "_Answer") -> None:
        scope[PROBLEM_KEY] = problem.code
        if scope["type"] == "websocket":
            await refuse_socket(WebSocket(scope, receive, answer), problem)
        else:
            await problem_response(problem)(scope, receive, answer)


class _Answer:
    """`send` with the security headers, remembering whether an answer has begun."""

    def __init__(self, send: Send) -> None:
        self._send = send
        self.status = GONE
        """Of the answer; GONE where the client did not wait for one."""

    @property
    def started(self) -> bool:
        return self.status != GONE

    async def __call__(self, message: Message) -> None:
        if message["type"] in ("http.response.start", "websocket.accept", "websocket.http.response.start"):
            self.status = int(message.get("status", 101))
            headers = MutableHeaders(scope=message)
            for name, value in SECURITY_HEADERS.items():
                headers[name] = value
            if "cache-control" not in headers:
                headers["Cache-Control"] = "no-store"
        await self._send(message)


def take_ticket(scope: Scope) -> str | None:
    """The ticket in the address of a WebSocket, which does not stand there any more: the server logs addresses."""
    text: str = scope["query_string"].decode("latin-1")
    query = parse_qsl(text, keep_blank_values=True)
    tickets = [value for name, value in query if name == TICKET]
    if not tickets:
        return None
    scope["query_string"] = urlencode([(name, value) for name, value in query if name != TICKET]).encode()
    return tickets[0]


def bearer(headers: Headers) -> str | None:
    """The token of the `Authorization` header (RFC 6750 §2.1)."""
    scheme, _, secret = headers.get("authorization", "").partition(" ")
    return secret.strip() if scheme.lower() == "bearer" and secret.strip() else None


def session_cookie(headers: Headers) -> str | None:
    """The session cookie's value."""
    try:
        morsel = SimpleCookie(headers.get("cookie", "")).get(SESSION_COOKIE)
    except CookieError:
        return None
    return morsel.value if morsel is not None else None
