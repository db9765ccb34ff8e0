"""The one writer: a thread that owns the database and is handed functions; and a twin without a thread for tests.

`run` waits for a result (requests of people), `read` for one that changes nothing. `post` does not wait (the stream):
posted functions are committed in the order in which they came, several in one transaction, and `then` is called on the
loop when they are durable. The one rule: a posted write is never overtaken by another. When the disk is full the writer
tries again until it succeeds; the journal stands still, so the stream stops by itself, and nothing that depends on the
missing row is ever written. Who only reads is answered all the while, with what is durable.
"""

import asyncio
import logging
import sqlite3
import threading
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any, Concatenate, ParamSpec, Protocol, TypeVar

from sqlite_utils import Database

from jobs.schema import prepare
from server.problems import ProblemError

T = TypeVar("T")
P = ParamSpec("P")

log = logging.getLogger(__name__)

GROUP = 64
"""Most posted functions in one transaction: one sync of the disk for all of them."""
LINGER_S = 0.02
"""What nobody waits for (the end of a batch) waits so long for something to go with: the row of the next batch mostly.
Each sync of the disk it is spared is one that the stream does not wait for. After a crash it is not known: the end of
a batch that was not durable yet is what recovery is for (elvinto §5.4)."""
RETRY_S = 0.5
"""Between two attempts of a write that failed."""
DAMAGE = ("malformed", "not a database")
MEND_DAMAGE = (
    "Stop the daemon, keep a copy of millstream.db and its -wal, and restore a backup (millstream restore), or "
    "rescue what can be read: sqlite3 millstream.db .recover | sqlite3 new.db"
)
DISK = ("disk I/O error", "unable to open database file", "readonly database")
MEND_DISK = "Look at the log of the system (dmesg), the quota and the permissions of server.data_dir."


Then = Callable[[], None] | None
"""Called on the loop when something is durable."""


class Db(Protocol):
    """What the services see of the database."""

    async def run(self, fn: Callable[Concatenate[Database, P], T], *args: P.args, **kwargs: P.kwargs) -> T:
        """Run `fn(db, ...)` in a transaction of its own, after everything posted before; its result or its error."""

    async def read(self, fn: Callable[Concatenate[Database, P], T], *args: P.args, **kwargs: P.kwargs) -> T:
        """The same for what changes nothing, for people to look at: where nothing can be written (a full disk) it sees
        what is durable. What decides about a machine or a job asks with `run`."""

    def post(self, fn: Callable[..., Any], *args: Any, then: Then = None, linger_s: float = LINGER_S) -> None:
        """Have `fn(db, *args)` done, in order, and `then` called on the loop when it is durable. Never waits. Without
        `then` it goes with the next one for which somebody waits, and after `linger_s` at the latest."""

    @property
    def trouble(self) -> str | None:
        """Why nothing can be written at the moment."""

    async def close(self) -> None:
        """Make everything posted durable, then close."""


@dataclass(slots=True)
class _Post:
    fn: Callable[..., Any]
    args: tuple[Any, ...]
    then: Callable[[], None] | None


@dataclass(slots=True)
class _Run:
    fn: Callable[[Database], Any]
    future: asyncio.Future[Any]
    reads: bool = False
    """It changes nothing, and is answered on a full disk, too."""


Connect = Callable[[Path | str], sqlite3.Connection]
"""Opens the file. A test hands in connections that die, or whose disk is full."""


def plainly(path: Path | str) -> sqlite3.Connection:
    """A connection that is made on one thread and used on another."""
    return sqlite3.connect(path, check_same_thread=False)


def opened(connection: sqlite3.Connection) -> Database:
    """The database, its tables as this version has them. Raises sqlite3.Error; the connection is closed then."""
    db = Database(connection)
    try:
        prepare(db)
    except BaseException:
        connection.close()
        raise
    return db


def refusal(error: Exception) -> Exception:
    """What of SQLite's errors is the user's to mend, in words that say how; everything else is an error of ours."""
    text = str(error)
    if not isinstance(error, sqlite3.Error):
        return error
    if "full" in text:
        return ProblemError("disk_full", f"The database cannot be written ({text}). Free some space and try again.")
    if any(sign in text for sign in DAMAGE):
        return ProblemError("database_error", f"The database is damaged ({text}). {MEND_DAMAGE}")
    if any(sign in text for sign in DISK):
        return ProblemError("database_error", f"The disk under the database fails ({text}). {MEND_DISK}")
    return error


