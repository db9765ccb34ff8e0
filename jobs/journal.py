"""The journal: which lines stand behind which ID on the wire, and how it ended. Runs inside the db thread.

The one rule: a row is durable before its first byte is sent, and it stays `planned` (open) until its end is certain
(elvinto §5.1). Why there are few open rows is argued in runner.py.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from sqlite_utils import Database

from jobs.batch import PlannedBatch
from jobs.effects import Entry, MarkBatch, RowStatus
from protocol.commands import Position
from protocol.errors import LocalError

USUAL: Mapping[str, Any] = {
    "barrier": False,
    "locate_after": False,
    "ends_program": False,
    "tool": None,
    "motion": True,
    "tool_change": False,
    "lines": (),
    "parts": (),
    "pauses": False,
    "io": (),
    "set_tool": None,
}
BODY_FIELDS = ("blocks", "start", *USUAL)
"""What stands in `body`, for the columns do not say it; what is as in USUAL is left out. How far the blocks of an open
row go is of no use any more: it says when they are done."""
IDS_AT_ONCE = 1000
"""The highest ID is raised in such steps: it is a page of its own in the transaction."""

# These are handed exact str, int and float, and None where that is rare: for all else, None, a bool or a StrEnum too,
# sqlite3 looks for an adapter, which takes longer than the rest that it does with the value.
INSERT = """
insert into batches (job, seq, machine, wire_id, line_from, line_to, blocks, seconds, "end", part, body, status,
                     attempts, inferred, planned_at)
values (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, nullif(?, ''), 'planned', 0, 0, ?)
on conflict (job, seq) do update set wire_id = excluded.wire_id, planned_at = excluded.planned_at, status = 'planned'
"""
MARK_AS_PLANNED = """
update batches set status = 'ok', attempts = ?, inferred = ?, sent_at = ?, received_at = ?, ok_at = ?, body = null
where job = ? and seq = ? and wire_id = ?
"""
MARK = """
update batches set status = ?, attempts = ?, inferred = ?, sent_at = ?, received_at = ?, ok_at = ?,
                   "end" = coalesce(?, "end"), body = case when ? then null else body end
