"""kill -9 at every point at which the database is written, one after the other, with each protocol.

A story (programs, jobs, a pause, the queue, a token, a seal) is told once to count the points, then once for each:
there the daemon dies, the files stay as they lie, a new daemon opens them and the same people ask for the same again.
What the machine executed is the judge: no line is lost, doubled or out of turn, or the job says what is in doubt.
"""

import asyncio
import shutil
import sqlite3
from abc import ABC, abstractmethod
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from sqlite_utils import Database

from jobs import history, seals
from jobs.schema import prepare
from server.background.dbthread import opened, plainly
from server.config.reentry import ReentryWish
from server.store import sealing
from sim.elvinto.settings import SimSettings
from tests.harness.effort import LONG
from tests.harness.grblworkshop import GrblBench
from tests.harness.mortaldb import Fate, KilledError
from tests.harness.ncworkshop import HERE, NcBench
from tests.harness.simloop import run_simulated, until
from tests.harness.workshop import MACHINE, Bench, kill

LINES = 10
PART = "".join(["G21 G90\n", *(f"G1 X{x} F240\n" for x in range(1, LINES + 1)), "M30\n"])
OTHER = "G21 G90\nG1 X50 F240\nM30\n"
SHORT = {"resume_within": 60.0}
AWAY_S = 0.3
KEY = "the part"
WISH = ReentryWish(clearance=5.0, plunge_feed=500.0, spindle_wait=0.0, force=True)


class Story(ABC):
    """What people ask of the daemon, again where it died before it answered. The machine outlives all daemons."""

    def __init__(self, bench: Any, fate: Fate) -> None:
        self.bench, self.fate = bench, fate
        self.paused = False
        self.doubts = 0
        fate.strike = self.strike
        bench.connect = fate.connect

    def strike(self) -> None:
        """Everything of the daemon stops, wherever it is."""
        bench, shop = self.bench, self.bench.shop
        for database in bench.databases:
            database._posted.clear()
            database.commit()
        bench.cable.drop()
        for controller in getattr(shop, "machines", {}).values():
            kill(controller)
        if hasattr(shop, "jobs"):
            for task in shop.jobs._background._tasks:
                task.cancel()
        bench.shop = None

    async def tell(self) -> None:
        """From the first start to the seal, through one death at most."""
        try:
            await self.once()
        except (KilledError, asyncio.CancelledError, AssertionError):
            if not self.fate.struck:  # only a dead daemon loses its database, and those who wait for it their patience
                raise
            await self.bench.cable.live_alone(AWAY_S)
            await self.once()

    async def once(self) -> None:
        """All that is asked; what has been done already is not done twice."""
        await self.bench.connected()
        shop = self.bench.shop
        await self.ready(shop)
        for _ in range(2):  # the second time it is known
            stored, _created = await shop.programs.store(_chunk(PART), "part.nc")
        job = (await shop.jobs.create(stored["id"], MACHINE, force=True, idempotency_key=KEY))["id"]
        await self.waiting_one(shop)
        await self.pause(shop, job)
        await self.finish(shop, job)
        if not await shop.tokens.list():
            await shop.tokens.create("screen", "viewer")
        shop.jobs.clock.set_back_s -= sealing.SETTLED_S + 1  # a minute later
        await sealing.seal_ended(shop.db, shop.jobs.clock)
        found = await shop.db.run(lambda db: [*history.faults(db), *seals.faults(db)])
        assert found == []
        await shop.stop()
        self.bench.shop = None

    async def ready(self, shop: Any) -> None:  # noqa: B027 - most need nothing
        """Before the first job."""

    async def waiting_one(self, shop: Any) -> None:
        """A second program whose job waits, is moved and cancelled; then the program goes."""
        stored, _ = await shop.programs.store(_chunk(OTHER), "other.nc")
        view = await shop.jobs.create(stored["id"], MACHINE, force=True, hold=True, idempotency_key="other")
        if view["status"] == "queued":
            await shop.jobs.move(view["id"], 1)
            await shop.jobs.cancel(view["id"])
        assert (await shop.jobs.get(view["id"]))["status"] == "cancelled"
        await shop.programs.delete(stored["id"])

    async def pause(self, shop: Any, job: int) -> None:
        """Once, in the middle."""
        if self.paused:
            return
        await until(lambda: self.fate.struck or len(self.way()) >= 2, within_s=60, step_s=0.01)
        self.paused = True
        if (await shop.jobs.get(job))["status"] == "running":
            await shop.jobs.pause(job)
            await self.bench.status(job, "paused")
            await shop.jobs.resume(job)

    async def finish(self, shop: Any, job: int) -> None:
        """Until it is completed, whatever has to be said for that."""
        while True:
            view = await self.bench.status(job, "completed", "paused", "queued", "interrupted")
            match view["status"]:
                case "completed":
                    return self.judge()
                case "interrupted":
                    await self.recover(shop, view)
                case _:
                    await shop.jobs.resume(job)
                    await asyncio.sleep(0.1)

    async def recover(self, shop: Any, view: dict[str, Any]) -> None:
        """Where the protocol proves what was executed nobody has to say anything."""
        raise AssertionError(f"killed at point {self.fate.at}: {view['error']}")

    def judge(self) -> None:
        assert self.way() == [float(x) for x in range(1, LINES + 1)], f"killed at point {self.fate.at}"

    @abstractmethod
    def way(self) -> list[float]:
        """Where the machine was led, in order."""


class ElvintoStory(Story):
    def way(self) -> list[float]:
        blocks = [block.replace("G1", "").replace("F240", "") for block in self.bench.executed()]
        return [float(block[1:]) for block in blocks if block.startswith("X")]


