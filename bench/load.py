"""Many at once beside two jobs: dashboards alone, then readers, requests and a large upload, and pauses among them.

The same two jobs go on through all of it, on an ElVinto and on a Grbl; quiet phases and crowded ones take turns, and
what is printed are ratios of these, with their spread. The one rule: who asks, reads and uploads has the lowest
priority of the system, for it stands for other computers, and a stand-in for the daemon shows what that costs anyway.
"""

import asyncio
from collections.abc import AsyncIterator, Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from random import Random
from statistics import quantiles

from bench import grbl
from bench.grblpeer import HOST
from bench.loadclients import Crowd, Load
from bench.loadrig import SEED, Phase, Workshop, workshop
from bench.phases import Ratio, in_turns, median_ratio, ratio
from bench.report import Figure, Report

TITLE = "load: many readers, requests and an upload beside two jobs"
PARTS = ("dashboards", "workshop", "pause")
GOAL_RATIO = 1.05
GOAL_PAUSE_MS = 20.0
GOAL_UPLOAD_GB = 1.0
DASHBOARDS = 60
READERS = 100
REQUESTS_S = 50.0
UPLOAD_BYTES = 1_000_000_000
EVERYTHING = f"{grbl.DASHBOARD},console"
QUIET, CROWD, STAND_IN = "quiet", "crowd", "stand-in"
SLOWEST = 2.0
"""The jobs are long enough for a computer that takes so much longer."""
NOTE = (
    "readers, clients and the upload are two processes of the lowest priority (nice 19): they are other computers' work"
)

Say = Callable[[str], None]
Group = tuple[str, Iterator[Figure]]


@dataclass(frozen=True, slots=True)
class Plan:
    """How long and how many. `pressed` and `pressed_quiet` are presses in a phase of pauses with the daemon's crowd,
    and in one without."""

    readers: int = READERS
    upload_bytes: int = UPLOAD_BYTES
    phase_s: float = 6.0
    rounds: int = 5
    dashboard_rounds: int = 4
    pressed: int = 60
    pressed_quiet: int = 25
    pause_rounds: int = 2

    def seconds(self, parts: Sequence[str]) -> float:
        """About as long as it takes on quiet cores."""
        of = {
            "dashboards": self.dashboard_rounds * 2 * (self.phase_s + 1.2),
            "workshop": self.rounds * 3 * (self.phase_s + 1.7),
            "pause": self.pause_rounds * (5.0 + 0.36 * (self.pressed + 2 * self.pressed_quiet)),
        }
        return 10.0 + sum(of[part] for part in parts)


def silent(_: str) -> None:
    """For who wants the report alone."""


class Crowded:
    """Phases of one workshop with a crowd and without, in turns."""

    def __init__(self, shop: Workshop, crowd: Crowd, say: Say) -> None:
        host, port = shop.daemon.address
        self._shop = shop
        self._crowds = {CROWD: replace(crowd, host=host, port=port)}
        self._say = say
        self._there = QUIET
        self.phases: dict[str, list[Phase]] = {QUIET: [], CROWD: [], STAND_IN: []}
        self.loads: dict[str, Load] = {CROWD: Load(), STAND_IN: Load()}
        self.peak_mb = self.before_mb = shop.daemon.resident_mb()

    async def turns(self, name: str, conditions: Sequence[str], rounds: int, phase_s: float) -> None:
        """All of it; afterwards nobody is there."""
        order = list(in_turns(conditions, rounds))
        for number, condition in enumerate(order, 1):
            await self.change(condition)
            phase = await self._shop.measured(phase_s)
            self.phases[condition].append(phase)
            self._say(f"  {name} {number}/{len(order)}: {_line(condition, phase)}")
        await self.change(QUIET)

    async def change(self, condition: str) -> None:
        """Who is there from now on."""
        if condition == self._there:
            return
        if self._there != QUIET:
            self.loads[self._there] += await self._shop.crowds.go()
            self.peak_mb = max(self.peak_mb, self._shop.daemon.resident_mb(peak=True))
        if condition == STAND_IN and STAND_IN not in self._crowds:
            # It is told to say as much as the daemon has said so far.
            port = await self._shop.stand_in(*self._manner())
            self._crowds[STAND_IN] = replace(self._crowds[CROWD], host=HOST, port=port)
        if condition != QUIET:
            await self._shop.crowds.come(self._crowds[condition])
        self._there = condition

    def _manner(self) -> tuple[int, int, float]:
        got, readers = self.loads[CROWD], max(self._crowds[CROWD].readers, 1)
        return (
            got.answer_bytes // max(got.requests, 1),
            got.read_bytes // max(got.pieces, 1),
            got.pieces / max(got.seconds, 1e-9) / readers,
        )

    def elvinto(self, condition: str) -> Ratio:
        """Dead time against that of the quiet phases."""
        return ratio([one.dead for one in self.phases[condition]], [one.dead for one in self.phases[QUIET]])

    def grbl(self, condition: str) -> Ratio:
        """Seconds of a row, likewise."""
        return ratio([one.row for one in self.phases[condition]], [one.row for one in self.phases[QUIET]])


