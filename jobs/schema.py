"""The tables of the daemon's one database, as migrations. Not the statements that use them (store, journal, history).

The one rule: a migration that was released is never edited; what has to change is a new one at the end.
"""

import sqlite3
from contextlib import closing

from sqlite_utils import Database
from sqlite_utils.migrations import Migrations

migrations = Migrations("millstream")

EVENTS_ARE_FINAL = """
create trigger events_no_{verb} before {verb} on events
begin select raise(abort, 'history is append-only'); end
"""


@migrations()
def m001_programs(db: Database) -> None:
    """Programs by content hash; the text itself is a file (jobs/program.py)."""
    db.execute("""
        create table programs (
            id text primary key, name text not null, lines integer not null, bytes integer not null,
            sha256 text not null, created_at text not null)
    """)


@migrations()
def m002_jobs(db: Database) -> None:
    """`rank` orders the queue of a machine. `line_done`: every line up to it was executed."""
    db.execute("""
        create table jobs (
            id integer primary key autoincrement, machine text not null, program text not null,
            program_name text not null, status text not null, rank integer not null, hold integer not null,
            note text, forced integer not null, start_line integer not null, end_line integer not null,
            lines integer not null, total_seconds real, line_done integer not null, tool integer,
            restarted integer not null, error_code text, error_message text, error_line_from integer,
            error_line_to integer, idempotency_key text unique, request_hash text, rerun_of integer,
            created_at text not null, started_at text, ended_at text)
    """)
    db.execute("create index jobs_by_machine on jobs (machine, status, rank)")
    db.execute("create index jobs_by_program on jobs (program)")


@migrations()
def m003_batches(db: Database) -> None:
    """The journal. `body` is what is needed to send the same bytes again, where that can happen (jobs.delivery); it is
    dropped when the batch is done."""
    db.execute("""
        create table batches (
            job integer not null references jobs (id), seq integer not null, machine text not null,
            wire_id integer not null, line_from integer not null, line_to integer not null, blocks integer not null,
            seconds real not null, "end" text not null, body text, status text not null, attempts integer not null,
            inferred integer not null, planned_at text not null, sent_at text, received_at text, ok_at text,
            primary key (job, seq)) without rowid
    """)
    db.execute("create index batches_open on batches (job, seq) where status = 'planned'")


@migrations()
def m004_events(db: Database) -> None:
    """History: append-only, each row with the hash of the one before."""
    db.execute("""
        create table events (
            id integer primary key autoincrement, at text not null, machine text, job integer, type text not null,
            data text not null, previous text not null, hash text not null)
    """)
    db.execute("create index events_by_job on events (job, id)")
    for verb in ("update", "delete"):
        db.execute(EVENTS_ARE_FINAL.format(verb=verb))


@migrations()
def m005_tokens(db: Database) -> None:
    """Access tokens; `hash` is all that is kept of the secret."""
    db.execute("""
        create table tokens (
            id text primary key, name text not null, role text not null, hash text not null unique,
            created_at text not null, last_used_at text, revoked_at text)
    """)


@migrations()
def m006_machines(db: Database) -> None:
    """`highest_id`: no wire ID above it was ever journaled. `alive_at`: the last sign of life, to the second."""
    db.execute("""
        create table machines (name text primary key, highest_id integer not null default 0, alive_at text)
    """)


@migrations()
def m007_expansions(db: Database) -> None:
    """Programs that were made of others (jobs/expansion.py): of what, and by which `version` of the daemon, for a later
    one may know better. `source_program` is null for uploads and for jobs of plain programs."""
    db.execute("alter table programs add column source_program text")
    db.execute("alter table jobs add column source_program text")
    db.execute("create table expansions (source text primary key, expanded text not null, version text not null)")


@migrations()
def m008_pace(db: Database) -> None:
    """Planned seconds of what a job has executed, and what it took while the machine was moving: pauses, waits and
    breaks are in neither. Null where nothing was measured."""
    db.execute("alter table jobs add column planned_seconds real")
    db.execute("alter table jobs add column moving_seconds real")
    db.execute("create index jobs_completed on jobs (machine, id) where status = 'completed'")


@migrations()
def m009_settings_backups(db: Database) -> None:
    """What a controller had stored before somebody changed it (jobs/backups.py). `content` is JSON, `made_by` the name
    of who changed it."""
    db.execute("""
        create table settings_backups (
            id integer primary key autoincrement, machine text not null, at text not null, why text not null,
            made_by text not null, firmware text not null, settings integer not null, content text not null)
    """)
    db.execute("create index settings_backups_by_machine on settings_backups (machine, id)")


@migrations()
def m010_modes(db: Database) -> None:
    """`mode`: run, or check: the controller's own parser without motion. `on_error`, `ignored_errors` (codes with
    commas): what follows a refused line; null where the protocol knows no such choice."""
    db.execute("alter table jobs add column mode text not null default 'run'")
    db.execute("alter table jobs add column on_error text")
    db.execute("alter table jobs add column ignored_errors text")


