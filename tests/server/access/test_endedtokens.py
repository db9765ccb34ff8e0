"""Tokens that ended long ago lose their rows; the door of a loopback address does not open by that."""

import asyncio
from datetime import UTC, datetime, timedelta
from pathlib import Path

from sqlite_utils import Database

from jobs.schema import prepare
from server.access.endedtokens import KEPT_FOR, remove_ended, remove_old
from server.access.tokens import create_token, list_live_tokens, list_tokens, revoke_token
from server.background.dbthread import InlineDb
from server.clock import rfc3339

NOW = datetime(2026, 3, 1, 9, 30, tzinfo=UTC)
LATER = NOW + timedelta(hours=2)
LONG_AGO = rfc3339(LATER - timedelta(minutes=30))
"""Between what ended an hour after NOW and what ends later."""


def tables() -> Database:
    db = Database(memory=True)
    prepare(db)
    return db


def made(db: Database, name: str, expires: str | None = None, *, revoked_at: datetime | None = None) -> str:
    token, _ = create_token(db, name, "viewer", expires, now=NOW)
    if revoked_at is not None:
        revoke_token(db, token.id, now=revoked_at)
    return token.id


def left(db: Database) -> list[str]:
    return [token.name for token in list_tokens(db)]


def test_what_ended_long_ago_goes_and_nothing_else() -> None:
    db = tables()
    made(db, "good for ever")
    made(db, "good for a year", "365d")
    made(db, "over", "1h")
    made(db, "over lately", "2h")
    made(db, "revoked", revoked_at=NOW)
    made(db, "revoked lately", revoked_at=LATER)
    assert remove_ended(db, before=LONG_AGO) == 2
    assert left(db) == ["good for ever", "good for a year", "over lately", "revoked lately"]
    assert remove_ended(db, before=LONG_AGO) == 0


def test_the_last_ones_stay_although_their_time_is_over() -> None:
    db = tables()
    made(db, "one", "1h")
    made(db, "other", "1h")
    made(db, "gone", "1h", revoked_at=NOW)
    assert remove_ended(db, before=LONG_AGO) == 1
    assert len(list_live_tokens(db)) == 2, "the door stays closed"
    made(db, "new one")
    assert remove_ended(db, before=LONG_AGO) == 2
    assert left(db) == ["new one"]


def test_up_to_when_revoked_ones_are_forgotten_is_noted_and_never_goes_back() -> None:
    db = tables()

    def forgotten() -> list[str]:
        return [row["revoked_until"] for row in db.query("select revoked_until from tokens_forgotten")]

    made(db, "over", "1h")
    made(db, "stays")
    remove_ended(db, before=LONG_AGO)
    assert forgotten() == [], "what is over by its time is over in a backup, too"
    made(db, "a", revoked_at=NOW + timedelta(minutes=5))
    made(db, "b", revoked_at=NOW + timedelta(minutes=9))
    remove_ended(db, before=LONG_AGO)
    assert forgotten() == [rfc3339(NOW + timedelta(minutes=9))]
    made(db, "c", revoked_at=NOW)
    remove_ended(db, before=LONG_AGO)
    assert forgotten() == [rfc3339(NOW + timedelta(minutes=9))]
    assert left(db) == ["stays"]


def test_a_round_takes_what_ended_a_month_ago(tmp_path: Path) -> None:
    class Calendar:
        at = NOW

        def now(self) -> datetime:
            return self.at

    async def main() -> list[int]:
        db = InlineDb(tmp_path / "m.db", asyncio.get_running_loop())
        clock = Calendar()
        await db.run(lambda db: made(db, "guest", revoked_at=NOW))
        removed = []
        for clock.at in (NOW + KEPT_FOR, NOW + KEPT_FOR + timedelta(seconds=1)):
            removed.append(await remove_old(db, clock))
        await db.close()
        return removed

    assert asyncio.run(main()) == [0, 1]