def _stands_still(error: Exception) -> ProblemError:
    return ProblemError("database_error", f"The database cannot be written ({error}); the daemon's log says more.")


def in_transaction(db: Database, fn: Callable[[Database], T]) -> T:
    """Run `fn` and commit, or roll back. `fn` may commit by itself.

    Immediate: a transaction that begins by reading could not write any more after another process (the command line)
    has written.
    """
    db.conn.execute("begin immediate")
    try:
        result = fn(db)
        if db.conn.in_transaction:
            db.conn.commit()
    except BaseException:
        db.conn.rollback()
        raise
    return result


def reading(db: Database, fn: Callable[[Database], T]) -> T:
    """Run `fn`, which sees one state of everything and can change nothing. It needs no room, and no turn among those
    who write."""
    db.conn.execute("pragma query_only = on")
    try:
        db.conn.execute("begin")
        return fn(db)
    finally:
        db.conn.rollback()
        db.conn.execute("pragma query_only = off")


_Lot = list[_Post | _Run]
"""What is handed to the thread at once."""


class DbThread:
    """The writer thread. Made on the loop's thread; `close` ends it after everything posted is durable.

    The queue is all that both threads touch, and the thread sleeps at it: what lingers stays with the loop, what was
    handed over belongs to the thread.
    """

    def __init__(self, path: Path, loop: asyncio.AbstractEventLoop, *, connect: Connect = plainly) -> None:
        self._loop = loop
        self._queue: SimpleQueue[_Lot | None] = SimpleQueue()
        """None: nothing more comes."""
        self._lingering: _Lot = []
        self._alarm: asyncio.Handle | None = None
        self._due_at = 0.0
        """When the alarm rings."""
        self._hurried = False
        self._waiting: deque[_Post | _Run] = deque()
        self._closing = False
        self._trouble: str | None = None
        self._db = opened(connect(path))
        self._thread = threading.Thread(target=self._main, name="database", daemon=True)
        self._thread.start()

    @property
    def trouble(self) -> str | None:
        return self._trouble

    async def run(self, fn: Callable[Concatenate[Database, P], T], *args: P.args, **kwargs: P.kwargs) -> T:
        return await self._asked(lambda db: fn(db, *args, **kwargs), reads=False)

    async def read(self, fn: Callable[Concatenate[Database, P], T], *args: P.args, **kwargs: P.kwargs) -> T:
        return await self._asked(lambda db: fn(db, *args, **kwargs), reads=True)

    async def _asked(self, fn: Callable[[Database], T], *, reads: bool) -> T:
        future: asyncio.Future[T] = self._loop.create_future()
        self._lingering.append(_Run(fn, future, reads))
        self._hand_over()
        return await future

    def post(self, fn: Callable[..., Any], *args: Any, then: Then = None, linger_s: float = LINGER_S) -> None:
        self._lingering.append(_Post(fn, args, then))
        if self._hurried:
            return
        if then is not None:
            # Not before this step of the loop has ended: all that it posts is one transaction.
            self._quiet()
            self._hurried = True
            self._alarm = self._loop.call_soon(self._hand_over)
        elif self._alarm is None or self._loop.time() + linger_s < self._due_at:
            self._quiet()
            self._due_at = self._loop.time() + linger_s
            self._alarm = self._loop.call_at(self._due_at, self._hand_over)

    async def close(self) -> None:
        """Everything posted is written (or given up, when it cannot be), then the thread ends."""
        self._hand_over()
        self._queue.put(None)
        await asyncio.to_thread(self._thread.join)
        self._db.close()

    def _hand_over(self) -> None:
        self._quiet()
        lot, self._lingering = self._lingering, []
        self._queue.put(lot)

    def _quiet(self) -> None:
        self._hurried = False
        if self._alarm is not None:
            self._alarm.cancel()
            self._alarm = None

    # --- in the thread ----------------------------------------------------------------------------------------

    def _main(self) -> None:
        while (work := self._take()) is not None:
            if isinstance(work, _Run):
                self._answer(work)
            else:
                self._commit(work)

    def _take(self) -> _Run | list[_Post] | None:
        """The next request, or the next posted functions up to it; None at the end."""
        waiting = self._waiting
        while not waiting and not self._closing:
            self._receive(self._queue.get())
        self._receive_all()
        group: list[_Post] = []
        while waiting and len(group) < GROUP:
            head = waiting[0]
            if isinstance(head, _Run):
                return group or self._pop_run()
            group.append(head)
            waiting.popleft()
        return group or None

    def _receive(self, lot: _Lot | None) -> None:
        if lot is None:
            self._closing = True
        else:
            self._waiting.extend(lot)

    def _receive_all(self) -> None:
        """Whatever has been handed over by now: it goes into the same transaction."""
        while not self._queue.empty():
            self._receive(self._queue.get())

    def _pop_run(self) -> _Run:
        run = self._waiting.popleft()
        assert isinstance(run, _Run)
        return run

    def _answer(self, run: _Run) -> None:
        try:
            result = (reading if run.reads else in_transaction)(self._db, run.fn)
        except Exception as error:  # noqa: BLE001 - it is raised again where the request waits for it
            self._resolve(run, None, refusal(error))
        else:
            self._resolve(run, result, None)

    def _commit(self, group: list[_Post]) -> None:
        def all_of_them(db: Database) -> None:
            for post in group:
                post.fn(db, *post.args)

        while True:
            try:
                in_transaction(self._db, all_of_them)
            except Exception as error:  # noqa: BLE001 - the outermost loop of this thread
                # A bug of ours is treated like a full disk: nothing overtakes it, so the stream stands still.
                if not self._stuck(error):
                    return
                continue
            self._trouble = None
            for post in group:
                if post.then is not None:
                    self._call(post.then)
            return

    def _stuck(self, error: Exception) -> bool:
        """Wait for better times, answer who only reads, and send those away who could not wait; False when the daemon
        ends."""
        if self._trouble != str(error):
            log.error("The database cannot be written; the journal stands still", exc_info=error)
        self._trouble = str(error)
        self._receive_all()
        refused = refusal(error)
        for item in [item for item in self._waiting if isinstance(item, _Run)]:
            self._waiting.remove(item)
            if item.reads:
                self._answer(item)
            else:
                self._resolve(item, None, refused if isinstance(refused, ProblemError) else _stands_still(error))
        if self._closing:
            return False
        with suppress(Empty):
            self._receive(self._queue.get(timeout=RETRY_S))
        return True

    def _resolve(self, run: _Run, result: Any, error: Exception | None) -> None:
        def settle() -> None:
            if run.future.done():
                return  # the request was given up meanwhile
            if error is None:
                run.future.set_result(result)
            else:
                run.future.set_exception(error)

        self._call(settle)

    def _call(self, then: Callable[[], None]) -> None:
        try:
            self._loop.call_soon_threadsafe(then)
        except RuntimeError:
            log.warning("The event loop ended before the database did")


