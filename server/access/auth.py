"""Who may do what: roles, who is asking, sessions of the dashboard, and the rule for listening on a network.

Tokens and their table are in `server/access/tokens.py`, the checks on a request in `server/api/guard.py`. The one rule:
without a token the daemon serves this computer alone, and a secret is never stored, only its hash.
"""

import hashlib
import ipaddress
import secrets
from collections.abc import Sized
from dataclasses import dataclass
from enum import IntEnum

from protocol.errors import MillstreamError

SESSION_LIFETIME_S = 30 * 24 * 3600.0
"""A signed-in browser stays signed in for a month, until sign-out, or until the daemon starts anew."""
MAX_SESSIONS = 1000
"""The oldest session ends when one more begins: signing in cannot fill the memory. Those whose time is over go then,
too: few browsers sign out."""


class Role(IntEnum):
    """What a token allows; each role may do what the ones before it may. PUBLIC needs no token at all."""

    PUBLIC = 0
    VIEWER = 1
    OPERATOR = 2
    ADMIN = 3

    @property
    def word(self) -> str:
        """The name in the API and in the database."""
        return self.name.lower()


GRANTABLE = tuple(role.word for role in (Role.VIEWER, Role.OPERATOR, Role.ADMIN))
"""Roles that a token can have."""


@dataclass(frozen=True, slots=True)
class Principal:
    """Who is asking. `token_id` is None where the daemon runs without tokens; `session` tells browsers apart that were
    signed in with the same token. `refused`: the code of why a token that is known is not good any more."""

    role: Role
    name: str
    token_id: str | None = None
    session: str | None = None
    refused: str | None = None


NOBODY = Principal(Role.PUBLIC, "nobody")
EXPIRED = Principal(Role.PUBLIC, "nobody", refused="token_expired")
"""Who comes with a token whose time is over."""
LOCAL_USER = Principal(Role.ADMIN, "local user")
"""Whoever reaches a daemon that listens on loopback and has no tokens."""


class ExposureError(MillstreamError):
    """The daemon would listen on a network without knowing anybody: it does not start."""


def is_loopback(host: str) -> bool:
    """Whether `host` (a name or an address to listen on) can be reached from this computer only."""
    if host.lower().rstrip(".") == "localhost":
        return True
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return False


def check_exposure(host: str, tokens: Sized) -> None:
    """Raises ExposureError when `host` is not a loopback address and there is no token yet."""
    if is_loopback(host) or len(tokens) > 0:
        return
    raise ExposureError(
        f"server.host is {host!r}, which others on the network can reach, and there is no token yet. "
        "Make one with `millstream token create`, or listen on 127.0.0.1."
    )


def digest(secret: str) -> str:
    """What is kept of a secret. The secrets are 256 random bits, so a plain SHA-256 cannot be turned back."""
    return hashlib.sha256(secret.encode()).hexdigest()


class Sessions:
    """Signed-in browsers: hash of the cookie → the token it was signed in with. In memory only."""

    def __init__(self) -> None:
        self._sessions: dict[str, tuple[str, float]] = {}

    def begin(self, token_id: str, *, now: float) -> str:
        """A new session for this token; the cookie's value."""
        while self._sessions and (len(self._sessions) >= MAX_SESSIONS or now >= self._first_ends_at()):
            del self._sessions[next(iter(self._sessions))]
        cookie = secrets.token_urlsafe(32)
        self._sessions[digest(cookie)] = (token_id, now + SESSION_LIFETIME_S)
        return cookie

    def _first_ends_at(self) -> float:
        """All last as long: the oldest ends first."""
        return next(iter(self._sessions.values()))[1]

    def token_id(self, cookie: str, *, now: float) -> str | None:
        """The token behind a cookie, or None when the session has ended or never was."""
        session = self._sessions.get(digest(cookie))
        if session is None:
            return None
        token_id, ends_at = session
        if now >= ends_at:
            self.end(cookie)
            return None
        return token_id

    def end(self, cookie: str) -> None:
        """Sign out; harmless for a cookie that is not known."""
        self._sessions.pop(digest(cookie), None)
