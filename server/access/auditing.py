"""Keeps the audit as long as `[audit]` says, while the daemon runs. Not what a row is (audit.py).

The one rule: as with the history (retention.py), it is in no hurry: a piece is some milliseconds of the database
thread.
"""

import asyncio
import logging
import sqlite3
from datetime import timedelta

from server.access import audit
from server.background.dbthread import Db
from server.clock import Clock, rfc3339, stamp
from server.config.audit import AuditConfig
from server.problems import ProblemError

log = logging.getLogger(__name__)

EVERY_S = 3600.0
BETWEEN_PIECES_S = 0.05


async def keep_within(config: AuditConfig, db: Db, clock: Clock) -> None:
    """Until it is cancelled."""
    while True:
        try:
            await remove_expired(config, db, clock)
        except (sqlite3.Error, ProblemError) as error:  # a full disk: the next round tries again
            log.warning("Rows of the audit that are kept longer than [audit] says could not be removed: %s", error)
        await asyncio.sleep(EVERY_S)


async def remove_expired(config: AuditConfig, db: Db, clock: Clock) -> int:
    """One round; how many rows went."""
    before = rfc3339(clock.now() - timedelta(days=config.keep_days)) if config.keep_days else None
    removed = 0
    while gone := await db.run(audit.prune_some, keep_rows=config.keep_rows, before=before, at=stamp(clock)):
        removed += gone
        await asyncio.sleep(BETWEEN_PIECES_S)
    return removed
