"""The writer thread and its twin: order, durability, and what happens when the disk is full."""

import asyncio
import sqlite3
import threading
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest
from sqlite_utils import Database

from server.background.dbthread import Db, DbThread, InlineDb, opened, plainly, refusal
from server.problems import ProblemError
from tests.harness.simloop import run_simulated


def put(db: Database, number: int) -> None:
    db.execute("insert into t (n) values (?)", [number])


def numbers(db: Database) -> list[int]:
    return [row["n"] for row in db.query("select n from t order by rowid")]


@asynccontextmanager
async def thread(folder: Path) -> AsyncIterator[DbThread]:
    db = DbThread(folder / "m.db", asyncio.get_running_loop())
    await db.run(lambda db: db.execute("create table t (n integer)"))
    try:
        yield db
    finally:
        await db.close()


async def everything_posted_is_done_in_order(db: Db) -> None:
    told: list[int] = []
    for number in range(200):
        db.post(put, number, then=lambda number=number: told.append(number))
    assert await db.run(numbers) == list(range(200)), "a request sees everything that was posted before it"
    await asyncio.sleep(0)
    assert told == list(range(200))
    assert await db.read(numbers) == list(range(200))
    with pytest.raises(ZeroDivisionError):
        await db.run(lambda _db: 1 // 0)
    with pytest.raises(ZeroDivisionError):
        await db.run(_half)
    assert 777 not in await db.run(numbers), "a request that fails leaves nothing"
    with pytest.raises(ProblemError, match="readonly"):
        await db.read(put, 888)
    assert 888 not in await db.run(numbers), "who reads can write nothing"
    await db.run(put, 999)
    assert 999 in await db.read(numbers)


def _half(db: Database) -> None:
    put(db, 777)
    raise ZeroDivisionError


@pytest.mark.real
def test_the_thread_keeps_the_order(tmp_path: Path) -> None:
    async def main() -> None:
        async with thread(tmp_path) as db:
            await everything_posted_is_done_in_order(db)

    asyncio.run(main())


def test_the_twin_keeps_the_order(tmp_path: Path) -> None:
    async def main() -> None:
        db = InlineDb(tmp_path / "m.db", asyncio.get_running_loop(), latency_s=0.5)
        await db.run(lambda db: db.execute("create table t (n integer)"))
        await everything_posted_is_done_in_order(db)
        await db.close()

    run_simulated(main())


def test_the_twin_loses_in_a_crash_what_is_not_durable(tmp_path: Path) -> None:
    async def main() -> None:
        loop = asyncio.get_running_loop()
        db = InlineDb(tmp_path / "m.db", loop, latency_s=0.5)
        await db.run(lambda db: db.execute("create table t (n integer)"))
        told: list[int] = []
        db.post(put, 1, then=lambda: told.append(1))
        assert told == []
        await asyncio.sleep(0.6)
        assert told == [1]
        db.post(put, 2, then=lambda: told.append(2))
        db.crash()
        after = InlineDb(tmp_path / "m.db", loop)
        assert await after.run(numbers) == [1]
        await after.close()
        assert told == [1]

    run_simulated(main())


@pytest.mark.real
def test_close_writes_what_was_posted(tmp_path: Path) -> None:
    async def main() -> None:
        async with thread(tmp_path) as db:
            for number in range(300):
                db.post(put, number)
        after = sqlite3.connect(tmp_path / "m.db")
        assert after.execute("select count(*) from t").fetchone() == (300,)
        after.close()

    asyncio.run(main())


@pytest.mark.real
def test_functions_run_in_the_thread_and_callbacks_on_the_loop(tmp_path: Path) -> None:
    async def main() -> None:
        async with thread(tmp_path) as db:
            here = threading.get_ident()
            called = asyncio.get_running_loop().create_future()
            db.post(put, 1, then=lambda: called.set_result(threading.get_ident()))
            assert await db.run(lambda _db: threading.get_ident()) != here
            assert await called == here

    asyncio.run(main())


class Disk:
    """A function that fails like a full disk until there is room."""

    def __init__(self) -> None:
        self.room = threading.Event()
        self.tried = threading.Event()

    def put(self, db: Database, number: int) -> None:
        put(db, number)
        if not self.room.is_set():
            self.tried.set()
            raise sqlite3.OperationalError("database or disk is full")


@pytest.mark.real
def test_a_full_disk_stops_everything_posted_and_nothing_overtakes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("server.background.dbthread.RETRY_S", 0.01)

    async def main() -> None:
        async with thread(tmp_path) as db:
            disk, told = Disk(), list[int]()
            db.post(put, 1, then=lambda: told.append(1))
            await db.run(numbers)
            db.post(disk.put, 2, then=lambda: told.append(2))
            db.post(put, 3, then=lambda: told.append(3))
            await asyncio.to_thread(disk.tried.wait, 10)
            with pytest.raises(ProblemError) as refused:
                await db.run(numbers)
            assert refused.value.code == "disk_full"
            assert await db.read(numbers) == [1], "who only reads is answered, with what is durable"
            assert told == [1]
            assert db.trouble is not None
            disk.room.set()
            while told != [1, 2, 3]:
                await asyncio.sleep(0)
            assert await db.run(numbers) == [1, 2, 3]
            assert db.trouble is None

    asyncio.run(main())


@pytest.mark.real
def test_a_daemon_can_end_although_the_disk_is_full(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("server.background.dbthread.RETRY_S", 0.01)

    async def main() -> None:
        async with thread(tmp_path) as db:
            db.post(Disk().put, 1)

    asyncio.run(main())


@pytest.mark.real
def test_a_request_on_a_full_disk_is_refused_with_what_to_do(tmp_path: Path) -> None:
    async def main() -> None:
        async with thread(tmp_path) as db:
            with pytest.raises(ProblemError) as refused:
                await db.run(Disk().put, 1)
            assert refused.value.code == "disk_full"
            with pytest.raises(sqlite3.OperationalError, match="no such table"):
                await db.run(lambda db: list(db.query("select * from no_such_table")))

    asyncio.run(main())


@pytest.mark.real
def test_a_request_that_was_given_up_disturbs_nobody(tmp_path: Path) -> None:
    async def main() -> None:
        async with thread(tmp_path) as db:
            hold = threading.Event()
            waiting: Any = asyncio.ensure_future(db.run(lambda _db: hold.wait(10)))
            await asyncio.sleep(0)
            waiting.cancel()
            hold.set()
            assert await db.run(numbers) == []

    asyncio.run(main())


class Grouping(DbThread):
    """Remembers how many posted functions each transaction had."""

    def __init__(self, path: Path, loop: asyncio.AbstractEventLoop) -> None:
        self.groups: list[int] = []
        super().__init__(path, loop)

    def _commit(self, group: list[Any]) -> None:
        self.groups.append(len(group))
        super()._commit(group)


@pytest.mark.real
def test_what_one_step_posts_is_one_transaction(tmp_path: Path) -> None:
    async def main() -> None:
        db = Grouping(tmp_path / "m.db", asyncio.get_running_loop())
        await db.run(lambda db: db.execute("create table t (n integer)"))
        for round_ in range(5):
            durable = asyncio.Event()
            db.post(put, 2 * round_)
            db.post(put, 2 * round_ + 1, then=durable.set)
            await durable.wait()
        assert db.groups == [2] * 5
        assert await db.run(numbers) == list(range(10))
        await db.close()

    asyncio.run(main())


@pytest.mark.real
def test_what_nobody_waits_for_is_written_all_the_same(tmp_path: Path) -> None:
    async def main() -> None:
        db = Grouping(tmp_path / "m.db", asyncio.get_running_loop())
        await db.run(lambda db: db.execute("create table t (n integer)"))
        db.post(put, 1)
        async with asyncio.timeout(30):
            while not db.groups:  # written by the linger alone: nothing else is asked of the thread
                await asyncio.sleep(0)
        db.post(put, 2)
        await db.close()
        assert db.groups == [1, 1], "closing waits for what lingers"

    asyncio.run(main())


@pytest.mark.real
def test_what_may_wait_longer_goes_with_what_may_not(tmp_path: Path) -> None:
    async def main() -> None:
        db = Grouping(tmp_path / "m.db", asyncio.get_running_loop())
        await db.run(lambda db: db.execute("create table t (n integer)"))
        db.post(put, 1, linger_s=3600.0)
        db.post(put, 2)
        db.post(put, 3, linger_s=3600.0)
        async with asyncio.timeout(30):
            while not db.groups:
                await asyncio.sleep(0)
        assert db.groups == [3], "in order, when the most impatient is written"
        assert await db.run(numbers) == [1, 2, 3]
        await db.close()

    asyncio.run(main())


@pytest.mark.parametrize(
    ("said", "code", "advice"),
    [
        ("database or disk is full", "disk_full", "Free some space"),
        ("database disk image is malformed", "database_error", "millstream restore"),
        ("file is not a database", "database_error", "millstream restore"),
        ("disk I/O error", "database_error", "dmesg"),
        ("attempt to write a readonly database", "database_error", "permissions"),
    ],
)
def test_what_people_can_mend_is_told_with_what_to_do(said: str, code: str, advice: str) -> None:
    refused = refusal(sqlite3.DatabaseError(said))
    assert isinstance(refused, ProblemError)
    assert refused.code == code
    assert said in refused.detail
    assert advice in refused.detail


@pytest.mark.real
def test_a_posted_write_that_fails_for_a_reason_of_ours_is_no_full_disk(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("server.background.dbthread.RETRY_S", 0.01)

    async def main() -> None:
        async with thread(tmp_path) as db:
            tried = threading.Event()

            def broken(_db: Database) -> None:
                tried.set()
                raise ZeroDivisionError

            db.post(broken)
            await asyncio.to_thread(tried.wait, 10)
            with pytest.raises(ProblemError) as refused:
                await db.run(numbers)
            assert refused.value.code == "database_error"

    asyncio.run(main())


def test_a_file_that_is_no_database_is_said_to_be_damaged_and_left_as_it_is(tmp_path: Path) -> None:
    path = tmp_path / "m.db"
    path.write_bytes(b"not a database at all, and long enough to be looked at" * 100)
    before = path.read_bytes()
    with pytest.raises(sqlite3.DatabaseError, match="not a database"):
        opened(plainly(path))
    assert path.read_bytes() == before
