"""The journal: what is written comes back as the same bytes to send, and every row ends once."""

import json
from dataclasses import fields
from typing import Any

import pytest

from jobs import journal
from jobs.batch import PlannedBatch
from jobs.effects import Entry, MarkBatch, RowStatus
from protocol.errors import LocalError
from tests.harness.fakes import batch
from tests.harness.rows import AT, add_job, database


def entry(db_job: int, seq: int, wire_id: int, line: int, **changes: Any) -> Entry:
    return Entry(db_job, seq, wire_id, batch(line, **changes))


def ok(row: Entry, line: int, **changes: Any) -> MarkBatch:
    return MarkBatch(row, RowStatus.OK, line, attempts=1, sent_at=AT, received_at=AT, ok_at=AT, **changes)


def test_an_open_row_comes_back_as_it_was() -> None:
    with database() as db:
        job = add_job(db)
        row = entry(job, 1, 1004, 3, tool=5, tool_change=True, barrier=True, start={"x": 0.1}, end={"z": 30.0})
        journal.journal(db, "router", row, AT)
        past = journal.past(db, job)
        assert past.open == (row,)
        assert past.open[0].command() == row.command()
        assert (past.next_seq, past.position) == (2, {"x": 0.1})


def test_what_is_never_sent_again_is_known_by_its_lines() -> None:
    with database() as db:
        job = add_job(db)
        rows = [
            entry(job, 1, 1004, 3, blocks=("X1", "X2"), last_line=4),
            entry(job, 2, 1006, 5, blocks=("X3", "X4", "X5"), lines=(5, 7, 8), last_line=8, end={"x": 5.0}),
        ]
        for row in rows:
            journal.journal(db, "router", row, AT, again=False)
        assert [row["body"] for row in db.query("select body from batches")] == [None, None]
        for row, kept in zip(rows, journal.past(db, job).open, strict=True):
            before, after = row.batch, kept.batch
            assert (kept.seq, kept.wire_id, len(after.blocks)) == (row.seq, row.wire_id, len(before.blocks))
            assert (after.first_line, after.last_line, after.end) == (before.first_line, before.last_line, before.end)
            assert [after.line_of(0), after.line_of(-1 + len(after.blocks))] == [before.first_line, before.last_line]
            assert not any(after.blocks), "there is nothing that could be sent"


def test_a_row_of_an_older_version_says_everything_in_its_body() -> None:
    with database() as db:
        job = add_job(db)
        row = entry(job, 1, 1004, 3, io=(("T", 5),), lines=(3, 7), last_line=7)
        journal.journal(db, "router", row, AT)
        names = [field.name for field in fields(PlannedBatch) if field.name != "reach_mm"]
        body = {name: getattr(row.batch, name) for name in names}
        db.execute("update batches set body = ?", [json.dumps(body)])
        assert journal.past(db, job).open == (row,)


def test_a_new_id_takes_the_place_of_the_old_one() -> None:
    with database() as db:
        job = add_job(db)
        journal.journal(db, "router", entry(job, 1, 1004, 1), AT)
        journal.journal(db, "router", entry(job, 1, 1009, 1), AT)
        assert [row.wire_id for row in journal.past(db, job).open] == [1009]
        with pytest.raises(LocalError, match="no row 1"):
            journal.mark(db, ok(entry(job, 1, 1004, 1), 2))


def test_a_done_row_says_how_far_the_job_is_and_drops_what_nobody_needs_any_more() -> None:
    with database() as db:
        job = add_job(db)
        row = entry(job, 1, 1004, 1)
        journal.journal(db, "router", row, AT)
        journal.mark(db, ok(row, 2, end={"x": 7.0}))
        past = journal.past(db, job)
        assert (past.open, past.position, past.seconds_done) == ((), {"x": 7.0}, 0.5)
        (stored,) = db.query("select body from batches")
        assert stored["body"] is None
        (of_job,) = db.query("select line_done from jobs")
        assert of_job["line_done"] == 2
        (shown,) = journal.rows_of(db, job, limit=10)
        assert (shown["status"], shown["ok_at"], shown["inferred"]) == ("ok", AT, False)


