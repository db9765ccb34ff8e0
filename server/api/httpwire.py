"""The server's HTTP connection, with an end for peers that say nothing: uvicorn's, and three rules for those who wait.

Not the limits of what is asked (api/routing.py) and not WebSockets (wswire.py). The one rule: a connection from which
nothing whole has come never keeps out one with a request, for that may be an e-stop.
"""

import asyncio
from heapq import nsmallest
from typing import Any

from uvicorn.protocols.http.h11_impl import H11Protocol, RequestResponseCycle

MAX_CONNECTIONS = 512
"""More than any workshop has dashboards; at the next one the answer is 503, and file descriptors stay for ports."""
MAKE_WAY_AT = 496
"""From so many on those who have waited longest are closed. WebSockets, of which there are less (`limits.sockets`), and
requests that are being obeyed are not among them."""
MAKE_WAY_BY = 16
"""So many at once: looking for them takes longer than closing them."""
HEAD_S = 10.0
"""A request's line and headers are one packet; a peer that does not get them together in this time is none of ours."""
BODY_SILENCE_S = 30.0
"""Between two pieces of a body: an upload through a bad radio link goes on after seconds."""
LOOK_EVERY_S = 5.0


class HttpProtocol(H11Protocol):
    """For `uvicorn.Config(http=...)`."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.since = self.loop.time()
        """When it began to wait for what it waits for: a request, or the rest of one."""
        self._heard_at = self.since
        self._between = False
        """A request was answered, and nothing of another one has come: uvicorn's keep-alive ends that."""
        self._timer: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """One more, if need be in the place of those that have waited longest."""
        super().connection_made(transport)
        if len(self.connections) > MAKE_WAY_AT:
            self._make_way()
        self._timer = self.loop.call_later(LOOK_EVERY_S, self._look)

    def connection_lost(self, exc: Exception | None) -> None:
        """It is over."""
        super().connection_lost(exc)
        self._rest()

    def data_received(self, data: bytes) -> None:
        """Bytes of the peer."""
        answered, self._heard_at = not self.in_work, self.loop.time()
        if self._between:
            self._between, self.since = False, self._heard_at
        super().data_received(data)
        if answered and self.in_work:
            self.since = self._heard_at

    def handle_websocket_upgrade(self, event: Any) -> None:
        """It is a WebSocket from now on."""
        self._rest()
        super().handle_websocket_upgrade(event)

    def on_response_complete(self) -> None:
        """Answered."""
        self._between, self.since = True, self.loop.time()
        super().on_response_complete()

    @property
    def in_work(self) -> bool:
        """Whether there is a request that is not answered."""
        cycle: RequestResponseCycle | None = self.cycle
        return cycle is not None and not cycle.response_complete

    @property
    def _in_body(self) -> bool:
        """Whether the peer has to go on with a body. One that is not read yet is no silence of the peer's."""
        return self.in_work and self.cycle.more_body and not self.flow.read_paused

    @property
    def may_go(self) -> bool:
        """Whether it waits for its peer: for a request, for the rest of one, or that it reads its answer."""
        waits = not self.in_work or self._in_body or self.flow.write_paused
        return waits and not self.transport.is_closing()

    def _make_way(self) -> None:
        idle = [one for one in self.connections if isinstance(one, HttpProtocol) and one is not self and one.may_go]
        for one in nsmallest(MAKE_WAY_BY, idle, key=lambda one: (one.in_work, one.since)):
            one.transport.abort()

    def _look(self) -> None:
        """Whether the peer has waited too long with what it has to say."""
        self._timer = None
        if self.transport.is_closing():
            return
        now = self.loop.time()
        if self.in_work:
            late = self._in_body and now - self._heard_at >= BODY_SILENCE_S
        else:
            late = not self._between and now - self.since >= HEAD_S
        if late:
            self.transport.abort()
        else:
            self._timer = self.loop.call_later(LOOK_EVERY_S, self._look)

    def _rest(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
