"""Many at once beside a job: dashboards alone, then readers, requests and a large upload, and a pause among them.

The same job runs quiet, with dashboards and with everything, on an ElVinto and on a Grbl; what is printed are ratios of
these runs. The daemon, the Grbl and the crowd are processes of their own. The one rule: whoever asks, reads and uploads
has the lowest priority, for it stands for other computers.
"""

import asyncio
import json
import tempfile
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from random import Random
from statistics import quantiles
from typing import TypeVar

from bench import grbl
from bench.daemon import Daemon, Mill, daemon, serving
from bench.grblpeer import Seen
from bench.grblrig import peer, process
from bench.loadclients import Load, loaded
from bench.programs import relief
from bench.report import Figure, Report
from bench.tap import DeadTime, dead_time
from sim.elvinto.settings import SimSettings

TITLE = "load: many readers, requests and an upload beside a job"
GOAL_RATIO = 1.05
GOAL_PAUSE_MS = 20.0
GOAL_UPLOAD_GB = 1.0
SEED = 31
BAUD = 115200
ACCELERATION = 10_000.0
DASHBOARDS = 60
READERS = 100
RATE_HZ = 20.0
REQUESTS_S = 50.0
UPLOAD_BYTES = 1_000_000_000
Found = TypeVar("Found")
EVERYTHING = f"{grbl.DASHBOARD},console"


@dataclass(frozen=True, slots=True)
class Crowd:
    """Who is there beside the job."""

    readers: int = 0
    topics: str = grbl.DASHBOARD
    requests_s: float = 0.0
    upload_bytes: int = 0


@dataclass(slots=True)
class Came:
    """What the crowd got."""

    messages_s: float = 0.0
    """Of one reader."""
    load: Load | None = None


QUIET = Crowd()


@asynccontextmanager
async def crowd(running: Daemon, who: Crowd) -> AsyncIterator[Came]:
    """They are there until the end of the block; then `Came` says what they got."""
    host, port = running.address
    came = Came()
    async with AsyncExitStack() as stack:
        readers = clients = None
        if who.readers:
            url = f"ws://{host}:{port}/api/v1"
            arguments = (url, str(who.readers), who.topics, str(RATE_HZ))
            readers = await stack.enter_async_context(process("bench.grblreaders", *arguments))
            await _line(readers)
        if who.requests_s:
            arguments = (host, str(port), str(who.requests_s), str(who.upload_bytes))
            clients = await stack.enter_async_context(process("bench.loadclients", *arguments))
            await _line(clients)
        yield came
        if readers is not None:
            messages, seconds = map(float, (await _last(readers)).split())
            came.messages_s = messages / seconds / who.readers
        if clients is not None:
            came.load = loaded(json.loads(await _last(clients)))


async def _line(one: asyncio.subprocess.Process) -> str:
    assert one.stdout is not None
    return (await one.stdout.readline()).decode()


async def _last(one: asyncio.subprocess.Process) -> str:
    """Its standard input ends, and it says what there was."""
    assert one.stdin is not None
    one.stdin.close()
    return await _line(one)


# --- the same job beside a crowd --------------------------------------------------------------------------------------


async def on_elvinto(lines: int, who: Crowd) -> tuple[DeadTime, Came]:
    """A relief on a line of 115200 baud."""
    mill = Mill(SimSettings(acceleration=ACCELERATION))
    with tempfile.TemporaryDirectory(prefix="millstream-bench-") as folder:
        async with mill.serve(baud=BAUD, tapped=True), daemon(Path(folder), mill, baud=BAUD) as running:
            program = await running.upload(relief(SEED, lines))
            async with crowd(running, who) as came:
                job = await running.run(program)
                await mill.until(within_s=1200.0)
            await running.settled(job, "completed", within_s=60.0)
    return dead_time(mill.tap, mill.executed(), BAUD), came


async def on_grbl(lines: int, who: Crowd) -> tuple[Seen, Came]:
    """Lines of 5 ms: whoever is late by a planner's length has a machine that stands still."""
    program = [*grbl.carved(SEED, lines, step_mm=grbl.STEP_MM)]
    with tempfile.TemporaryDirectory(prefix="millstream-bench-") as folder:
        async with (
            peer(BAUD, grbl.ACCELERATION) as mill,
            serving(Path(folder), grbl.machine(mill.url, compact=True)) as running,
        ):
            stored = await running.upload(iter(program))
            async with crowd(running, who) as came:
                job = await running.run(stored)
                await mill.until(lines, within_s=1200.0)
            await running.settled(job, "completed", within_s=60.0)
            return await mill.seen(), came


