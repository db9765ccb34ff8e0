"""kill -9 at each statement of everything that is ever written into the database, table by table.

The stories of test_kill_points.py have machines and jobs; here each function that writes (jobs/, server/) is a step of
its own, and after a death in it the tables are as before it or as behind it, whole. The one rule: a statement that
stands in the code and is not reached by a step fails the last test, so that none can be forgotten.
"""

import re
import shutil
import sqlite3
from collections.abc import Callable
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from sqlite_utils import Database

from jobs import backups, history, holds, journal, retention, seals, store, toolstore
from jobs.effects import Entry, MarkBatch, RowStatus, SetStatus
from jobs.job import Status
from jobs.seals import Digest
from server.access import audit, endedtokens, tokens
from server.background.dbthread import in_transaction, opened, plainly
from server.store import restoring
from server.store.archive import Manifest
from tests.harness.effort import LONG
from tests.harness.fakes import batch
from tests.harness.mortaldb import Fate, KilledError
from tests.harness.rows import AT, add_job

ROOT = Path(__file__).parents[2]
NOW = datetime(2026, 3, 1, tzinfo=UTC)
LATER = "2027-01-01T00:00:00.000Z"
STORED = [backups.Stored({110: str(rate)}) for rate in (500, 600, 700, 800)]
ROW = Entry(1, 1, 1004, batch(1))
LONG_ROW = Entry(1, 2, 1005, batch(2))
UNSENT_ROW = Entry(1, 4, 1007, batch(4))
WAITED, RAN = 2, 1
"""Numbers of the jobs: one is cancelled while it waits, one is run."""

COMMITS = ("commit", "committed")
"""Both sides of a commit, as the points are called."""

Step = Callable[[Database], Any]


def program(id: str) -> dict[str, Any]:
    return {"id": id, "name": id, "lines": 1, "bytes": 1, "sha256": id, "created_at": AT, "source_program": None}


def keep_backup(stored: backups.Stored) -> Step:
    return partial(backups.keep, machine="router", stored=stored, at=AT, why="change", made_by="admin", firmware="Grbl")


def go(before: Status, after: Status, job: int = RAN) -> Step:
    return partial(store.set_status, id=job, effect=SetStatus(before, after, 0), at=AT)


def seal(job: int) -> Step:
    return lambda db: seals.seal(db, Digest(job), at=AT)


def of_the_token(db: Database, change: Callable[..., Any]) -> None:
    for token in tokens.list_tokens(db):
        change(db, token.id, now=NOW)


def restored(db: Database) -> None:
    """What a restore writes, in its own words."""
    manifest = Manifest("1", AT, (), ())
    restoring._lay_down(db, manifest, AT)
    restoring._revoke(db, manifest, AT, restoring._Replaced({}, AT))
    db.execute("update tokens set revoked_at = ? where id = ?", [AT, "x"])


STEPS: dict[str, Step] = {
    "a program": lambda db: store.add_program(db, program("p")),
    "the same program": lambda db: store.add_program(db, program("p")),
    "an expansion": lambda db: store.add_expansion(db, "p", program("q"), "1"),
    "a job": lambda db: add_job(db),
    "another job": lambda db: add_job(db),
    "the queue": lambda db: store.move(db, WAITED, 0),
    "a hold": lambda db: store.hold_waiting(db, WAITED, True),
    "a hold of the queue": lambda db: store.hold_queue(db, "router", holds.ASKED),
    "a hold of a job": lambda db: store.set_hold(db, RAN, False),
    "checking": go(Status.QUEUED, Status.CHECKING),
    "running": go(Status.CHECKING, Status.RUNNING),
    "room for its ID": lambda db: journal.raise_highest(db, "router", 2000),
    "a row": lambda db: journal.journal(db, "router", ROW, AT),
    "its end": lambda db: journal.mark(db, MarkBatch(ROW, RowStatus.OK, 1, attempts=1)),
    "a row that never goes out": lambda db: journal.journal(db, "router", UNSENT_ROW, AT),
    "its end, too": lambda db: journal.mark(db, MarkBatch(UNSENT_ROW, RowStatus.UNSENT, 1)),
    "a row that is cut": lambda db: journal.journal(db, "router", LONG_ROW, AT),
    "its cut": lambda db: journal.mark(
        db, MarkBatch(LONG_ROW, RowStatus.OK, 2, attempts=1, end={"x": 9.0}, cut=batch(2))
    ),
    "a sign of life": lambda db: journal.alive(db, "router", AT),
    "the pace": lambda db: store.set_pace(db, RAN, 1.0, 2.0),
    "a row that stays open": lambda db: journal.journal(db, "router", Entry(1, 3, 1006, batch(3)), AT),
    "tools": lambda db: toolstore.save(db, "router", toolstore.KeptTools(3, None, None)),
    "a restore": restored,
    "cancelled": go(Status.QUEUED, Status.CANCELLED, WAITED),
    "a seal": seal(RAN),
    "another seal": seal(WAITED),
    "condemned": lambda db: retention.condemn(db, [RAN, WAITED], at=AT),
    "removed": retention.remove_some,
    "removed, too": retention.remove_some,
    "the old end of the history": lambda db: retention.prune_some(db, before=None, at=AT),
    "a program goes": lambda db: store.delete_program(db, "p"),
    **{f"backup {number}": keep_backup(stored) for number, stored in enumerate(STORED)},
    "a token": lambda db: tokens.create_token(db, "screen", "viewer", now=NOW),
    "the token is used": lambda db: of_the_token(db, tokens.note_use),
    "the token is revoked": lambda db: of_the_token(db, tokens.revoke_token),
    "the token is forgotten": lambda db: endedtokens.remove_ended(db, before=LATER),
    "the audit": lambda db: audit.append(db, ASKED),
    "more of the audit": lambda db: audit.append(db, ASKED),
    "the old end of the audit": lambda db: audit.prune_some(db, keep_rows=0, before=LATER, at=AT),
}
ASKED = audit.Entry(AT, "local", None, "admin", "127.0.0.1", "POST", "/jobs")


