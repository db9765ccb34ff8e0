"""A database whose daemon is killed at one certain statement: kill -9 at each point where something is written.

Both sides of every commit of something are points with a number, and every statement that writes; between these no time
passes for machine and people, so a usual run leaves them out. At the chosen one the files are
kept as they lie on the disk at that moment (what the system has written is there, what was not committed is in the -wal
or nowhere), everything of the daemon stops, and the next one opens those files. The one rule: the code under test knows
nothing of it; what is handed to it is a connection.
"""

import shutil
import sqlite3
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

WRITES = ("insert", "update", "delete", "replace", "create", "alter", "drop")
SUFFIXES = ("", "-wal")
"""The files that outlive a process; -shm is made anew."""


class KilledError(BaseException):
    """The daemon died here. No Exception: nothing of the daemon catches it."""


@dataclass
class Fate:
    """Counts the points of all connections of one story and strikes at `at` (None: only counts)."""

    at: int | None = None
    every_statement: bool = True
    count: int = 0
    struck: bool = False
    trace: list[str] = field(default_factory=list)
    strike: Callable[[], None] = lambda: None
    """Stops everything of the daemon."""

    def connect(self, path: Path | str) -> sqlite3.Connection:
        """For dbthread.py: a connection of this story."""
        connection = sqlite3.connect(path, factory=_Mortal)
        connection.fate, connection.path = self, Path(path)
        # A crash here is one of the simulated process, never of this computer.
        connection.execute("pragma synchronous = off")
        return connection

    def point(self, connection: "_Mortal", what: str) -> None:
        """One more point; perhaps the last one of this daemon."""
        self.count += 1
        self.trace.append(what)
        if self.at is None or self.struck or self.count < self.at:
            return
        self.struck = True
        connection.die()
        self.strike()
        raise KilledError


class _Mortal(sqlite3.Connection):
    fate: Fate
    path: Path
    dead = False
    written = False
    """Something, since the last commit."""

    def execute(self, sql: str, *values: Any) -> sqlite3.Cursor:
        if self.dead:
            raise KilledError
        if sql.strip().lower() == "commit":
            self.commit()
            return self.cursor()
        if sql.lstrip().lower().startswith(WRITES):
            self.written = True
            if self.fate.every_statement:
                self.fate.point(self, sql.strip().split("(")[0][:60])
        return super().execute(sql, *values)

    @property
    def in_transaction(self) -> bool:
        return not self.dead and super().in_transaction

    def __exit__(self, kind: Any, value: Any, trace: Any) -> Any:
        if kind is None:
            self.commit()
        else:
            self.rollback()
        return False

    def commit(self) -> None:
        if self.dead:
            raise KilledError
        if not (self.written and super().in_transaction):
            return super().commit()
        self.fate.point(self, "commit")
        super().commit()
        self.written = False
        self.fate.point(self, "committed")
        return None

    def rollback(self) -> None:
        if not self.dead:
            super().rollback()

    def die(self) -> None:
        """Keep the files as they are now: closing would write more into them."""
        self.dead = True
        kept = {suffix: self.path.with_name(f"{self.path.name}{suffix}.kept") for suffix in SUFFIXES}
        for suffix, copy in kept.items():
            if (file := self.path.with_name(self.path.name + suffix)).exists():
                shutil.copyfile(file, copy)
        super().rollback()
        super().close()
        for suffix in (*SUFFIXES, "-shm"):
            self.path.with_name(self.path.name + suffix).unlink(missing_ok=True)
        for suffix, copy in kept.items():
            if copy.exists():
                copy.rename(self.path.with_name(self.path.name + suffix))
        self.path.with_name(f"{self.path.name}-shm").unlink(missing_ok=True)

    def close(self) -> None:
        if not self.dead:
            super().close()
