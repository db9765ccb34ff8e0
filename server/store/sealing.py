"""Seals the journals of ended jobs into the history, one after the other, while the daemon runs.

Not the seal itself (jobs/seals.py) and not retention. The one rule: it is in no hurry. Each piece is a few milliseconds
in the database thread, with a pause behind it, and what a stopped daemon did not get to, the next one does.
"""

import asyncio
import logging
import sqlite3
from datetime import timedelta

from jobs import seals
from jobs.seals import Digest
from server.background.dbthread import Db
from server.clock import Clock, rfc3339, stamp
from server.problems import ProblemError

log = logging.getLogger(__name__)

EVERY_S = 30.0
SETTLED_S = 60.0
"""After the end of a job the last mark of its journal may still be on its way to the database."""
BETWEEN_PIECES_S = 0.05


async def keep_sealing(db: Db, clock: Clock) -> None:
    """Until it is cancelled."""
    while True:
        try:
            await seal_ended(db, clock)
        except (sqlite3.Error, ProblemError) as error:  # a full disk: the next round tries again
            log.warning("The journal of an ended job could not be sealed: %s", error)
        await asyncio.sleep(EVERY_S)


async def seal_ended(db: Db, clock: Clock) -> int:
    """Seal every job that ended a while ago; how many."""
    sealed = 0
    while True:
        before = rfc3339(clock.now() - timedelta(seconds=SETTLED_S))
        job = await db.run(seals.unsealed, ended_before=before)
        if job is None:
            return sealed
        await _seal(db, Digest(job), clock)
        sealed += 1


async def _seal(db: Db, digest: Digest, clock: Clock) -> None:
    while True:
        if await db.run(seals.seal, digest, at=stamp(clock)):
            return
        await asyncio.sleep(BETWEEN_PIECES_S)