@migrations()
def m011_tool_changers(db: Database) -> None:
    """What outlives a daemon of a machine's tools (jobs/toolstore.py). `fault`: the reason of a latched fault, or null;
    `tool_table`: in LinuxCNC's format, or null where there is none."""
    db.execute("""
        create table tool_changers (
            machine text primary key, tool integer not null, tool_known integer not null, tool_table text,
            fault integer)
    """)


@migrations()
def m012_parts(db: Database) -> None:
    """`part` of a row that ends within a line: how far the line is then (jobs/frames.py); 0: it ends with its line."""
    db.execute("alter table batches add column part integer not null default 0")


@migrations()
def m013_history_anchor(db: Database) -> None:
    """What retention removed of the history (jobs/history.py): one row, the number and the hash of the last event that
    is gone. Only what lies before it may be deleted. `sealed`: the job's journal stands in the history by its hash."""
    db.execute("""
        create table history_anchor (
            id integer primary key check (id = 1), up_to integer not null, hash text not null, at text not null)
    """)
    db.execute("drop trigger events_no_delete")
    db.execute("""
        create trigger events_no_delete before delete on events
        when old.id > (select coalesce(max(up_to), 0) from history_anchor)
        begin select raise(abort, 'history is append-only'); end
    """)
    db.execute("alter table jobs add column sealed integer not null default 0")
    db.execute("create index jobs_unsealed on jobs (id) where sealed = 0")


@migrations()
def m014_tool_events(db: Database) -> None:
    """What happened at tool changers, without a job too, is found without reading all of the history."""
    db.execute("""
        create index events_of_tools on events (machine, id)
        where substr(type, 1, 2) = 'io' or substr(type, 1, 4) = 'tool'
    """)


@migrations()
def m015_program_uploads(db: Database) -> None:
    """When a program that was known already was uploaded again: somebody means to use it (jobs/retention.py)."""
    db.execute("create table program_uploads (program text primary key, at text not null)")


@migrations()
def m016_token_expiry(db: Database) -> None:
    """When a token ends by itself; null: never."""
    db.execute("alter table tokens add column expires_at text")


AUDIT_IS_FINAL = """
create trigger audit_no_update before update on audit
begin select raise(abort, 'the audit is append-only'); end
"""
AUDIT_STAYS = """
create trigger audit_no_delete before delete on audit
when old.id > (select coalesce(max(up_to), 0) from audit_anchor)
begin select raise(abort, 'the audit is append-only'); end
"""


@migrations()
def m017_audit(db: Database) -> None:
    """Who has asked for what (server/access/audit.py): a chain as the history is, with an anchor of its own."""
    db.execute("""
        create table audit (
            id integer primary key autoincrement, at text not null, via text not null, token text, name text not null,
            address text not null, method text not null, route text not null, machine text, job integer, target text,
            status integer not null, code text, lost integer not null, previous text not null, hash text not null)
    """)
    db.execute("""
        create table audit_anchor (
            id integer primary key check (id = 1), up_to integer not null, hash text not null, at text not null)
    """)
    db.execute(AUDIT_IS_FINAL)
    db.execute(AUDIT_STAYS)


@migrations()
def m018_hold_reason(db: Database) -> None:
    """Why a job that waits is on hold (jobs/holds.py)."""
    db.execute("alter table jobs add column hold_code text")
    db.execute("alter table jobs add column hold_message text")


@migrations()
def m019_tokens_forgotten(db: Database) -> None:
    """No token that was revoked up to then has a row any more, perhaps (server/access/endedtokens.py)."""
    db.execute("""
        create table tokens_forgotten (id integer primary key check (id = 1), revoked_until text not null)
    """)


@migrations()
def m020_no_index_of_open_batches(db: Database) -> None:
    """Each row of the journal went into it and out again, a page of each transaction; it was read at a start alone,
    where all rows of the job are read anyway (jobs/journal.py)."""
    db.execute("drop index batches_open")


class NewerDatabaseError(sqlite3.DatabaseError):
    """The tables were brought up to date by a version after this one."""


def unknown_migrations(db: Database) -> list[str]:
    """The changes of the tables that were made by a version after this one."""
    with closing(Database(memory=True)) as empty:
        known = {one.name for one in migrations.pending(empty)}
    return sorted(one.name for one in migrations.applied(db) if one.name not in known)


def prepare(db: Database) -> None:
    """Set the connection up and bring the tables to the newest state. Raises NewerDatabaseError."""
    if unknown := unknown_migrations(db):
        raise NewerDatabaseError(f"it was made by a newer version of millstream ({', '.join(unknown)})")
    db.execute("pragma journal_mode = wal")
    # A journal row that was reported durable must survive a power cut, not only a crash of the process.
    db.execute("pragma synchronous = full")
    db.execute("pragma foreign_keys = on")
    db.execute("pragma busy_timeout = 5000")
    with db.atomic():  # the table of the migrations is made in two steps: killed between them it would have no index
        migrations.ensure_migrations_table(db)
    migrations.apply(db)
