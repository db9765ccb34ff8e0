"""Streaming to a Grbl: the line kept full, the planner fed, fewer bytes, processor time, and how soon a pause is out.

The daemon is a process of its own, the controller another, behind a line of 115200 baud; a plain send-and-wait sender
runs against the same controller. In simulated time the same chain runs without a clock. The one rule: where another
program measures (grblsim) its figures are printed as they are.
"""

import asyncio
import http.client
import json
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from random import Random
from statistics import quantiles
from typing import Any

from bench.daemon import MACHINE, Daemon, serving
from bench.grblpeer import HOST, Seen, Witness, settings
from bench.grblrig import answer, compiled, peer, process, rig
from bench.programs import as_bytes
from bench.report import Figure, Report
from sim.faults import BITS_PER_BYTE
from sim.shell import open_memory
from tests.harness.grblworkshop import GrblBench
from tests.harness.simloop import run_simulated, until

TITLE = "grbl: a line of 115200 baud"
BAUD = 115200
SEED = 21
GOAL_WIRE = 99.0
GOAL_COMPACT = 1.85
GOAL_CPU_MS = 60.0
GOAL_TURNAROUND_US = 500.0
GOAL_PAUSE_MS = 10.0
ACCELERATION = 500.0
STEP_MM, FEED_MM_MIN = 0.1, 1200
"""Together a line of 5 ms."""
LINE_S = 0.005
ROW = 250
LINE_BYTES = 33
READERS = 100
DASHBOARD = "state,job,queue,alarm,tool,io,program,log"
"""What an open dashboard subscribes to; the console only while its page is looked at."""
COMMIT_S = 0.01
LONGEST_S = 100_000.0


def carved(seed: int, lines: int, *, step_mm: float = 0.345, feed_mm_min: int = FEED_MM_MIN) -> Iterator[str]:
    """A relief as `G1 X12.345 Y67.890 Z-1.234 F1200`, 33 bytes a line with its end, and one line before it."""
    random = Random(seed)
    z_mm = 3.0
    yield "G21 G90"
    for index in range(lines - 1):
        row, column = divmod(index, ROW)
        x_mm = 10.005 + step_mm * (ROW - 1 - column if row % 2 else column)
        z_mm = min(max(z_mm + random.uniform(-0.02, 0.02), 1.001), 9.0)
        yield f"G1 X{x_mm:.3f} Y{10.005 + 0.345 * (row % 200):.3f} Z-{z_mm:.3f} F{feed_mm_min}"


def machine(port: str, *, compact: bool) -> str:
    """The machine's part of the configuration."""
    return (
        f'[[machine]]\nname = "{MACHINE}"\nprotocol = "grbl"\nport = "{port}"\nbaud = {BAUD}\n'
        f"[machine.grbl]\nresets_on_open = false\ncompact = {json.dumps(compact)}\n"
    )


# --- in simulated time ------------------------------------------------------------------------------------------------


class _PacedCable:
    """The workshop's cable with the speed of a serial line, and a witness at its end."""

    def __init__(self, witness: Witness) -> None:
        self._witness = witness

    async def __call__(self, url: str, baud: int, on_data: Any, on_lost: Any) -> Any:  # noqa: ARG002
        loop = asyncio.get_running_loop()
        link = await open_memory(self._witness.machine, on_data, baud=baud)
        write = link.write

        def written(data: bytes) -> None:
            self._witness.heard(data, loop.time())
            write(data)

        setattr(link, "write", written)  # noqa: B010 - a method of this one object
        return link


def simulated(program: bytes, *, compact: bool, mode: str = "run", streaming: str = "buffered") -> Seen:
    """A job in simulated time, where computing costs nothing and a commit of the disk takes 10 ms."""
    with tempfile.TemporaryDirectory(prefix="millstream-bench-") as folder:
        grbl = {"compact": compact, "streaming": streaming}
        return run_simulated(_simulated(program, Path(folder), grbl, mode), limit_s=LONGEST_S)