class Sameness:
    """In the place of `secrets`: a token is the same in each run."""

    def token_hex(self, count: int) -> str:
        return "ab" * count

    def token_urlsafe(self, count: int) -> str:
        return "s" * count


@pytest.fixture(autouse=True)
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tokens, "secrets", Sameness())
    monkeypatch.setattr(backups, "MOST_PER_MACHINE", 2)
    monkeypatch.setattr(retention, "MIN_PRUNED", 1)
    monkeypatch.setattr(audit, "MIN_PRUNED", 1)


def content(path: Path) -> list[str]:
    """Everything in the tables, as a daemon after us finds it, and it is sound."""
    db = opened(plainly(path))
    told = list(db.conn.iterdump())
    assert list(db.query("pragma integrity_check")) == [{"integrity_check": "ok"}]
    assert [*history.faults(db), *seals.faults(db), *audit.faults(db)] == []
    db.close()
    return told


def done(path: Path, step: Step, at: int | None = None) -> Fate:
    """The step on this database, with a death at this point of it."""
    fate = Fate()
    db = opened(fate.connect(path))
    fate.trace.clear()
    fate.count, fate.at = 0, at
    try:
        in_transaction(db, step)
    except KilledError:
        assert fate.struck
    else:
        db.execute("pragma wal_checkpoint(truncate)")
        db.close()
    return fate


def told(folder: Path) -> dict[str, Fate]:
    """All steps without a death; what the database was before each lies in the folder."""
    now = folder / "now.db"
    opened(plainly(now)).close()
    fates = {}
    for name, step in STEPS.items():
        shutil.copyfile(now, folder / f"{name}.db")
        fates[name] = done(now, step)
    return fates


@pytest.mark.slow
def test_a_death_in_any_write_leaves_it_undone_or_done_as_a_whole(tmp_path: Path) -> None:
    points = 0
    for name, fate in told(tmp_path).items():
        assert fate.count, f"{name} writes nothing"
        before, path = tmp_path / f"{name}.db", tmp_path / "killed.db"
        whole = shutil.copyfile(before, tmp_path / "whole.db")
        done(whole, STEPS[name])
        allowed = (content(Path(shutil.copyfile(before, tmp_path / "undone.db"))), content(whole))
        for at, what in enumerate(fate.trace, 1):
            if what not in COMMITS and not LONG:
                continue  # what is not committed SQLite takes back, whatever it is
            for left in tmp_path.glob("killed.db*"):
                left.unlink()
            shutil.copyfile(before, path)
            done(path, STEPS[name], at)
            found = content(path)
            assert found in allowed, f"{name}: killed at {what}"
            points += 1
    assert points >= 2 * len(STEPS)


# --- is that all? ---------------------------------------------------------------------------------------------

WRITES = re.compile(r"\b((?:insert(?: or replace)? into|update|delete from)\s+[^\"'(]{4,200})")


def site(sql: str) -> str:
    """A statement, as far as it is the same in the code and on its way to SQLite."""
    text = " ".join(sql.lower().replace("{table}", "tokens").replace("[", "").replace("]", "").replace('"', "").split())
    return re.split(r"[({']", text)[0].strip()[:36]


def in_the_code() -> dict[str, str]:
    """Each statement that writes, and where it stands. The tables themselves are made by jobs/schema.py, whose deaths
    test_kill_points.py has."""
    found = {}
    for path in [*ROOT.glob("jobs/*.py"), *ROOT.glob("server/**/*.py")]:
        if path.name == "schema.py":
            continue
        text = path.read_text(encoding="utf-8")
        for match in WRITES.finditer(text):
            if re.match(r"(insert|delete|update \S+ set\b)", " ".join(match[1].split())):
                found[site(match[1])] = path.name
        if ".table(TABLE).insert(" in text:
            found[site("insert into [tokens] (")] = path.name
    return found


def test_no_statement_that_writes_is_left_out(tmp_path: Path) -> None:
    reached = {site(what) for fate in told(tmp_path).values() for what in fate.trace}
    left_out = {place: where for place, where in in_the_code().items() if place not in reached}
    assert left_out == {}
    assert len(in_the_code()) > 30


def test_a_connection_that_died_has_kept_nothing_uncommitted(tmp_path: Path) -> None:
    """The judge is judged: a step in two transactions is found to be cut in two."""
    path = tmp_path / "a.db"
    opened(plainly(path)).close()

    def twice(db: Database) -> None:
        store.add_program(db, program("p"))
        db.conn.commit()
        db.conn.execute("begin immediate")
        store.add_program(db, program("q"))

    fate = done(shutil.copyfile(path, tmp_path / "b.db"), twice)
    last = [at for at, what in enumerate(fate.trace, 1) if what == "commit"][-1]
    done(path, twice, last)
    assert [row[0] for row in sqlite3.connect(path).execute("select id from programs")] == ["p"]
