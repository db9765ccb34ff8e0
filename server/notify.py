"""What systemd is told of the daemon: that it is ready, alive, stopping, and in a sentence what it is doing.

The protocol of sd_notify(3) over its datagram socket; nothing of systemd is needed, and without NOTIFY_SOCKET nothing
happens. The one rule: the watchdog hears from us only while the event loop turns and the database thread answers; a
daemon that hangs in either is to be started anew.
"""

import asyncio
import logging
import os
import socket
import sqlite3
from collections.abc import Callable, Mapping
from contextlib import suppress

from server.background.dbthread import Db
from server.problems import ProblemError

log = logging.getLogger(__name__)

PINGS_PER_TIMEOUT = 3
"""sd_watchdog_enabled(3) advises half of the time; a third leaves room for one that is late."""
STATUS_EVERY_S = 10.0
"""Where there is no watchdog, the sentence is renewed this often."""
MOST_STATUS_CHARS = 200


class Notifier:
    """The socket of the service manager, if there is one. Never raises: a manager that went away stops nothing."""

    def __init__(self, environ: Mapping[str, str]) -> None:
        self._address = _address(environ.get("NOTIFY_SOCKET", ""))
        self.watchdog_s = _watchdog_s(environ)
        self._socket = None
        if self._address is not None:
            self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC)
            # A manager that does not read must not hold up the stream.
            self._socket.setblocking(False)

    def __bool__(self) -> bool:
        """Whether there is somebody to tell."""
        return self._socket is not None

    def ready(self) -> None:
        """Everything is up: what waits for the unit may start."""
        self._send("READY=1")

    def alive(self) -> None:
        """The watchdog's timer begins anew."""
        self._send("WATCHDOG=1")

    def stopping(self) -> None:
        """The daemon was told to end and is doing so."""
        self._send("STOPPING=1")

    def status(self, sentence: str) -> None:
        """What `systemctl status` shows."""
        self._send("STATUS=" + " ".join(sentence.split())[:MOST_STATUS_CHARS])

    def close(self) -> None:
        """Give the socket back."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def _send(self, state: str) -> None:
        if self._socket is not None and self._address is not None:
            try:
                self._socket.sendto(state.encode(), self._address)
            except OSError as error:
                log.debug("systemd could not be told %s: %s", state, error)


async def keep_telling(notifier: Notifier, db: Db, sentence: Callable[[], str]) -> None:
    """Ping and renew the status until it is cancelled. `sentence` says what the daemon is doing."""
    every_s = STATUS_EVERY_S if notifier.watchdog_s is None else notifier.watchdog_s / PINGS_PER_TIMEOUT
    told = None
    while True:
        if (now := _status(sentence(), db.trouble)) != told:
            notifier.status(now)
            told = now
        if notifier.watchdog_s is not None:
            await _answered(db)
            notifier.alive()
        await asyncio.sleep(every_s)


async def _answered(db: Db) -> None:
    """Returns when the database thread has answered, with whatever: a full disk is no reason to start anew."""
    with suppress(ProblemError, sqlite3.Error):
        await db.run(lambda _db: None)


def _status(sentence: str, trouble: str | None) -> str:
    return sentence if trouble is None else f"The database cannot be written: {trouble}"


def _address(name: str) -> str | None:
    """The socket's address; a name that begins with @ is in Linux's abstract namespace. None: nobody is to be told."""
    if name.startswith("@"):
        return "\0" + name[1:]
    return name if name.startswith("/") else None


def _watchdog_s(environ: Mapping[str, str]) -> float | None:
    """How long the manager waits for a sign of life; None: it does not, or it does not mean this process."""
    microseconds, pid = environ.get("WATCHDOG_USEC", ""), environ.get("WATCHDOG_PID", "")
    if not microseconds.isdecimal() or int(microseconds) == 0 or (pid and pid != str(os.getpid())):
        return None
    return int(microseconds) / 1e6
