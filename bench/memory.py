"""Resident memory of the daemon with a long program: idle, after the upload, after the check, while it runs.

The one rule: what is to be flat is looked at over tens of thousands of batches; a buffer that grows shows in the last
figure, not in the first.
"""

import asyncio
import tempfile
from collections.abc import Iterator
from pathlib import Path

from bench.daemon import Mill, daemon
from bench.programs import relief
from bench.report import Figure, Report
from sim.elvinto.settings import SimSettings

TITLE = "memory: resident size of the daemon with a long program"
SEED = 15
GOAL_MB = 120.0
BATCH_BLOCKS = 2
"""Small batches: what could grow grows by the batch, not by the block."""
POINTS = 6
SETTLED_AFTER = 4
"""Flatness is from this point on: until then caches fill (SQLite's pages, the last messages of the console)."""
QUICK_FOLDER = Path("/dev/shm")
"""Memory does not depend on the disk; without waiting for one there are more batches in a minute."""


async def _sizes(lines: int, batches: int, folder: Path) -> tuple[Figure, ...]:
    mill = Mill(SimSettings(instant=True, executed_limit=1000))
    async with mill.serve(), daemon(folder, mill, max_batch_blocks=BATCH_BLOCKS) as running:
        idle = running.resident_mb()
        program = await running.upload(relief(SEED, lines))
        uploaded = running.resident_mb()
        job = await running.run(program)
        checked = running.resident_mb()
        during: list[tuple[int, float]] = []
        for point in range(1, POINTS + 1):
            await mill.until(blocks=BATCH_BLOCKS * batches * point // POINTS)
            during.append((mill.batches, running.resident_mb()))
        await running.cancel(job)
        await running.settled(job, "cancelled")
        peak = running.resident_mb(peak=True)
    return tuple(_figures(idle, uploaded, checked, during, peak))


def _figures(
    idle: float, uploaded: float, checked: float, during: list[tuple[int, float]], peak: float
) -> Iterator[Figure]:
    yield Figure("idle", idle, "MiB", digits=1)
    yield Figure("after the upload", uploaded, "MiB", digits=1)
    yield Figure("after the check, running", checked, "MiB", digits=1)
    for batches, size in during:
        yield Figure(f"running, {batches:,} batches done", size, "MiB", digits=1)
    yield Figure("highest of all", peak, "MiB", goal=GOAL_MB, digits=1)
    (first, small), (last, large) = during[SETTLED_AFTER - 1], during[-1]
    yield Figure("growth for 10,000 batches", 1e4 * (large - small) / max(last - first, 1), "MiB")


def run(*, lines: int = 1_000_000, batches: int = 15_000) -> Report:
    """Upload `lines`, run so many batches of them, cancel."""
    base = QUICK_FOLDER if QUICK_FOLDER.is_dir() else None
    with tempfile.TemporaryDirectory(prefix="millstream-bench-", dir=base) as folder:
        found = asyncio.run(_sizes(lines, batches, Path(folder)))
    return Report.of(TITLE, [(f"relief of {lines:,} lines", found)])
