"""Rows of tokens that ended long ago, by revocation or with their time, are taken away while the daemon runs.

Not the tokens (tokens.py), nor how a restore treats those of a backup (server/store/restoring.py). The one rule: no
backup brings one of them back. What is over by its time is over in a backup, too; of the revoked ones the table keeps
one time stamp, and a backup from before it is believed only in the tokens that are still known.
"""

import asyncio
import logging
import sqlite3
from datetime import timedelta

from sqlite_utils import Database

from server.background.dbthread import Db
from server.clock import Clock, rfc3339
from server.problems import ProblemError

log = logging.getLogger(__name__)

KEPT_FOR = timedelta(days=30)
"""So long `millstream token list` still shows them, and one whose time is over is told so. What was done with them is
in the audit for as long as that is kept. It is also how old a backup may be of which every token is believed."""
EVERY_S = 3600.0


def remove_ended(db: Database, *, before: str) -> int:
    """Take away the tokens that were revoked, or were over, before this time; how many there were."""
    with db.conn:
        (until,) = db.execute("select max(revoked_at) from tokens where revoked_at < ?", [before]).fetchone()
        if until is not None:
            db.execute(
                """insert into tokens_forgotten (id, revoked_until) values (1, ?)
                   on conflict (id) do update set revoked_until = max(revoked_until, excluded.revoked_until)""",
                [until],
            )
        removed = db.execute("delete from tokens where revoked_at < ?", [before]).rowcount
        # The last ones stay although their time is over: without any the door of a loopback address would be open.
        removed += db.execute(
            """delete from tokens where revoked_at is null and expires_at < :before and exists (
                   select 1 from tokens where revoked_at is null and (expires_at is null or expires_at >= :before))""",
            {"before": before},
        ).rowcount
    return removed


async def remove_old(db: Db, clock: Clock) -> int:
    """One round; how many rows went."""
    removed = await db.run(remove_ended, before=rfc3339(clock.now() - KEPT_FOR))
    if removed:
        log.info("%d tokens that ended more than %d days ago were taken out of the table", removed, KEPT_FOR.days)
    return removed


async def keep_removing(db: Db, clock: Clock) -> None:
    """Until it is cancelled."""
    while True:
        try:
            await remove_old(db, clock)
        except (sqlite3.Error, ProblemError) as error:  # a full disk: the next round tries again
            log.warning("Rows of tokens that ended long ago could not be removed: %s", error)
        await asyncio.sleep(EVERY_S)