def _line(condition: str, phase: Phase) -> str:
    dead, row = phase.dead, phase.row
    return (
        f"{condition:<9} ElVinto dead {1e3 * dead.mean:7.2f} ms a batch ({dead.count:.0f}), "
        f"Grbl {1e3 * row.mean:7.2f} ms a row ({row.count:.0f}), dry {phase.starved_s:.3f} s, "
        f"daemon {100 * phase.cpu_s / phase.seconds:.0f} % of a core"
    )


# --- the rows ---------------------------------------------------------------------------------------------------------


def on_elvinto(found: Crowded) -> Iterator[Figure]:
    """What the crowd does to the time between batches."""
    yield found.elvinto(CROWD).figure("dead time / the quiet phases'", goal=GOAL_RATIO)
    crowd, quiet = (_gaps(found.phases[condition]) for condition in (CROWD, QUIET))
    yield Figure("the same of the phases' medians", median_ratio(crowd, quiet), "x", digits=3)
    if found.phases[STAND_IN]:
        yield found.elvinto(STAND_IN).figure("with a stand-in for the daemon / the quiet phases'")
    for heading, name in (
        ("dead time of a batch", "dead_s"),
        ("  the daemon between OK and the next command", "turnaround_s"),
        ("  OK late: behind a STATE, or the machine's timer", "answer_wait_s"),
        ("  the command slower than its bytes", "command_wait_s"),
    ):
        for condition in (QUIET, CROWD, STAND_IN):
            if found.phases[condition]:
                yield Figure(f"{heading}, {condition}", _of_a_gap(found.phases[condition], name), "ms", digits=3)
    for condition in (QUIET, CROWD):
        yield Figure(f"batches, {condition}", sum(one.dead.count for one in found.phases[condition]), digits=0)


def _gaps(phases: Sequence[Phase]) -> list[float]:
    return [one.dead.mean for one in phases if one.dead.count]


def _of_a_gap(phases: Sequence[Phase], name: str) -> float:
    total_s = sum(float(getattr(one.elvinto, name)) for one in phases if one.elvinto is not None)
    return 1e3 * total_s / max(sum(one.dead.count for one in phases), 1)


def on_grbl(found: Crowded) -> Iterator[Figure]:
    """What it does to a planner: one that runs dry, or has little ahead, takes longer for a row."""
    yield found.grbl(CROWD).figure("time of a row / the quiet phases'", goal=GOAL_RATIO)
    crowd, quiet = ([s for one in found.phases[condition] for s in one.rows_s] for condition in (CROWD, QUIET))
    yield Figure("the same of the rows' medians", median_ratio(crowd, quiet), "x", digits=3)
    if found.phases[STAND_IN]:
        yield found.grbl(STAND_IN).figure("with a stand-in for the daemon / the quiet phases'")
    for condition in (QUIET, CROWD, STAND_IN):
        if phases := found.phases[condition]:
            dry_s = sum(one.starved_s for one in phases) / sum(one.seconds for one in phases)
            yield Figure(f"planner run dry, of the time, {condition}", 100 * dry_s, "%", digits=3)
    for condition, rows_s in ((QUIET, quiet), (CROWD, crowd)):
        yield Figure(f"rows, {condition}", len(rows_s), digits=0)


def came(found: Crowded, crowd: Crowd) -> Iterator[Figure]:
    """What they got: less than asked for is not the load that it should be."""
    load = found.loads[CROWD]
    seconds = max(load.seconds, 1e-9)
    if crowd.readers:
        yield Figure("messages a second to each reader", load.messages / seconds / crowd.readers, digits=1)
    if crowd.requests_s:
        goal = 0.98 * crowd.requests_s
        yield Figure("requests a second", load.requests / seconds, goal=goal, sense="least", digits=1)
        yield Figure("answered, p99", 1e3 * load.p99_s, "ms", digits=1)
    yield Figure("refused or cut off" + "".join(f", {one}" for one in load.refusals), load.refused, goal=0, digits=0)
    if crowd.upload_bytes:
        goal = GOAL_UPLOAD_GB * crowd.upload_bytes / UPLOAD_BYTES
        yield Figure("uploaded meanwhile", load.uploaded_bytes / 1e9, "GB", goal=goal, sense="least")
        yield Figure("  a second", load.uploaded_bytes / seconds / 1e6, "MB", digits=1)
    if (stand_in := found.loads[STAND_IN]).seconds:
        yield Figure("the stand-in: requests a second", stand_in.requests / stand_in.seconds, digits=1)
        uploaded_mb_s = stand_in.uploaded_bytes / stand_in.seconds / 1e6
        yield Figure("the stand-in: uploaded a second", uploaded_mb_s, "MB", digits=1)
        messages_s = stand_in.messages / stand_in.seconds / max(crowd.readers, 1)
        yield Figure("the stand-in: messages a second to each reader", messages_s, digits=1)
    for condition in (QUIET, CROWD):
        phases = found.phases[condition]
        if seconds := sum(one.seconds for one in phases):
            yield Figure(
                f"the daemon, of one core, {condition}", 100 * sum(one.cpu_s for one in phases) / seconds, "%", digits=0
            )
    yield Figure("memory of the daemon before", found.before_mb, "MiB", digits=1)
    yield Figure("memory of the daemon, highest", found.peak_mb, "MiB", digits=1)


