"""The machines of the soak: what each is asked to run, where it was led, and what people do when a job broke off.

Not the days (soakyear.py) and not the other clients (soakpeople.py). The one rule: what was executed is read from the
machine alone, and held against what the job says of it: all of it once, or the lines in doubt by their numbers.
"""

import asyncio
from abc import ABC, abstractmethod
from collections.abc import Callable
from pathlib import Path
from typing import Any

from bench.soakpeople import People
from server.config.reentry import ReentryWish
from sim.changer.changer import VirtualChanger
from sim.changer.settings import ChangerSettings
from sim.elvinto.settings import SimSettings as ElvintoSettings
from sim.grbl.simsettings import SimSettings as GrblSettings
from sim.ncframe.settings import SimSettings as LatheSettings
from tests.harness.asgisocket import AsgiSocket
from tests.harness.changerbench import Wired
from tests.harness.grblworkshop import GrblBench
from tests.harness.ncworkshop import HERE, NcBench
from tests.harness.simloop import until
from tests.harness.workshop import MACHINE, Bench

LINES = 24
FIRST_LINE = 2
"""Of the moves: G21 G90 stands before them."""
KEPT = 40 * LINES
"""The virtual machine remembers some jobs, and not a year."""
SHORT = {"resume_within": 60.0}
WISH = ReentryWish(clearance=5.0, plunge_feed=500.0, spindle_wait=0.0, force=True)
SETTLED_S = 60.0
WORKSHOP = f"/api/v1/machines/{MACHINE}"


class Mill(ABC):
    """One machine, which outlives all its daemons. `began`: how many moves it had made before the job under way."""

    bench: Any
    feed = 6000
    macros = True
    """Whether it is given programs with O-words, too."""

    def __init__(self) -> None:
        self.given_up = 0
        self.taken_up = 0

    def program(self, far: int) -> str:
        """A job and where it leads: X `far` and on, a millimetre a line."""
        return "".join(["G21 G90\n", *(f"G1 X{x} F{self.feed}\n" for x in self.wanted(far)), "M30\n"])

    def wanted(self, far: int) -> list[float]:
        """Where `program(far)` leads, in mm."""
        return [float(far + number) for number in range(LINES)]

    @abstractmethod
    def way(self) -> list[float]:
        """Where the machine was led since `forget`, in mm."""

    def forget(self) -> None:
        """Before a job: what was executed so far is no matter of it, nor what the virtual machine has noted."""
        self.bench.machine.executed.clear()
        while self.bench.machine.next_event() is not None:
            pass

    async def served(self, people: People) -> None:  # noqa: B027 - most need nothing
        """A daemon has come up, perhaps with a job under way."""

    async def ready(self, people: People) -> None:  # noqa: B027
        """What it needs before a job."""

    async def left(self) -> None:  # noqa: B027
        """A daemon is about to go."""

    async def estop(self, people: People) -> None:
        """An emergency stop by somebody, and everything that follows until the machine can run again."""
        await people.asks("POST", f"{WORKSHOP}/estop", 202)
        await asyncio.sleep(2.0)
        await people.asks("POST", f"{WORKSHOP}/reset", 202)
        await until(lambda: self._status() == "idle", within_s=SETTLED_S)

    async def settle(self, people: People, job: int, far: int) -> None:
        """Until the job has ended, whatever people have to say for that. Raises AssertionError when a line was lost."""
        view = await self.bench.status(job, "completed", "interrupted", "failed")
        if view["status"] == "completed":
            assert self.way() == self.wanted(far), f"job {job}: {self.way()} and not {self.wanted(far)}"
            return
        await self._broken_off(people, view, far)

    async def _broken_off(self, people: People, view: dict[str, Any], far: int) -> None:
        """A job whose lines are in doubt: they are named, and people give it up."""
        self._doubts_are_named(view, far)
        if view["status"] == "interrupted":
            await people.asks("POST", f"/api/v1/jobs/{view['id']}/cancel", 200, 202)
            await self.bench.status(view["id"], "cancelled")
        self.given_up += 1

    def _doubts_are_named(self, view: dict[str, Any], far: int) -> int:
        """How many moves it made."""
        way, error = self.way(), view["error"]
        assert way == self.wanted(far)[: len(way)], view
        executed = len(way) + FIRST_LINE - 1 if way else 0
        assert view["progress"]["line"] <= max(executed, FIRST_LINE - 1), f"called certain and not executed: {view}"
        assert error["line_to"] is None or executed <= error["line_to"], f"executed and not named: {view}"
        return len(way)

    def _status(self) -> str:
        return str(self.bench.shop.machines[MACHINE].state.status)


class Elvinto(Mill):
    """It remembers what it was sent: no job ends in doubt."""

    def __init__(self, folder: Path, **options: Any) -> None:
        super().__init__()
        settings = ElvintoSettings(executed_limit=KEPT)
        self.bench = Bench(folder, settings, options={**SHORT, "elvinto": {"max_batch_blocks": 8}, **options})

    def way(self) -> list[float]:
        blocks = [block.removeprefix("G1").removesuffix(f"F{self.feed}") for block in self.bench.executed()]
        return [float(block[1:]) for block in blocks if block.startswith("X")]

    async def _broken_off(self, people: People, view: dict[str, Any], far: int) -> None:  # noqa: ARG002
        raise AssertionError(f"an ElVinto proves what it has executed: {view}")