class LatheStory(Story):
    async def ready(self, shop: Any) -> None:
        lathe = shop.machines[MACHINE]
        if lathe.stream.active_job is None and not self.way():
            results = await lathe.run_blocks([HERE])
            assert results[0]["ok"], results

    def way(self) -> list[float]:
        places = [x / 1000 for x, _ in self.bench.path()]
        return places[1:] if places[:1] == [0.0] else places


class GrblStory(Story):
    """A controller that remembers nothing: the job says which lines are in doubt, and people take it up by the plan."""

    line = 1

    async def recover(self, shop: Any, view: dict[str, Any]) -> None:
        self.doubts += 1
        machine = shop.machines[MACHINE]  # it executes what it has
        await until(lambda: machine.link_status == "connected" and machine.state.status != "run", within_s=60)
        if machine.state.status == "hold":  # it died between the hold and the resume
            machine.resume()
            await until(lambda: machine.state.status == "idle", within_s=60)
        ran = len(self.way())
        executed = ran + 1 if ran else ran  # the lines: G21 G90 stands before the moves
        certain, last = view["progress"]["line"], view["error"]["line_to"]
        assert self.way() == [float(x) for x in range(1, ran + 1)]
        assert certain <= max(executed, 1), "nothing is called certain that was not executed"
        assert executed <= (certain if last is None else last), "nothing was executed that is not named"
        plan = await shop.jobs.recover(view["id"])
        assert plan["next_line"] == certain + 1
        self.line, self.stood = certain + 1, ran
        await shop.jobs.recover(view["id"], "from_line", wish=WISH)

    def judge(self) -> None:
        if not self.doubts:
            return super().judge()
        again = self.way()[self.stood :]
        wanted = [float(x) for x in range(1, LINES + 1)][max(self.line - 2, 0) :]
        assert [x for i, x in enumerate(again) if i == 0 or x != again[i - 1]][-len(wanted) :] == wanted
        return None

    def way(self) -> list[float]:
        moves = [move for line in self.bench.machine.executed for move in line.moves if move.kind == "feed"]
        return [round(move.end[0], 3) for move in moves if move.start[:2] != move.end[:2]]


async def _chunk(text: str) -> Any:
    yield text.encode()


def elvinto(folder: Path, repeat: str) -> Story:
    options = {**SHORT, "elvinto": {"max_batch_blocks": 3}}
    return ElvintoStory(Bench(folder, SimSettings(repeat=repeat), options=options), Fate())  # type: ignore[arg-type]


def grbl(folder: Path) -> Story:
    return GrblStory(GrblBench(folder, grbl={"max_batch_blocks": 3}), Fate())


def lathe(folder: Path) -> Story:
    return LatheStory(NcBench(folder, options=SHORT, ncframe={"max_batch_blocks": 3}), Fate())


STORIES: dict[str, Callable[[Path], Story]] = {
    "elvinto, silent": lambda folder: elvinto(folder, "silent"),
    "elvinto, reack": lambda folder: elvinto(folder, "reack"),
    "grbl": grbl,
    "ncframe": lathe,
}


def told(folder: Path, story: Callable[[Path], Story], ready: Path, at: int | None) -> Fate:
    """The story with a death at this point, on a copy of a database with its tables."""
    folder.mkdir()
    shutil.copyfile(ready, folder / "millstream.db")

    async def main() -> Fate:
        one = story(folder)
        one.fate.at, one.fate.every_statement = at, LONG
        broken: list[Any] = []
        asyncio.get_running_loop().set_exception_handler(
            lambda _loop, context: broken.append(context.get("exception") or context["message"])
        )
        await one.tell()
        assert [error for error in broken if not isinstance(error, KilledError)] == []
        assert one.fate.struck == (at is not None)
        return one.fate

    fate = run_simulated(main())
    shutil.rmtree(folder)
    return fate


@pytest.fixture(scope="module")
def ready(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A database with all tables, in one file."""
    path = tmp_path_factory.mktemp("ready") / "millstream.db"
    db = opened(plainly(path))
    db.execute("pragma wal_checkpoint(truncate)")
    db.close()
    return path


@pytest.mark.slow
@pytest.mark.parametrize("name", STORIES)
def test_killed_at_any_write_of_the_database_everything_goes_on(tmp_path: Path, ready: Path, name: str) -> None:
    counted = told(tmp_path / "all", STORIES[name], ready, None)
    assert counted.count > 60, counted.trace
    for at in range(1, counted.count + 1):
        told(tmp_path / str(at), STORIES[name], ready, at)


def test_killed_at_any_write_of_the_first_start_the_tables_are_made_by_the_next(tmp_path: Path) -> None:
    def tables(db: Database) -> list[Any]:
        return list(db.query("select type, name, sql from sqlite_master order by type, name"))

    def started(folder: Path, at: int | None) -> Fate:
        folder.mkdir()
        fate = Fate(at)
        try:
            opened(fate.connect(folder / "m.db")).close()
        except KilledError:
            assert fate.struck
        return fate

    points = started(tmp_path / "all", None).count
    assert points > 40
    whole = Database(sqlite3.connect(tmp_path / "all" / "m.db"))
    for at in range(1, points + 1):
        started(tmp_path / str(at), at)
        db = Database(sqlite3.connect(tmp_path / str(at) / "m.db"))
        prepare(db)
        assert tables(db) == tables(whole), f"killed at point {at}"
        assert next(iter(db.query("pragma integrity_check")))["integrity_check"] == "ok"
        db.close()
    whole.close()
