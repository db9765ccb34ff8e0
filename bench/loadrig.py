"""A workshop under way: a daemon, an ElVinto and a Grbl at work, crowds that come and go, and what is seen meanwhile.

The daemon, the Grbl, the readers, the other clients and the stand-in for the daemon are processes of their own; the
ElVinto lives here. Both jobs go on through all phases. The one rule: a phase counts what lies wholly inside of it.
"""

import asyncio
import itertools
import json
import tempfile
from collections import Counter
from collections.abc import AsyncIterator, Iterator, Sequence
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from bench import grbl
from bench.daemon import OURS, Daemon, Mill, serving
from bench.grblrig import Peer, answer, peer, process
from bench.loadclients import Crowd, Load
from bench.phases import NOTHING, Sums
from bench.programs import relief
from bench.tap import DeadTime, dead_time
from sim.elvinto.settings import SimSettings

SEED = 31
BAUD = 115200
ELVINTO = "router"
ACCELERATION = 100_000.0
"""mm/s². The virtual mill stops after every block; so a line takes as long as on a controller that looks ahead."""
RELIEF_FEED_MM_MIN = 4800
"""A line of the ElVinto's is some 5 ms, a batch of 32 with its dead time some 0.2 s."""
RELIEF_LINES_S = 200
"""More than it does."""
STEPS_MM = (0.1,) * 20 + (0.2,) * 10 + (0.4,) * 5
"""A row of the Grbl: lines of 5, 10 and 20 ms, and one that goes to the next row."""
FEED_MM_MIN = 1200
ROWS = 100
ROW_S = 0.3
SETTLE_S = 1.0
"""Behind each coming and going, before something is counted."""
AT_WORK_BLOCKS = 50
POLL_S = 0.05
AT_LEAST_WITHIN_S = 60.0
"""Two batches and a row take so long on no computer on which it is worth to look on."""


def rows(count: int) -> Iterator[str]:
    """Back and forth, every row in the same time, every word in every line."""
    yield "G21 G90"
    x_mm, y_mm = 10.0, 10.0
    for row in range(count):
        sign = -1 if row % 2 else 1
        y_mm += 0.345 if row % (2 * ROWS) < ROWS else -0.345
        yield f"G1 X{x_mm:.3f} Y{y_mm:.3f} Z-1.500 F{FEED_MM_MIN}"
        for number, step_mm in enumerate(STEPS_MM):
            x_mm += sign * step_mm
            yield f"G1 X{x_mm:.3f} Y{y_mm:.3f} Z-{1.5 + 0.002 * (number % 3):.3f} F{FEED_MM_MIN}"


ROW_MOVES = len(STEPS_MM) + 1


@dataclass(slots=True)
class Phase:
    """What was seen in some seconds. `elvinto` is None where not even two batches were."""

    seconds: float
    elvinto: DeadTime | None
    rows_s: list[float]
    starved_s: float
    cpu_s: float
    """Of the daemon, all of its threads."""
    load: Load | None = None

    @property
    def dead(self) -> Sums:
        """Seconds between batches, and how many times."""
        return NOTHING if self.elvinto is None else Sums(self.elvinto.dead_s, self.elvinto.batches - 1)

    @property
    def row(self) -> Sums:
        """Seconds of rows."""
        return Sums(sum(self.rows_s), len(self.rows_s))


@dataclass(slots=True)
class _Rows:
    """Moves as they end, to rows: when the last move of each row ended, and where the planner had run dry."""

    moves: int = 0
    ended: list[float] = field(default_factory=list)
    dry: list[tuple[float, float]] = field(default_factory=list)
    """(when the next move began, seconds without one)."""
    _last_s: float | None = None

    def take(self, moves: Sequence[tuple[float | None, float | None]]) -> None:
        for began_s, ended_s in moves:
            assert began_s is not None
            assert ended_s is not None
            if self._last_s is not None and began_s > self._last_s + 1e-6:
                self.dry.append((began_s, began_s - self._last_s))
            self._last_s = ended_s
            self.moves += 1
            if self.moves % ROW_MOVES == 0:
                self.ended.append(ended_s)

    def between(self, begin_s: float, end_s: float) -> list[float]:
        """Seconds of each row that lies wholly in there."""
        inside = [at for at in self.ended if begin_s <= at <= end_s]
        return [after - before for before, after in itertools.pairwise(inside)]

    def dry_s(self, begin_s: float, end_s: float) -> float:
        return sum(seconds for at, seconds in self.dry if begin_s <= at <= end_s)


