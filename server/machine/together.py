"""Writes of one step as one transaction: after a crash nobody finds the end of a batch without what followed from it.

Not the database's thread, which puts steps together as it likes (server/background/dbthread.py). The one rule: what was
held goes on in the order in which it came, and before anything that is posted later.
"""

from collections.abc import Callable
from typing import Any

from sqlite_utils import Database

from server.background.dbthread import Db

_Write = tuple[Callable[..., Any], tuple[Any, ...], Callable[[], None] | None]


class Together:
    """See the head of this file. Without `hold` each write is posted by itself."""

    def __init__(self, db: Db) -> None:
        self._db = db
        self._held: list[_Write] | None = None

    def hold(self) -> None:
        """A step begins."""
        self._held = self._held or []

    def post(self, fn: Callable[..., Any], *args: Any, then: Callable[[], None] | None = None) -> None:
        """As `Db.post`, with the others of the step."""
        if self._held is None:
            self._db.post(fn, *args, then=then)
        else:
            self._held.append((fn, args, then))

    def release(self) -> None:
        """The step has ended."""
        writes, self._held = self._held, None
        if not writes:
            return
        if len(writes) == 1:
            fn, args, then = writes[0]
            self._db.post(fn, *args, then=then)
            return
        thens = [then for _, _, then in writes if then is not None]

        def all_of_them(db: Database) -> None:
            for fn, args, _ in writes:
                fn(db, *args)

        def durable() -> None:
            for then in thens:
                then()

        self._db.post(all_of_them, then=durable if thens else None)
