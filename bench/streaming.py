"""Dead time on a 115200 line: how long the machine stands still between batches, against the bound of the protocol.

In simulated time the whole chain runs but for HTTP, and computing costs nothing: what is left over is our protocol's
doing. In real time the daemon is a process behind a paced TCP port: what is added is computing, disk and kernel.
"""

import asyncio
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

from bench.daemon import Mill, daemon
from bench.programs import as_bytes, part, relief
from bench.report import Figure, Report
from bench.tap import DeadTime, Tap, dead_time
from sim.elvinto.settings import SimSettings
from sim.shell import MemoryLink, open_memory
from tests.harness.simloop import run_simulated, until
from tests.harness.workshop import Bench, Cable

TITLE = "streaming: dead time on a 115200 line"
BAUD = 115200
GOAL = 1.03
SEED = 11
ACCELERATION = 10_000.0
"""mm/s². The virtual mill stops after every block; so it loses as little by that as a controller that looks ahead."""
COMMIT_S = 0.01
"""What making a journal row durable takes in simulated time: a slow disk."""
LONGEST_S = 100_000.0


class _PacedCable(Cable):
    """A cable with the speed of a serial line, and somebody who listens at the daemon's end."""

    def __init__(self, cable: Cable, tap: Tap) -> None:
        super().__init__(cable.machine)
        self._tap = tap

    async def __call__(
        self,
        url: str,  # noqa: ARG002 - there is only this cable
        baud: int,
        on_data: Callable[[bytes], None],
        on_lost: Callable[[str], None],  # noqa: ARG002 - it is never pulled
    ) -> MemoryLink:
        loop = asyncio.get_running_loop()
        tap = self._tap

        def heard(data: bytes) -> None:
            tap.up(data, loop.time())
            on_data(data)

        link = await open_memory(self.machine, heard, baud=baud)
        write = link.write

        def written(data: bytes) -> None:
            tap.down(data, loop.time())
            write(data)

        setattr(link, "write", written)  # noqa: B010 - a method of this one object
        return link


def simulated(program: bytes) -> DeadTime:
    """Stream a program in simulated time. Raises AssertionError when the job is not completed."""
    with tempfile.TemporaryDirectory(prefix="millstream-bench-") as folder:
        return run_simulated(_simulated(program, Path(folder)), limit_s=LONGEST_S)


async def _simulated(program: bytes, folder: Path) -> DeadTime:
    world = Bench(folder, SimSettings(acceleration=ACCELERATION), options={"baud": BAUD}, latency_s=COMMIT_S)
    tap = Tap()
    world.cable = _PacedCable(world.cable, tap)
    shop = await world.connected()
    job = await world.job(program.decode())
    # Nobody asks for the job meanwhile: in simulated time a question makes the journal durable early.
    await until(lambda: any(block.text == "M30" for block in world.machine.executed[-4:]), within_s=LONGEST_S)
    await world.status(job["id"], "completed")
    await shop.stop()
    return dead_time(tap, [block for block in world.machine.executed if block.text not in ("W90", "W95")], BAUD)


def real(program: Iterator[str]) -> DeadTime:
    """Stream a program in real time, with the daemon as a process."""
    with tempfile.TemporaryDirectory(prefix="millstream-bench-") as folder:
        return asyncio.run(_real(program, Path(folder)))


async def _real(program: Iterator[str], folder: Path) -> DeadTime:
    mill = Mill(SimSettings(acceleration=ACCELERATION))
    async with mill.serve(baud=BAUD, tapped=True), daemon(folder, mill, baud=BAUD) as running:
        job = await running.run(await running.upload(program))
        await mill.until()
        await running.settled(job, "completed")
    return dead_time(mill.tap, mill.executed(), BAUD)


def figures(found: DeadTime, *, goal: float | None) -> Iterator[Figure]:
    """The rows of one run."""
    yield Figure("batches", found.batches, digits=0)
    yield Figure("blocks a batch", found.blocks / found.batches, digits=1)
    yield Figure("executing, of the whole time", 100 * found.executing_s / found.total_s, "%")
    yield Figure("dead", 100 * found.dead, "%")
    yield Figure("bound: header + data + RECEIVED + OK", 100 * found.bound, "%")
    yield Figure("dead / bound", found.ratio, "x", goal=goal, digits=3)
    yield Figure("dead time / wire time without RECEIVED", found.dead_s / found.unhidden_s, "x", digits=3)
    gap_ms = 1000 / max(found.batches - 1, 1)
    for name, seconds in (
        ("dead time of a batch", found.dead_s),
        ("  OK, header and data on the wire", found.unhidden_s),
        ("  OK late: behind a STATE, or the machine's timer", found.answer_wait_s),
        ("  the daemon between OK and the next command", found.turnaround_s),
        ("  the command slower than its bytes", found.command_wait_s),
    ):
        yield Figure(name, seconds * gap_ms, "ms", digits=3)
    yield Figure("the daemon between OK and command, median", 1000 * found.median_turnaround_s, "ms", digits=3)


def run(*, relief_lines: int = 2500, real_lines: int = 1000, features: int = 12) -> Report:
    """All of it; `real_lines` 0 leaves real time out."""
    groups = [
        ("fine relief, simulated time", figures(simulated(as_bytes(relief(SEED, relief_lines))), goal=GOAL)),
        ("ordinary part, simulated time", figures(simulated(as_bytes(part(SEED, features))), goal=GOAL)),
    ]
    if real_lines:
        groups.append(
            ("fine relief, real time, daemon as a process", figures(real(relief(SEED, real_lines)), goal=GOAL))
        )
    return Report.of(TITLE, groups)
