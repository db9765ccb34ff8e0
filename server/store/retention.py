"""Keeps the database as large as `[history]` says, while the daemon runs. Not what may go (jobs/retention.py).

The one rule: it is in no hurry. A piece is some milliseconds in the database thread, with a pause behind it in which
journals are written; what a stopped daemon did not get to, the next one does.
"""

import asyncio
import logging
import sqlite3
from collections.abc import Awaitable, Callable
from datetime import timedelta
from functools import partial

from jobs import retention
from server.background.dbthread import Db
from server.clock import Clock, rfc3339, stamp
from server.config.history import HistoryConfig
from server.problems import ProblemError

log = logging.getLogger(__name__)

EVERY_S = 3600.0
BETWEEN_PIECES_S = 0.05


async def keep_within(config: HistoryConfig, db: Db, clock: Clock, delete: Callable[[str], Awaitable[None]]) -> None:
    """Until it is cancelled. `delete` removes a program with its file, or raises ProblemError where it is needed."""
    while config.removes:
        try:
            await remove_expired(config, db, clock, delete)
        except (sqlite3.Error, ProblemError, OSError) as error:  # a full disk: the next round tries again
            log.warning("What is kept longer than [history] says could not be removed: %s", error)
        await asyncio.sleep(EVERY_S)


async def remove_expired(config: HistoryConfig, db: Db, clock: Clock, delete: Callable[[str], Awaitable[None]]) -> None:
    """One round: jobs and their journals, the old end of the history, programs that nobody uses."""
    before = _days_ago(clock, config.keep_days)
    while True:
        await _in_pieces(partial(db.run, retention.remove_some))  # also what a daemon before us began
        jobs = await db.run(retention.expired, ended_before=before, keep=config.keep_jobs)
        if not jobs:
            break
        log.info("Removing %d jobs that are kept longer than [history] says: %d to %d", len(jobs), jobs[0], jobs[-1])
        await db.run(retention.condemn, jobs, at=stamp(clock))
    if config.keep_days or config.keep_jobs:
        await _in_pieces(partial(db.run, retention.prune_some, before=before, at=stamp(clock)))
    await _remove_programs(config, db, clock, delete)


async def _remove_programs(
    config: HistoryConfig, db: Db, clock: Clock, delete: Callable[[str], Awaitable[None]]
) -> None:
    before = _days_ago(clock, config.keep_unused_programs_days)
    stayed: set[str] = set()
    while before is not None:
        # Beyond those that stay, whatever keeps them: one that cannot be deleted keeps no other.
        most = retention.PIECE_JOBS + len(stayed)
        programs = set(await db.run(retention.unused_programs, created_before=before, limit=most)) - stayed
        if not programs:
            break
        for program in sorted(programs):
            try:
                await delete(program)
            except ProblemError as problem:  # it is needed again, or somebody else has deleted it
                log.info("Program %s stays: %s", program, problem)
                stayed.add(program)
            except OSError as error:
                log.warning("Program %s could not be removed: %s", program, error)
                stayed.add(program)
            await asyncio.sleep(BETWEEN_PIECES_S)


async def _in_pieces(piece: Callable[[], Awaitable[int]]) -> None:
    """Until there is none any more."""
    while True:
        if not await piece():
            return
        await asyncio.sleep(BETWEEN_PIECES_S)


def _days_ago(clock: Clock, days: int) -> str | None:
    return rfc3339(clock.now() - timedelta(days=days)) if days else None