class Grbl(Mill):
    """It forgets everything at a break: people take the job up where the plan says."""

    def __init__(self, folder: Path) -> None:
        super().__init__()
        self.bench = GrblBench(folder, GrblSettings(executed_limit=KEPT), grbl={"max_batch_blocks": 8})
        self._rate = 0

    def way(self) -> list[float]:
        moves = [move for line in self.bench.machine.executed for move in line.moves if move.kind == "feed"]
        return [round(move.end[0], 3) for move in moves if move.start[:2] != move.end[:2]]

    async def ready(self, people: People) -> None:
        for _ in range(2):  # each is a backup: the table of them is full in the second month
            self._rate += 1
            value = str(5000 + self._rate % 700)
            await people.asks("PATCH", f"{WORKSHOP}/settings", 200, json={"values": {"110": value}})

    async def _broken_off(self, people: People, view: dict[str, Any], far: int) -> None:  # noqa: ARG002
        await until(
            lambda: self._link() == "connected" and self._status() not in ("run", "unknown"), within_s=SETTLED_S
        )
        stood = self._doubts_are_named(view, far)
        shop = self.bench.shop
        plan = await shop.jobs.recover(view["id"])
        assert plan["next_line"] == view["progress"]["line"] + 1, plan
        await shop.jobs.recover(view["id"], "from_line", wish=WISH)
        again = await self.bench.status(view["id"], "completed", "interrupted", "failed")
        assert again["status"] == "completed", again
        wanted = self.wanted(far)[max(plan["next_line"] - FIRST_LINE, 0) :]
        led = self.way()[stood:]
        assert [x for at, x in enumerate(led) if at == 0 or x != led[at - 1]][-len(wanted) :] == wanted, view
        self.taken_up += 1

    def _link(self) -> str:
        return str(self.bench.shop.machines[MACHINE].link_status)


class Lathe(Mill):
    """Behind NC frames; people say where it stands whenever that is not known."""

    feed = 240
    macros = False

    def __init__(self, folder: Path) -> None:
        super().__init__()
        settings = LatheSettings(start_count=100, executed_limit=KEPT)
        self.bench = NcBench(folder, settings, options=SHORT, ncframe={"max_batch_blocks": 8})
        self._zero = 0
        """Where people said X0 last, in counts of the machine."""

    def way(self) -> list[float]:
        return [(x - self._zero) / 1000 for x, _ in self.bench.path()]

    def forget(self) -> None:
        self.bench.machine.executed.clear()
        self.bench.machine.events.clear()

    def wanted(self, far: int) -> list[float]:
        return super().wanted(far % 40 + 1)  # it stands at 0: the first move leads away from there

    async def ready(self, people: People) -> None:
        await people.asks("POST", f"{WORKSHOP}/commands", 200, json={"blocks": [HERE]})
        if self.bench.machine.executed:
            self._zero = self.bench.machine.executed[-1].x

    async def estop(self, people: People) -> None:
        await super().estop(people)
        await self.ready(people)


class Changer(Elvinto):
    """A router whose tools are changed by a device on a WebSocket of its own."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder, toolchanger={"kind": "external"})
        self._virtual = VirtualChanger(ChangerSettings())
        self._socket: AsgiSocket | None = None
        self._wired: Wired | None = None
        self._tool = 0

    def program(self, far: int) -> str:
        self._tool = self._tool % 12 + 1
        lines = super().program(far).splitlines(keepends=True)
        return "".join([*lines[: LINES // 2], f"T{self._tool}M6\n", *lines[LINES // 2 :]])

    async def ready(self, people: People) -> None:  # noqa: ARG002
        assert self._wired is not None
        self._wired.seen.clear()
        self._virtual.log.clear()

    async def served(self, people: People) -> None:
        self._socket = AsgiSocket(people.app, query={"topics": "io", "machines": MACHINE}, headers=people.admin)
        await self._socket.__aenter__()
        self._wired = Wired(self._virtual, self._socket)
        machine = self.bench.shop.machines[MACHINE]
        await until(lambda: machine.tools.io.connected, within_s=SETTLED_S)
        # Also with a job under way: it waits for the changer, whose e-stop holds since the daemon began.
        await people.asks("POST", f"{WORKSHOP}/reset", 202)
        await until(lambda: machine.tools.io.start_refusal is None, within_s=SETTLED_S)
        # It went while the daemon before still lived: that fault is latched until somebody has looked.
        if machine.tools.io.may_clear_fault:
            await people.asks("POST", f"{WORKSHOP}/tool/clear-fault", 200, 202, 204)

    async def left(self) -> None:
        if self._wired is not None and self._socket is not None:
            self._wired.close()
            await self._socket.disconnect()
        self._wired = self._socket = None

    async def _broken_off(self, people: People, view: dict[str, Any], far: int) -> None:
        """The daemon died between a request and its answer: which tool is in the spindle nobody knows."""
        await Mill._broken_off(self, people, view, far)


MILLS: dict[str, Callable[[Path], Mill]] = {
    "elvinto": Elvinto,
    "grbl": Grbl,
    "ncframe": Lathe,
    "changer": Changer,
}