class InlineDb:
    """The same without a thread, for simulated time. `latency_s` is how long a posted write takes to be durable."""

    def __init__(
        self,
        path: Path | str,
        loop: asyncio.AbstractEventLoop,
        *,
        latency_s: float = 0.0,
        connect: Connect = plainly,
    ) -> None:
        self._loop = loop
        self._latency_s = latency_s
        self._posted: deque[_Post] = deque()
        self._timer: asyncio.TimerHandle | None = None
        self.trouble: str | None = None
        self.db = opened(connect(path))

    async def run(self, fn: Callable[Concatenate[Database, P], T], *args: P.args, **kwargs: P.kwargs) -> T:
        self.commit()
        try:
            return in_transaction(self.db, lambda db: fn(db, *args, **kwargs))
        except sqlite3.Error as error:
            raise refusal(error) from error

    async def read(self, fn: Callable[Concatenate[Database, P], T], *args: P.args, **kwargs: P.kwargs) -> T:
        self.commit()
        try:
            return reading(self.db, lambda db: fn(db, *args, **kwargs))
        except sqlite3.Error as error:
            raise refusal(error) from error

    def post(self, fn: Callable[..., Any], *args: Any, then: Then = None, linger_s: float = LINGER_S) -> None:  # noqa: ARG002
        self._posted.append(_Post(fn, args, then))
        if self._timer is None:
            self._timer = self._loop.call_later(self._latency_s, self.commit)

    def commit(self) -> None:
        """Make everything posted durable, in order."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        posted, self._posted = self._posted, deque()
        for post in posted:
            in_transaction(self.db, lambda db, post=post: post.fn(db, *post.args))  # type: ignore[misc]
            if post.then is not None:
                self._loop.call_soon(post.then)

    async def close(self) -> None:
        self.commit()
        self.db.close()

    def crash(self) -> None:
        """What is not durable yet never will be."""
        self._posted.clear()
        self.commit()
        self.db.close()