def late(lates_s: list[float], *, goal: float | None) -> Iterator[Figure]:
    """Rows of sorted seconds."""
    cuts = quantiles(lates_s, n=100, method="inclusive")
    yield Figure("presses", len(lates_s), digits=0)
    yield Figure("median", 1e3 * cuts[49], "ms")
    yield Figure("p99", 1e3 * cuts[98], "ms", goal=goal)
    yield Figure("longest", 1e3 * lates_s[-1], "ms")


# --- the parts --------------------------------------------------------------------------------------------------------


async def dashboards(shop: Workshop, plan: Plan, say: Say) -> list[Group]:
    """Only readers."""
    crowd = Crowd("", 0, min(plan.readers, DASHBOARDS), grbl.DASHBOARD)
    found = Crowded(shop, crowd, say)
    await found.turns("dashboards", (QUIET, CROWD), plan.dashboard_rounds, plan.phase_s)
    who = f"{crowd.readers} dashboards"
    return [
        (f"ElVinto, {who}", on_elvinto(found)),
        (f"Grbl, {who}", on_grbl(found)),
        (f"What {who} got", came(found, crowd)),
    ]


def everybody(plan: Plan) -> Crowd:
    """Readers, requests, an upload."""
    return Crowd("", 0, plan.readers, EVERYTHING, requests_s=REQUESTS_S, upload_bytes=plan.upload_bytes)


async def everything(shop: Workshop, plan: Plan, say: Say) -> list[Group]:
    """All of them together."""
    crowd = everybody(plan)
    found = Crowded(shop, crowd, say)
    await found.turns("workshop", (QUIET, CROWD, STAND_IN), plan.rounds, plan.phase_s)
    who = f"{crowd.readers} readers of {crowd.rate_hz:g} Hz, {crowd.requests_s:g} requests/s, an upload"
    return [
        (f"ElVinto, {who}", on_elvinto(found)),
        (f"Grbl, {who}", on_grbl(found)),
        (f"What {who} got", came(found, crowd)),
    ]


async def pauses(shop: Workshop, plan: Plan, say: Say) -> list[Group]:
    """`POST /pause` on the Grbl, beside nobody, beside everybody, and while everybody is with the stand-in."""
    crowd, random = everybody(plan), Random(SEED)
    found = Crowded(shop, crowd, say)
    lates_s: dict[str, list[float]] = {QUIET: [], CROWD: [], STAND_IN: []}
    order = list(in_turns(tuple(lates_s), plan.pause_rounds))
    for number, condition in enumerate(order, 1):
        await found.change(condition)
        await shop.holds_at()
        presses = plan.pressed if condition == CROWD else plan.pressed_quiet
        pressed = [await grbl.pressed(shop.daemon, random) for _ in range(presses)]
        held = await shop.holds_at()
        these_s = [grbl.first_after(held, at) - at for at in pressed]
        lates_s[condition] += these_s
        say(
            f"  pause {number}/{len(order)}: {condition:<9} {presses} presses, "
            f"{1e3 * sum(these_s) / presses:.1f} ms in the mean, longest {1e3 * max(these_s):.1f} ms"
        )
    await found.change(QUIET)
    return [
        *(
            (
                f"POST /pause to `!`, {condition}",
                late(sorted(these_s), goal=GOAL_PAUSE_MS if condition == CROWD else None),
            )
            for condition, these_s in lates_s.items()
        ),
        ("What the crowd got beside the pauses", came(found, crowd)),
    ]


async def _parts(only: Sequence[str], plan: Plan, say: Say) -> AsyncIterator[Group]:
    """Each part's groups when it has ended."""
    take = {"dashboards": dashboards, "workshop": everything, "pause": pauses}
    async with workshop(SLOWEST * plan.seconds(only)) as shop:
        for part in only:
            for heading, figures in await take[part](shop, plan, say):
                yield heading, figures


def run(only: Sequence[str] = PARTS, *, say: Say = silent, plan: Plan | None = None) -> Report:
    """The parts that are named, one after the other; `say` is told each as it ends, and how far it is."""
    return asyncio.run(_told(only or PARTS, say, plan or Plan()))


async def _told(only: Sequence[str], say: Say, plan: Plan) -> Report:
    say(f"=== {TITLE}\n\n  about {plan.seconds(only):.0f} s\n  {NOTE}")
    groups: list[tuple[str, tuple[Figure, ...]]] = []
    async for heading, figures in _parts(only, plan, say):
        groups.append((heading, tuple(figures)))
        say("\n".join(["", heading, *map(str, groups[-1][1])]))
    return Report(TITLE, tuple(groups))