async def _simulated(program: bytes, folder: Path, grbl: dict[str, Any], mode: str) -> Seen:
    options = {"baud": BAUD}
    world = GrblBench(folder, settings(ACCELERATION), options=options, latency_s=COMMIT_S, grbl=grbl)
    witness = Witness(settings(ACCELERATION), now=0.0)
    world.machine, world.cable = witness.machine, _PacedCable(witness)  # type: ignore[assignment]
    shop = await world.connected()
    job = await world.job(program.decode(), mode=mode)
    lines = program.count(b"\n")
    # Nobody asks for the job meanwhile: in simulated time a question makes the journal durable early.
    await until(lambda: witness.lines >= lines, within_s=LONGEST_S)
    await world.status(job["id"], "completed")
    await shop.stop()
    return witness.seen(BAUD)


# --- in real time, on the virtual controller --------------------------------------------------------------------------


async def streamed(program: list[str], *, compact: bool, mode: str = "run") -> Seen:
    """A job of a daemon in a process of its own."""
    with tempfile.TemporaryDirectory(prefix="millstream-bench-") as folder:
        async with (
            peer(BAUD, ACCELERATION) as mill,
            serving(Path(folder), machine(mill.url, compact=compact)) as daemon,
        ):
            job = await daemon.run(await daemon.upload(iter(program)), mode=mode)
            await mill.until(len(program))
            await daemon.settled(job, "completed", within_s=60.0)
            return await mill.seen()


async def sent_and_waited(program: list[str], *, check: bool) -> tuple[Seen, float]:
    """The same by a plain sender; its processor seconds."""
    with tempfile.TemporaryDirectory(prefix="millstream-bench-") as folder:
        path = Path(folder) / "program.nc"
        path.write_bytes(as_bytes(iter(program)))
        async with peer(BAUD, ACCELERATION) as mill:
            arguments = (HOST, str(mill.port), "check" if check else "run", str(path))
            async with process("bench.grblsender", *arguments) as sender:
                found = await answer(sender)
            return await mill.seen(), float(found["cpu_s"])


def wire(found: Seen, *, goal: float | None = None) -> Iterator[Figure]:
    """How full the line was."""
    yield Figure("bytes a line", found.line_bytes / max(found.lines, 1), digits=1)
    yield Figure("lines a second", found.lines_s, digits=1)
    yield Figure("of what the line can carry", 100 * found.wire, "%", goal=goal, sense="least")
    yield Figure("most bytes without an answer", found.most_waiting_bytes, goal=128, digits=0)
    yield Figure("bytes lost", found.dropped_bytes, goal=0, digits=0)


def fed(found: Seen, *, goal: float | None = None) -> Iterator[Figure]:
    """Whether the planner had something to do at all times."""
    yield Figure("from the first move to the end of the last", found.motion_s, "s")
    yield Figure("planner run dry", found.starved_s, "s", goal=goal, digits=3)
    yield Figure("planner run dry, times", found.starved, digits=0)


def as_it_is(found: Seen) -> Iterator[Figure]:
    """Against the program as it is, sent by somebody who never lets the line be empty."""
    perfect = BAUD / BITS_PER_BYTE / LINE_BYTES
    yield from wire(found)
    yield Figure("lines a second / the file as it is", found.lines_s / perfect, "x", goal=GOAL_COMPACT, sense="least")


def on_the_virtual_controller(lines: int) -> Iterator[tuple[str, Iterator[Figure]]]:
    """The daemon and the plain sender on the same controller."""
    program = [*carved(SEED, lines)]
    short = [*carved(SEED, lines, step_mm=STEP_MM)]
    found = asyncio.run(streamed(program, compact=False, mode="check"))
    yield "check mode, as it is, real time", wire(found, goal=GOAL_WIRE)
    plain, _ = asyncio.run(sent_and_waited(program, check=True))
    yield "check mode, plain sender", wire(plain)
    found = asyncio.run(streamed(short, compact=False))
    yield "lines of 5 ms, real time", fed(found, goal=0.0)
    plain, _ = asyncio.run(sent_and_waited(short, check=False))
    yield "lines of 5 ms, plain sender", fed(plain)


def in_simulated_time(lines: int) -> Iterator[tuple[str, Iterator[Figure]]]:
    """What is the sender's doing and nobody else's."""
    relief = as_bytes(carved(SEED, lines))
    for compact in (False, True):
        heading = f"check mode, {'compact' if compact else 'as it is'}, simulated time"
        found = simulated(relief, compact=compact, mode="check")
        yield heading, as_it_is(found) if compact else wire(found, goal=GOAL_WIRE)
    found = simulated(as_bytes(carved(SEED, lines, step_mm=STEP_MM)), compact=False)
    yield "lines of 5 ms, simulated time", fed(found, goal=0.0)