where job = ? and seq = ? and wire_id = ?
"""
CUT = """
update batches set line_to = ?, blocks = ?, seconds = ?, part = ? where job = ? and seq = ? and wire_id = ?
"""
RAISE_HIGHEST = """
insert into machines (name, highest_id) values (?, ?)
on conflict (name) do update set highest_id = max(highest_id, excluded.highest_id)
"""


@dataclass(frozen=True, slots=True)
class Past:
    """What the journal knows of a job. `position`: where the machine stood before the first open row, `part`: how far
    it was in the line behind the certain ones, `executed`: the wire ID of the last block that is certain, where a
    batch has the ID of its first block (protocol.engine.OpenWork)."""

    open: tuple[Entry, ...]
    next_seq: int
    position: Position
    seconds_done: float
    part: int = 0
    executed: int | None = None


def journal(db: Database, machine: str, entry: Entry, at: str, again: bool = True) -> None:
    """Write a row, or give the row of the same `seq` its new ID, for which `raise_highest` has made room.

    `again`: after a break its blocks may have to go out again (jobs.delivery); else the row needs none.
    """
    batch = entry.batch
    values = (
        entry.job_id,
        entry.seq,
        machine,
        entry.wire_id,
        batch.first_line,
        batch.last_line,
        len(batch.blocks),
        batch.seconds,
        json.dumps(dict(batch.end)),
        batch.part,
        _body(batch) if again else "",
        at,
    )
    db.conn.execute(INSERT, values)


def raise_highest(db: Database, machine: str, wire_id: int) -> None:
    """No ID above this one will be journaled for this machine before the next call."""
    db.conn.execute(RAISE_HIGHEST, (machine, wire_id))


def mark(db: Database, effect: MarkBatch) -> None:
    """Write the end of a row and how far its job is."""
    entry, done, cut = effect.entry, effect.status is RowStatus.OK, effect.cut
    key = (entry.job_id, entry.seq, entry.wire_id)
    times = (effect.attempts, int(effect.inferred), effect.sent_at, effect.received_at, effect.ok_at)
    planned = effect.end is None or effect.end == entry.batch.end  # stands in the row already
    if done and planned:
        changed = db.conn.execute(MARK_AS_PLANNED, (*times, *key))
    else:
        end = None if planned else json.dumps(dict(effect.end or {}))
        changed = db.conn.execute(MARK, (effect.status, *times, end, done, *key))
    if changed.rowcount != 1:
        raise LocalError(f"no row {entry.seq} of job {entry.job_id} under ID {entry.wire_id} to mark")
    if cut is not None:
        db.conn.execute(CUT, (cut.last_line, len(cut.blocks), cut.seconds, cut.part, *key))
    db.conn.execute("update jobs set line_done = ? where id = ?", (effect.line_done, entry.job_id))


def past(db: Database, job: int, *, most_open: int = 2) -> Past:
    """What a daemon before us left of this job. Raises LocalError when more is open than can be (jobs.delivery)."""
    rows = list(db.query("select * from batches where job = ? and status = 'planned' order by seq", [job]))
    if len(rows) > most_open:
        raise LocalError(f"job {job} has {len(rows)} open rows; there can be {most_open}")
    opened = tuple(Entry(job, row["seq"], row["wire_id"], _batch(row)) for row in rows)
    last = next(
        db.query(
            """select "end", part, wire_id, blocks from batches where job = ? and status = 'ok'
               order by seq desc limit 1""",
            [job],
        ),
        None,
    )
    sums = next(
        db.query("select max(seq) as top, sum(seconds * (status = 'ok')) as s from batches where job = ?", [job])
    )
    position: Position = {}
    if last is not None:
        position = json.loads(last["end"])
    elif opened:
        position = opened[0].batch.start
    part, executed = (0, None) if last is None else (last["part"], last["wire_id"] + last["blocks"] - 1)
    return Past(opened, (sums["top"] or 0) + 1, position, sums["s"] or 0.0, part, executed)


def rows_of(db: Database, job: int, *, limit: int, after: int = 0) -> list[dict[str, Any]]:
    """The journal of a job as the API shows it, oldest first."""
    query = """
        select seq, wire_id, line_from, line_to, blocks, seconds, status, attempts, inferred, planned_at, sent_at,
               received_at, ok_at
        from batches where job = ? and seq > ? order by seq limit ?
    """
    return [{**row, "inferred": bool(row["inferred"])} for row in db.query(query, [job, after, limit])]


def totals(db: Database, job: int) -> dict[str, Any]:
    """The journal of a job in numbers."""
    query = """
        select count(*) as batches, coalesce(sum(blocks), 0) as blocks,
               coalesce(sum(max(attempts - 1, 0)), 0) as retries,
               coalesce(sum(inferred), 0) as inferred, coalesce(sum(status = 'undone'), 0) as sent_again,
               coalesce(sum(seconds * (status = 'ok')), 0) as seconds_estimated
        from batches where job = ?
    """
    (row,) = db.query(query, [job])
    doubtful = db.query(
        """select wire_id, line_from, line_to, status from batches
           where job = ? and status in ('planned', 'failed', 'doubtful') order by seq""",
        [job],
    )
    return {**row, "doubtful": list(doubtful)}


def highest_id(db: Database, machine: str) -> int:
    """No ID above it was ever journaled for this machine."""
    row = next(db.query("select highest_id from machines where name = ?", [machine]), None)
    return 0 if row is None else int(row["highest_id"])


def alive(db: Database, machine: str, at: str) -> None:
    """The machine was heard."""
    db.execute(
        """insert into machines (name, alive_at) values (?, ?)
           on conflict (name) do update set alive_at = excluded.alive_at""",
        [machine, at],
    )


def alive_at(db: Database, machine: str) -> str | None:
    """When the machine was last heard, to the second; RFC 3339."""
    row = next(db.query("select alive_at from machines where name = ?", [machine]), None)
    return None if row is None else row["alive_at"]


def _body(batch: PlannedBatch) -> str:
    body: dict[str, Any] = {"blocks": batch.blocks, "start": dict(batch.start)}
    for name, usual in USUAL.items():
        if (value := getattr(batch, name)) != usual:
            body[name] = value
    return json.dumps(body)


def _batch(row: Mapping[str, Any]) -> PlannedBatch:
    """What is open. Rows of older versions say in their body what the columns say, too."""
    columns = {"first_line": row["line_from"], "last_line": row["line_to"], "seconds": row["seconds"]}
    fields = {**USUAL, **columns, "end": json.loads(row["end"]), **_said(row)}
    fields |= {name: tuple(fields[name]) for name in ("blocks", "lines", "parts")}
    fields["io"] = tuple((letter, number) for letter, number in fields["io"])
    return PlannedBatch(**fields)


def _said(row: Mapping[str, Any]) -> dict[str, Any]:
    """The body; of a row whose blocks are never sent again, which lines they are from."""
    if row["body"] is not None:
        return dict(json.loads(row["body"]))
    first, last, count = row["line_from"], row["line_to"], row["blocks"]
    lines = () if last - first + 1 == count else (*[first] * (count - 1), last)
    return {"blocks": ("",) * count, "start": {}, "lines": lines}
