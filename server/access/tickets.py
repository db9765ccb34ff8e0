"""Tickets: open one WebSocket, once, within half a minute. For clients that can set neither a header nor a cookie.

Not tokens (tokens.py): a ticket stands in an address, and addresses end in logs and histories. The one rule: it is
worthless before anybody can read it there; it is good once, for a short time, and for nothing but the WebSocket.
"""

import secrets
from dataclasses import dataclass

from server.access.auth import Principal, digest

LIFETIME_S = 30.0
MAX_OPEN = 256
"""Of one who asks; the oldest is worthless with one more. Memory is bounded by the number of tokens, too."""
MAX_OPEN_IN_ALL = 4096


@dataclass(frozen=True, slots=True)
class _Ticket:
    principal: Principal
    ends_at: float


class Tickets:
    """Those that are open, by their hash. Times are seconds of any steady clock."""

    def __init__(self) -> None:
        self._open: dict[str, _Ticket] = {}

    def issue(self, principal: Principal, *, now: float) -> str:
        """A new one for whoever asks."""
        self._open = {key: one for key, one in self._open.items() if one.ends_at > now}
        own = [key for key, one in self._open.items() if one.principal.token_id == principal.token_id]
        if len(own) >= MAX_OPEN:
            del self._open[own[0]]
        elif len(self._open) >= MAX_OPEN_IN_ALL:
            del self._open[next(iter(self._open))]
        secret = secrets.token_urlsafe(32)
        self._open[digest(secret)] = _Ticket(principal, now + LIFETIME_S)
        return secret

    def redeem(self, secret: str, *, now: float) -> Principal | None:
        """Who it was issued to; None for what is none (any more). It is none from now on."""
        ticket = self._open.pop(digest(secret), None)
        return None if ticket is None or now >= ticket.ends_at else ticket.principal