# --- in real time, on grblsim -----------------------------------------------------------------------------------------


async def _measured(grblsim: Path, folder: Path, program: list[str], *, compact: bool, line_s: float | None) -> Any:
    with rig(grblsim, folder, lines=len(program), line_s=line_s) as port:
        await asyncio.sleep(0.3)
        async with serving(folder, machine(str(port.link), compact=compact)) as daemon:
            await daemon.run(await daemon.upload(iter(program)))
            began_s = daemon.cpu_s()
            found = await port.done()
            return found, 1e6 * (daemon.cpu_s() - began_s) / len(program)


async def _bare(grblsim: Path, folder: Path, program: list[str]) -> tuple[dict[str, Any], float]:
    path = folder / "program.nc"
    path.write_bytes(as_bytes(iter(program)))
    with rig(grblsim, folder, lines=len(program)) as port:
        await asyncio.sleep(0.3)
        async with process("bench.grblbare", str(port.link), str(path)) as sender:
            cpu_s = float((await answer(sender))["cpu_s"])
        return await port.done(), 1e6 * cpu_s / len(program)


def on_grblsim(grblsim: Path, lines: int, long_lines: int) -> Iterator[tuple[str, Iterator[Figure]]]:
    """The figures of the measuring responder; first those of a sender that does nothing but count characters."""
    with tempfile.TemporaryDirectory(prefix="millstream-bench-") as folder:
        found, bare_ms = asyncio.run(_bare(grblsim, Path(folder), [*carved(SEED, lines)]))
    yield "grblsim, a bare sender of a few lines", _of_a_bare_sender(found, bare_ms)
    for heading, count, compact, line_s in (
        (f"grblsim, as it is, {long_lines:,} lines", long_lines, False, None),
        (f"grblsim, compact, {long_lines:,} lines", long_lines, True, None),
        ("grblsim, compact, lines of 3 ms", lines, True, 0.003),
        ("grblsim, as it is, lines of 5 ms", lines, False, LINE_S),
    ):
        with tempfile.TemporaryDirectory(prefix="millstream-bench-") as folder:
            program = [*carved(SEED, count)]
            found, cpu_ms = asyncio.run(_measured(grblsim, Path(folder), program, compact=compact, line_s=line_s))
        rows = [*_of_grblsim(found, cpu_ms, compact=compact, paced=line_s is None)]
        rows.append(Figure("processor time / the bare sender's", cpu_ms / max(bare_ms, 1e-6), "x"))
        yield heading, iter(rows)


def _of_a_bare_sender(found: dict[str, Any], cpu_ms: float) -> Iterator[Figure]:
    yield Figure("lines a second", found["lines_per_s"], digits=1)
    yield Figure("from an ok to the next bytes, median", found["turn_p50_us"], "us", digits=0)
    yield Figure("from an ok to the next bytes, p99", found["turn_p99_us"], "us", digits=0)
    yield Figure("its processor time for 1,000 lines", cpu_ms, "ms", digits=1)


def _of_grblsim(found: dict[str, Any], cpu_ms: float, *, compact: bool, paced: bool) -> Iterator[Figure]:
    perfect = BAUD / BITS_PER_BYTE / LINE_BYTES
    yield Figure("lines a second", found["lines_per_s"], digits=1)
    if paced:
        goal = GOAL_WIRE if not compact else None
        yield Figure("of what the line can carry", found["wire_pct"], "%", goal=goal, sense="least")
    else:
        yield Figure("planner run dry", found["dead_s"], "s", goal=0.0, digits=3)
    if compact and paced:
        ratio = found["lines_per_s"] / perfect
        yield Figure("lines a second / the file as it is", ratio, "x", goal=GOAL_COMPACT, sense="least")
    yield Figure("from an ok to the next bytes, median", found["turn_p50_us"], "us", digits=0)
    if not compact:  # shorter lines leave no room at every ok: then it is the wire that is waited for
        goal = GOAL_TURNAROUND_US
        yield Figure("from an ok to the next bytes, p99", found["turn_p99_us"], "us", goal=goal, digits=0)
    yield Figure("answers that grblsim itself gave over 1 ms late", found["sim_late_over_1ms"], digits=0)
    # Where the line is full, as for the senders that it is compared with: with fewer lines in a second each of them has
    # more of what a second costs (its questions, the reports), and a colder processor.
    cpu_goal = GOAL_CPU_MS if paced else None
    yield Figure("processor time of the daemon for 1,000 lines", cpu_ms, "ms", goal=cpu_goal, digits=1)
    yield Figure("most bytes without an answer", found["max_unacked"], goal=128, digits=0)
    yield Figure("overflows", found["overflow"], goal=0, digits=0)


