"""What streaming costs the daemon: processor time for 1,000 blocks, batches a second on a machine that takes no time.

The daemon is a process of its own; the machine is in this one, behind TCP. The journal is durable before every batch,
so where a batch takes no time the disk decides: the same is measured in memory, and how fast the disk syncs beside it.
"""

import asyncio
import os
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from bench.daemon import Daemon, Mill, daemon
from bench.programs import relief, strokes
from bench.report import Figure, Report
from sim.elvinto.settings import SimSettings

TITLE = "instant: the daemon's work for a batch, on a machine that takes no time"
SEED = 14
GOAL_BATCHES_S = 500.0
IN_MEMORY = Path("/dev/shm")
WARM_UP = 0.1
"""The part of the program that is not measured."""


@dataclass(frozen=True, slots=True)
class Work:
    """What was measured between two moments of one job."""

    batches: int
    blocks: int
    wall_s: float
    daemon_s: float
    bench_s: float


async def measured(mill: Mill, running: Daemon, *, from_block: int, within_s: float = 600.0) -> Work:
    """From that block of the job under way to its end."""
    await mill.until(blocks=from_block, within_s=within_s)
    began_at, batches, blocks = time.monotonic(), mill.batches, mill.blocks
    daemon_s, bench_s = running.cpu_s(), time.process_time()
    await mill.until(within_s=within_s)
    return Work(
        mill.batches - batches,
        mill.blocks - blocks,
        time.monotonic() - began_at,
        running.cpu_s() - daemon_s,
        time.process_time() - bench_s,
    )


@contextmanager
def _processors() -> Iterator[list[int]]:
    """Those that we may use; in the end we may use them again, whatever was set meanwhile."""
    ours = sorted(os.sched_getaffinity(0))
    try:
        yield ours
    finally:
        os.sched_setaffinity(0, ours)


async def _work(program: Iterator[str], lines: int, folder: Path, processors: list[int]) -> Work:
    mill = Mill(SimSettings(instant=True, executed_limit=1000))
    # A machine has a processor of its own. Left alone, the system puts two processes that wake each other on one.
    os.sched_setaffinity(0, processors[1:] or processors)  # the daemon inherits it
    async with mill.serve(), daemon(folder, mill) as running:
        os.sched_setaffinity(0, processors[:1])
        job = await running.run(await running.upload(program))
        work = await measured(mill, running, from_block=int(lines * WARM_UP))
        await running.settled(job, "completed")
    return work


def figures(found: Work) -> Iterator[Figure]:
    """The rows."""
    yield Figure("batches a second", found.batches / found.wall_s, goal=GOAL_BATCHES_S, sense="least", digits=0)
    yield Figure("blocks a batch", found.blocks / found.batches, digits=1)
    yield Figure("processor time for 1,000 blocks", 1e6 * found.daemon_s / found.blocks, "ms", digits=1)
    yield Figure("processor time for a batch", 1e3 * found.daemon_s / found.batches, "ms")
    yield Figure("the daemon was busy", 100 * found.daemon_s / found.wall_s, "%", digits=0)
    yield Figure("the virtual machine was busy", 100 * found.bench_s / found.wall_s, "%", digits=0)


def work(program: Iterator[str], lines: int, *, base: Path | None = None) -> Work:
    """One job of one daemon, with its data below `base`."""
    with tempfile.TemporaryDirectory(prefix="millstream-bench-", dir=base) as folder, _processors() as processors:
        return asyncio.run(_work(program, lines, Path(folder), processors))


def syncs_a_second(count: int = 200) -> float:
    """What the disk of the temporary folder can do: a page written and synced, as SQLite does it at a commit."""
    with tempfile.TemporaryFile() as file:
        began_at = time.monotonic()
        for _ in range(count):
            os.pwrite(file.fileno(), bytes(4096), 0)
            os.fdatasync(file.fileno())
        return count / (time.monotonic() - began_at)


def _in_memory(lines: int) -> Iterator[tuple[str, Iterator[Figure]]]:
    if IN_MEMORY.is_dir():
        found = work(strokes(SEED, lines), lines, base=IN_MEMORY)
        yield f"strokes, {lines:,} lines, data in memory", figures(found)


def run(*, relief_lines: int = 30_000, strokes_lines: int = 3000) -> Report:
    """Batches as full as they get, and batches of one block: planning and all that is not planning."""
    disk = Figure("syncs of this disk a second", syncs_a_second(), digits=0)
    groups = [
        (f"strokes, {strokes_lines:,} lines", [*figures(work(strokes(SEED, strokes_lines), strokes_lines)), disk]),
        *_in_memory(strokes_lines),
        (f"relief, {relief_lines:,} lines", figures(work(relief(SEED, relief_lines), relief_lines))),
    ]
    return Report.of(TITLE, groups)
