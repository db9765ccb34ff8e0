"""Keeps a port open for as long as somebody wants it: opens, waits, opens again, for ever, with back-off.

Not the port and not the engine: it is told to open and told of losses. The one rule: every attempt is an epoch of its
own, numbered upwards, and news from an old epoch are not heard.
"""

import asyncio
import logging
from collections.abc import Awaitable, Callable, Mapping
from enum import StrEnum

log = logging.getLogger(__name__)

DELAYS_S = (0.5, 1.0, 2.0, 4.0, 5.0)
"""Between attempts. The first is short so that a bumped plug is back within resume_within; the last one stays."""


class Phase(StrEnum):
    """Where the connection is."""

    OFF = "off"
    OPENING = "opening"
    OPEN = "open"
    WAITING = "waiting"


TABLE: Mapping[tuple[Phase, str], Phase] = {
    (Phase.OFF, "wanted"): Phase.OPENING,
    (Phase.OPENING, "opened"): Phase.OPEN,
    (Phase.OPENING, "refused"): Phase.WAITING,
    (Phase.OPENING, "unwanted"): Phase.OFF,
    (Phase.OPEN, "lost"): Phase.WAITING,
    (Phase.OPEN, "unwanted"): Phase.OFF,
    (Phase.WAITING, "delay over"): Phase.OPENING,
    (Phase.WAITING, "wanted"): Phase.OPENING,
    (Phase.WAITING, "unwanted"): Phase.OFF,
}


class Reconnect:
    """`open_epoch(n)` opens the port of epoch n, or raises OSError; `close()` closes what is open."""

    def __init__(self, open_epoch: Callable[[int], Awaitable[None]], on_refused: Callable[[str], None]) -> None:
        self.phase = Phase.OFF
        self.epoch = 0
        self.attempts = 0
        self.refusal = ""
        """Why the last attempt came to nothing."""
        self._open_epoch = open_epoch
        self._on_refused = on_refused
        self._task: asyncio.Task[None] | None = None
        self._lost = asyncio.Event()

    @property
    def wanted(self) -> bool:
        return self.phase is not Phase.OFF

    @property
    def lost_already(self) -> bool:
        """The present epoch is known to be lost."""
        return self._lost.is_set()

    def want(self) -> None:
        """Open the port and keep it open; at once, even while waiting for the next attempt."""
        if self.phase in (Phase.OPENING, Phase.OPEN):
            return
        self._cancel()
        self.attempts = 0
        self._go("wanted")
        self._task = asyncio.get_running_loop().create_task(self._keep_open(), name="reconnect")

    def unwant(self) -> None:
        """Leave it closed. The caller closes what is open."""
        if self.wanted:
            self._cancel()
            self.epoch += 1  # whatever the epoch that was cut off still says is old news
            self._go("unwanted")

    def lost(self, epoch: int) -> None:
        """The port of this epoch is gone, or its machine does not answer."""
        if epoch == self.epoch:
            self._lost.set()  # also while it is still being opened: it is then lost as soon as it is open

    def proved(self) -> None:
        """The machine answered: the next loss is a new one, and the first attempt after it comes soon."""
        self.attempts = 0

    def _go(self, event: str) -> None:
        self.phase = TABLE[self.phase, event]

    def _cancel(self) -> None:
        if self._task is not None:
            self._task.cancel()
            self._task = None

    async def _keep_open(self) -> None:
        while True:
            self.epoch += 1
            self._lost.clear()
            try:
                await self._open_epoch(self.epoch)
            except Exception as error:
                if not isinstance(error, OSError):
                    log.exception("an epoch could not be begun")
                self._go("refused")
                reason = str(error) or type(error).__name__
                self._on_refused(reason)
                self.refusal = reason
            else:
                self._go("opened")
                self.refusal = ""
                await self._lost.wait()
                self._go("lost")
            delay_s = DELAYS_S[min(self.attempts, len(DELAYS_S) - 1)]
            self.attempts += 1
            await asyncio.sleep(delay_s)
            self._go("delay over")