# --- how soon a pause is out ------------------------------------------------------------------------------------------


async def paused(presses: int, *, readers: int = READERS, topics: str = DASHBOARD) -> list[float]:
    """Seconds from the first byte of `POST /pause` to the `!` at the controller's end of the wire, sorted."""
    program = [*carved(SEED, 20_000 + 500 * presses, step_mm=STEP_MM)]
    random = Random(SEED)
    with tempfile.TemporaryDirectory(prefix="millstream-bench-") as folder:
        async with peer(BAUD, ACCELERATION) as mill, serving(Path(folder), machine(mill.url, compact=True)) as daemon:
            job = await daemon.run(await daemon.upload(iter(program)))
            await mill.until(50)
            url = "ws://{}:{}/api/v1".format(*daemon.address)
            async with process("bench.grblreaders", url, str(readers), topics) as crowd:
                assert crowd.stdout is not None
                await crowd.stdout.readline()
                times = [await pressed(daemon, random) for _ in range(presses)]
            await daemon.cancel(job)
            await daemon.settled(job, "cancelled")
            held = (await mill.seen()).holds_at
    return sorted(first_after(held, at) - at for at in times)


async def pressed(daemon: Daemon, random: Random) -> float:
    """One pause and what follows; when it was asked for."""
    link = http.client.HTTPConnection(*daemon.address)
    link.connect()
    at = time.monotonic()
    await asyncio.to_thread(_post, link, "pause")
    await asyncio.sleep(0.15)
    await asyncio.to_thread(_post, link, "resume")
    link.close()
    await asyncio.sleep(random.uniform(0.1, 0.2))
    return at


def _post(link: http.client.HTTPConnection, verb: str) -> None:
    link.request("POST", f"/api/v1/machines/{MACHINE}/{verb}", headers={"Content-Length": "0"})
    answered = link.getresponse()
    text = answered.read()
    assert answered.status < 300, f"{verb}: {answered.status} {text[:200]!r}"


def first_after(held: list[float], at: float) -> float:
    """When the hold came out of the wire."""
    return next(hold for hold in held if hold >= at)


def latency(presses: int) -> Iterator[tuple[str, Iterator[Figure]]]:
    """A pause with a job under way and many who look on."""
    for heading, topics in (("dashboards", DASHBOARD), ("consoles", f"{DASHBOARD},console")):
        found = asyncio.run(paused(presses, topics=topics))
        yield f"POST /pause to `!`, {READERS} {heading}", _late(found, goal=GOAL_PAUSE_MS)


def _late(found: list[float], *, goal: float) -> Iterator[Figure]:
    cuts = quantiles(found, n=100, method="inclusive")
    yield Figure("presses", len(found), digits=0)
    yield Figure("median", 1e3 * cuts[49], "ms")
    yield Figure("p99", 1e3 * cuts[98], "ms", goal=goal)
    yield Figure("longest", 1e3 * found[-1], "ms")


def run(*, lines: int = 3000, long_lines: int = 20_000, presses: int = 200) -> Report:
    """All of it; `lines` 0 leaves real time out."""
    groups = [*in_simulated_time(lines or 1000)]
    if lines:
        groups += on_the_virtual_controller(lines)
        with tempfile.TemporaryDirectory(prefix="millstream-bench-") as folder:
            grblsim = compiled(Path(folder))
            if grblsim is None:
                groups.append(("grblsim: NOT MEASURED, its source or a C compiler is missing", iter(())))
            else:
                groups += on_grblsim(grblsim, lines, long_lines)
        groups += latency(presses)
    return Report.of(TITLE, groups)