def test_the_position_before_the_first_open_row_is_the_end_of_the_last_done_one() -> None:
    with database() as db:
        job = add_job(db)
        rows = [entry(job, seq, 1000 + seq, 2 * seq) for seq in range(1, 4)]
        for row in rows:
            journal.journal(db, "router", row, AT)
        journal.mark(db, ok(rows[0], 3))
        past = journal.past(db, job)
        assert [row.seq for row in past.open] == [2, 3]
        assert past.position == {"x": 3.0}


def test_more_open_rows_than_there_can_be_are_a_bug_that_is_said() -> None:
    with database() as db:
        job = add_job(db)
        for seq in range(1, 4):
            journal.journal(db, "router", entry(job, seq, 1000 + seq, 2 * seq), AT)
        with pytest.raises(LocalError, match="3 open rows"):
            journal.past(db, job)


@pytest.mark.parametrize("status", [RowStatus.UNSENT, RowStatus.UNDONE, RowStatus.FAILED, RowStatus.DOUBTFUL])
def test_every_other_end_closes_the_row_too(status: RowStatus) -> None:
    with database() as db:
        job = add_job(db)
        row = entry(job, 1, 1004, 1)
        journal.journal(db, "router", row, AT)
        journal.mark(db, MarkBatch(row, status, 0))
        assert journal.past(db, job).open == ()
        assert journal.totals(db, job)["doubtful"] == (
            [{"wire_id": 1004, "line_from": 1, "line_to": 2, "status": status}]
            if status in (RowStatus.FAILED, RowStatus.DOUBTFUL)
            else []
        )


def test_totals() -> None:
    with database() as db:
        job = add_job(db)
        assert journal.totals(db, job)["batches"] == 0
        row = entry(job, 1, 1004, 1)
        journal.journal(db, "router", row, AT)
        journal.mark(db, MarkBatch(row, RowStatus.OK, 2, attempts=3, inferred=True))
        totals = journal.totals(db, job)
        assert (totals["batches"], totals["blocks"], totals["retries"], totals["inferred"]) == (1, 2, 2, 1)


def test_the_highest_id_never_falls_and_is_kept_for_each_machine() -> None:
    with database() as db:
        assert journal.highest_id(db, "router") == 0
        journal.raise_highest(db, "router", 5000)
        journal.raise_highest(db, "router", 2000)
        assert (journal.highest_id(db, "router"), journal.highest_id(db, "other")) == (5000, 0)


def test_signs_of_life() -> None:
    with database() as db:
        assert journal.alive_at(db, "router") is None
        for at in ("2026-03-01T09:00:00.000Z", "2026-03-01T09:00:01.000Z"):
            journal.alive(db, "router", at)
        assert journal.alive_at(db, "router") == "2026-03-01T09:00:01.000Z"
        assert journal.highest_id(db, "router") == 0


def test_a_row_that_ends_within_a_line_says_how_far_it_is() -> None:
    with database() as db:
        job = add_job(db)
        row = entry(job, 1, 1004, 3, blocks=("X1", "X2"), lines=(3, 3), parts=(2, 3), last_line=3, end={"x": 2.0})
        journal.journal(db, "router", row, AT)
        assert journal.past(db, job).open == (row,)
        journal.mark(db, ok(row, 2))
        past = journal.past(db, job)
        assert (past.position, past.part, past.executed) == ({"x": 2.0}, 3, 1005)


def test_a_row_that_was_cut_tells_what_was_executed_of_it() -> None:
    with database() as db:
        job = add_job(db)
        row = entry(job, 1, 1004, 3, blocks=("X1", "X2", "X3"), lines=(3, 4, 4), parts=(0, 2, 0), last_line=4)
        journal.journal(db, "router", row, AT)
        first, _ = row.batch.cut(2, {"x": 3.0})
        journal.mark(db, ok(row, 3, end=first.end, cut=first))
        past = journal.past(db, job)
        assert (past.open, past.position, past.part, past.executed) == ((), {"x": 3.0}, 2, 1005)
        (shown,) = journal.rows_of(db, job, limit=10)
        assert (shown["line_from"], shown["line_to"], shown["blocks"], shown["status"]) == (3, 4, 2, "ok")