async def paused(presses: int, who: Crowd) -> tuple[list[float], Came]:
    """Seconds from the first byte of `POST /pause` to the `!` at the controller's end of the wire, sorted."""
    random = Random(SEED)
    program = [*grbl.carved(SEED, 20_000 + 500 * presses, step_mm=grbl.STEP_MM)]
    with tempfile.TemporaryDirectory(prefix="millstream-bench-") as folder:
        async with (
            peer(BAUD, grbl.ACCELERATION) as mill,
            serving(Path(folder), grbl.machine(mill.url, compact=True)) as running,
        ):
            job = await running.run(await running.upload(iter(program)))
            await mill.until(50)
            async with crowd(running, who) as came:
                pressed = [await grbl.pressed(running, random) for _ in range(presses)]
            await running.cancel(job)
            await running.settled(job, "cancelled")
            held = (await mill.seen()).holds_at
    return sorted(grbl.first_after(held, at) - at for at in pressed), came


# --- the report -------------------------------------------------------------------------------------------------------


def _elvinto(found: DeadTime, quiet: DeadTime, came: Came, who: Crowd) -> Iterator[Figure]:
    gap_ms = 1000 / max(found.batches - 1, 1)
    yield Figure("dead time / the quiet run's", found.dead_s / quiet.dead_s, "x", goal=GOAL_RATIO, digits=3)
    yield Figure("dead time of a batch", found.dead_s * gap_ms, "ms", digits=3)
    yield Figure("  the daemon between OK and the next command", found.turnaround_s * gap_ms, "ms", digits=3)
    yield Figure("  the same in the quiet run", quiet.turnaround_s * gap_ms, "ms", digits=3)
    yield Figure("  OK late: behind a STATE, or the machine's timer", found.answer_wait_s * gap_ms, "ms", digits=3)
    yield from _came(came, who)


def _grbl(found: Seen, quiet: Seen, came: Came, who: Crowd) -> Iterator[Figure]:
    ratio = found.motion_s / quiet.motion_s if quiet.motion_s else 0.0
    yield Figure("from the first move to the last / the quiet run's", ratio, "x", goal=GOAL_RATIO, digits=3)
    yield Figure("planner run dry", found.starved_s, "s", digits=3)
    yield Figure("planner run dry in the quiet run", quiet.starved_s, "s", digits=3)
    yield from _came(came, who)


def _came(came: Came, who: Crowd) -> Iterator[Figure]:
    if who.readers:
        yield Figure("messages a second to each reader", came.messages_s, digits=1)
    if (load := came.load) is not None:
        yield Figure("requests a second", load.requests / load.seconds, goal=0.98 * REQUESTS_S, sense="least", digits=1)
        yield Figure("requests refused" + "".join(f", {one}" for one in load.refusals), load.refused, goal=0, digits=0)
        yield Figure("answered, p99", 1e3 * load.p99_s, "ms", digits=1)
        if who.upload_bytes:
            yield Figure("uploaded meanwhile", load.uploaded_bytes / 1e9, "GB", goal=GOAL_UPLOAD_GB, sense="least")


def _late(found: list[float], came: Came, who: Crowd, *, goal: float) -> Iterator[Figure]:
    cuts = quantiles(found, n=100, method="inclusive")
    yield Figure("presses", len(found), digits=0)
    yield Figure("median", 1e3 * cuts[49], "ms")
    yield Figure("p99", 1e3 * cuts[98], "ms", goal=goal)
    yield Figure("longest", 1e3 * found[-1], "ms")
    yield from _came(came, who)


def _beside(
    name: str,
    crowds: dict[str, Crowd],
    run_job: Callable[[Crowd], Awaitable[tuple[Found, Came]]],
    figures: Callable[[Found, Found, Came, Crowd], Iterator[Figure]],
) -> Iterator[tuple[str, Iterator[Figure]]]:
    quiet, _ = asyncio.run(_awaited(run_job(QUIET)))
    for heading, who in crowds.items():
        found, came = asyncio.run(_awaited(run_job(who)))
        yield f"{name}, {heading}", figures(found, quiet, came, who)


async def _awaited(found: Awaitable[Found]) -> Found:
    return await found


def run(
    *, lines: int = 2000, grbl_lines: int = 8000, presses: int = 200, readers: int = READERS, upload: int = UPLOAD_BYTES
) -> Report:
    """All of it; with fewer readers there are fewer dashboards, too."""
    everything = Crowd(readers, EVERYTHING, REQUESTS_S, upload)
    crowds = {
        f"{min(readers, DASHBOARDS)} dashboards": Crowd(min(readers, DASHBOARDS)),
        f"{readers} readers of {RATE_HZ:g} Hz, {REQUESTS_S:g} requests/s, an upload": everything,
    }
    groups = [
        *_beside("ElVinto", crowds, lambda who: on_elvinto(lines, who), _elvinto),
        *_beside("Grbl", crowds, lambda who: on_grbl(grbl_lines, who), _grbl),
    ]
    for heading, who in {"quiet": QUIET, **crowds}.items():
        found, came = asyncio.run(paused(presses, who))
        groups.append((f"POST /pause to `!`, {heading}", _late(found, came, who, goal=GOAL_PAUSE_MS)))
    return Report.of(TITLE, groups)