class Workshop:
    """See the head of this file. Made by `workshop`."""

    def __init__(self, daemon: Daemon, mill: Mill, controller: Peer, crowds: "Crowds", stack: AsyncExitStack) -> None:
        self.daemon = daemon
        self.crowds = crowds
        self._stack = stack
        self._mill = mill
        self._controller = controller
        self._rows = _Rows()
        self._holds_at: list[float] = []

    async def measured(self, seconds: float) -> Phase:
        """Look on for so long, and until there is something to count."""
        loop = asyncio.get_running_loop()
        first = len(self._mill.machine.executed)
        begin_s, cpu_s = loop.time(), self.daemon.cpu_s()
        await asyncio.sleep(seconds)
        async with asyncio.timeout(AT_LEAST_WITHIN_S):
            while (phase := await self._seen(first, begin_s)).elvinto is None or not phase.rows_s:
                await asyncio.sleep(POLL_S)
        phase.cpu_s = self.daemon.cpu_s() - cpu_s
        return phase

    async def _seen(self, first: int, begin_s: float) -> Phase:
        end_s = asyncio.get_running_loop().time()
        await self._look()
        rows_s, dry_s = self._rows.between(begin_s, end_s), self._rows.dry_s(begin_s, end_s)
        return Phase(end_s - begin_s, self._batches(first), rows_s, dry_s, 0.0)

    async def stand_in(self, answer_bytes: int, piece_bytes: int, pieces_s: float) -> int:
        """The port of a new stand-in for the daemon, which is there to the end."""
        arguments = (str(answer_bytes), str(piece_bytes), f"{pieces_s:.3f}")
        return int((await answer(await self._stack.enter_async_context(process("bench.standin", *arguments))))["port"])

    async def holds_at(self) -> list[float]:
        """When feed holds came out of the Grbl's wire, since this was last asked."""
        await self._look()
        holds, self._holds_at = self._holds_at, []
        return holds

    async def _look(self) -> None:
        news = await self._controller.news()
        self._rows.take(news["moves"])
        self._holds_at += news["holds_at"]

    def _batches(self, first: int) -> DeadTime | None:
        """The first may have begun earlier, the last is under way: neither counts."""
        blocks = [block for block in self._mill.machine.executed[first:] if block.text not in OURS]
        ids = list(Counter(block.id for block in blocks))[1:-1]
        if len(ids) < 2:
            return None
        whole = set(ids)
        return dead_time(self._mill.tap, [block for block in blocks if block.id in whole], BAUD)


# --- crowds -----------------------------------------------------------------------------------------------------------


class Crowds:
    """Two processes: those who read, and those who ask and upload."""

    def __init__(self, readers: asyncio.subprocess.Process, clients: asyncio.subprocess.Process) -> None:
        self._processes = (readers, clients)
        self._there: list[asyncio.subprocess.Process] = []

    async def come(self, crowd: Crowd) -> None:
        """They are there when this returns, but for SETTLE_S."""
        parts = (replace(crowd, requests_s=0.0, upload_bytes=0), replace(crowd, readers=0))
        for one, part in zip(self._processes, parts, strict=True):
            if part.readers or part.requests_s or part.upload_bytes:
                await _say(one, json.dumps(asdict(part)))
                await answer(one)
                self._there.append(one)
        await asyncio.sleep(SETTLE_S)

    async def go(self) -> Load:
        """What they got."""
        total = Load()
        for one in self._there:
            await _say(one, "")
        for one in self._there:
            got = Load(**await answer(one))
            total, seconds = total + got, max(total.seconds, got.seconds)
            total.seconds = seconds
        self._there.clear()
        await asyncio.sleep(SETTLE_S)
        return total


async def _say(one: asyncio.subprocess.Process, line: str) -> None:
    assert one.stdin is not None
    one.stdin.write(f"{line}\n".encode())
    await one.stdin.drain()


@asynccontextmanager
async def workshop(seconds: float) -> AsyncIterator[Workshop]:
    """Both machines at work, for that many seconds at least."""
    mill = Mill(SimSettings(acceleration=ACCELERATION))
    async with AsyncExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="millstream-bench-")))
        await stack.enter_async_context(mill.serve(baud=BAUD, tapped=True))
        controller = await stack.enter_async_context(peer(BAUD, grbl.ACCELERATION))
        machines = f'{grbl.machine(controller.url, compact=True)}[[machine]]\nname = "{ELVINTO}"\nport = "{mill.url}"\n'
        daemon = await stack.enter_async_context(serving(folder, f"{machines}baud = {BAUD}\n"))
        await daemon.connected(ELVINTO)
        processes: list[Any] = [await stack.enter_async_context(process("bench.loadclients")) for _ in range(2)]
        relief_lines = relief(SEED, int(seconds * RELIEF_LINES_S) + 500, feed_mm_min=RELIEF_FEED_MM_MIN)
        jobs = [
            await daemon.run(await daemon.upload(relief_lines), machine=ELVINTO),
            await daemon.run(await daemon.upload(rows(int(seconds / ROW_S) + 100))),
        ]
        await mill.until(blocks=AT_WORK_BLOCKS, within_s=60.0)
        await controller.until(AT_WORK_BLOCKS, within_s=60.0)
        yield Workshop(daemon, mill, controller, Crowds(*processes), stack)
        for job in jobs:
            await daemon.cancel(job)
            await daemon.settled(job, "cancelled")
