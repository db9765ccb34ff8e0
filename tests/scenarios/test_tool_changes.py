"""Programs with tool changes through the whole daemon, in simulated time: each machine with each kind of changer.

What the changer sees is what goes over the API; it is the virtual one (sim/changer), which knows where its tools are.
"""

import asyncio
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import pytest

from jobs.job import ERROR_CODES
from server.app import Workshop
from server.changer.shell import ABORTS
from server.live.hub import Filter
from server.machine.controller import Controller
from server.problems import ProblemError
from sim.elvinto.settings import SimSettings as SimSettingsElvinto
from sim.grbl.simsettings import SimSettings
from tests.harness.changerbench import Story as WiredStory
from tests.harness.changerbench import bench_of, told_wired
from tests.harness.changerbench import told as told_story
from tests.harness.grblworkshop import GrblBench
from tests.harness.ncworkshop import NcBench
from tests.harness.simloop import run_simulated, until
from tests.harness.textframes import messages
from tests.harness.workshop import MACHINE, Bench

PROGRAM = "G21\nG90\nG1 X1 F240\nT1 M6\nG1 X2\nT2\nM6\nG1 X3\nT3 M6\nX4\nM30\n"
EACH = pytest.mark.parametrize("protocol", ["elvinto", "grbl", "ncframe"])
TWO = pytest.mark.parametrize("protocol", ["elvinto", "grbl"])

Story = Callable[[Any, Workshop, Controller], Awaitable[None]]


def told(bench: Bench, story: Story) -> None:
    async def main() -> None:
        shop = await (bench.located() if isinstance(bench, NcBench) else bench.connected())
        await story(bench, shop, shop.machines[MACHINE])
        if bench.shop is not None:
            await bench.shop.stop()

    run_simulated(main())


async def history(shop: Workshop, job: int, kind: str) -> list[dict[str, Any]]:
    return [event["data"] for event in await shop.jobs.events(job) if event["type"] == kind]


def moves(bench: Bench) -> list[str]:
    return [block for block in bench.executed() if block.startswith(("G1", "X"))]


@EACH
def test_three_changes_by_a_person(tmp_path: Path, protocol: str) -> None:
    async def story(bench: Bench, shop: Workshop, router: Controller) -> None:
        job = await bench.job(PROGRAM)
        for tool in (1, 2, 3):
            view = await bench.status(job["id"], "waiting", "completed", "failed", "interrupted")
            assert (view["status"], view["tool"]) == ("waiting", tool), view
            stood = len(bench.executed())
            await asyncio.sleep(30)
            assert len(bench.executed()) == stood, "nothing moves while a person has the hands in the machine"
            await router.confirm_tool()
        await bench.status(job["id"], "completed")
        assert router.tools.io.tool == 3
        assert router.state_view()["tool"] == 3
        assert [entry["tool"] for entry in await history(shop, job["id"], "tool_changed")] == [1, 2, 3]

    told(bench_of(protocol, tmp_path), story)


@EACH
def test_a_change_that_a_person_gives_up_is_asked_for_no_more(tmp_path: Path, protocol: str) -> None:
    async def story(bench: Bench, shop: Workshop, router: Controller) -> None:
        job = await bench.job(PROGRAM)
        await bench.status(job["id"], "waiting")
        router.tools.fail()
        view = await bench.status(job["id"], "failed", within_s=10.0)
        assert view["error"]["code"] == "tool_change_failed"
        await asyncio.sleep(10)
        state = router.state_view()
        assert (state["status"], state["tool_requested"], state["tool"]) == ("idle", None, 0)
        with pytest.raises(ProblemError) as refused:
            await router.confirm_tool()
        assert refused.value.code == "wrong_state"

    told(bench_of(protocol, tmp_path), story)


@EACH
def test_three_changes_with_jumpers_stop_for_nobody(tmp_path: Path, protocol: str) -> None:
    async def story(bench: Bench, shop: Workshop, router: Controller) -> None:
        job = await bench.job(PROGRAM)
        view = await bench.status(job["id"], "completed", "failed", "waiting", "interrupted")
        assert view["status"] == "completed", view
        assert [entry["tool"] for entry in await history(shop, job["id"], "tool_changed")] == [1, 2, 3]

    told(bench_of(protocol, tmp_path, kind="loopback"), story)


def test_a_grbl_is_never_sent_m6_and_gets_its_modes_back(tmp_path: Path) -> None:
    program = "G21\nG91\nM3 S1000\nM8\nG1 X1 F600\nT1 M6\nX1\nM30\n"

    async def story(bench: GrblBench, shop: Workshop, router: Controller) -> None:
        job = await bench.job(program)
        view = await bench.status(job["id"], "completed", "failed", "interrupted", "paused")
        assert view["status"] == "completed", view
        sent = bench.executed()
        begin = sent.index("G21G90")
        assert sent[begin:] == [
            *("G21G90", "G53G0Z-2", "G53G0X-1Y-1", "M5", "M9"),
            *("G21G17G91G94G54", "M3S1000", "G4P3", "M8", "G1F600", "T1"),
            *("X1", "M30"),
        ]

    told(bench_of("grbl", tmp_path, kind="loopback", change_position=["G53G0Z-2", "G53G0X-1Y-1"]), story)


@EACH
@pytest.mark.parametrize("start_change", [False, True])
def test_three_changes_by_a_changer_on_the_network(tmp_path: Path, protocol: str, start_change: bool) -> None:
    async def story(s: WiredStory) -> None:
        view = await s.ended(PROGRAM)
        assert view["status"] == "completed", view
        assert s.wired.changer.magazine.spindle == 3
        assert (await s.io())["tool"] == 3
        begun = s.wired.orders("tool-prepare", "start-change", "tool-change", "tool-number")
        started = [("start-change", True), ("start-change", False)] if start_change else []
        last = [
            *(("tool-prepare", True), ("tool-prepare", False), *started),
            *(("tool-change", True), ("tool-change", False), ("tool-number", 3)),
        ]
        assert begun[-len(last) :] == last
        assert [entry["tool"] for entry in await history(s.shop, view["id"], "tool_changed")] == [1, 2, 3]

    told_wired(tmp_path, story, protocol=protocol, support_start_change=start_change)


@EACH
def test_a_program_that_asks_for_the_tool_that_is_in(tmp_path: Path, protocol: str) -> None:
    one = "G21\nG90\nG1 X1 F240\nT1 M6\nG1 X2\nM30\n"

    async def story(bench: Bench, shop: Workshop, router: Controller) -> None:
        async def asked(text: str = one) -> bool:
            job = await bench.job(text)
            view = await bench.status(job["id"], "waiting", "completed")
            if view["status"] == "waiting":
                await router.confirm_tool()
                await bench.status(job["id"], "completed")
            return bool(view["status"] == "waiting")

        assert await asked()
        assert router.tools.io.tool_certain
        assert not await asked(), "it is in"
        if protocol == "ncframe":
            await router.run_blocks(["T7"])
            assert await asked(), "the turret was turned by hand"
        job = await bench.job(one.replace("G1 X2", "G1 X90"))
        await asyncio.sleep(3)
        router.stop()
        await bench.status(job["id"], "cancelled")
        await until(lambda: router.state.status == "idle", within_s=5)
        assert await asked(), "behind an abort"

    told(bench_of(protocol, tmp_path, kind="manual"), story)


@EACH
def test_a_person_who_takes_long_is_waited_for_in_sight(tmp_path: Path, protocol: str) -> None:
    async def story(bench: Bench, shop: Workshop, router: Controller) -> None:
        job = await bench.job("G21\nG90\nG1 X1 F240\nT1 M6\nG1 X2\nM30\n")
        await bench.status(job["id"], "waiting")
        await asyncio.sleep(25)
        waiting = router.tools.io.waiting_for
        assert (waiting.what, waiting.tool, waiting.overdue) == ("operator", 1, True)
        said = [event["message"] for event in await history(shop, job["id"], "tool_message")]
        assert said == ["Put tool 1 into the spindle, then confirm.", "Tool 1 is still waited for."]
        await asyncio.sleep(60)
        assert (await bench.status(job["id"], "waiting"))["status"] == "waiting", "nothing is guessed"
        await router.confirm_tool()
        await bench.status(job["id"], "completed")

    told(bench_of(protocol, tmp_path, kind="manual", change_timeout=20.0), story)


def test_always_ask_asks_for_the_tool_that_is_in(tmp_path: Path) -> None:
    async def story(bench: Bench, shop: Workshop, router: Controller) -> None:
        for _ in range(2):
            job = await bench.job("G21\nG90\nG1 X1 F240\nT1 M6\nG1 X2\nM30\n")
            await bench.status(job["id"], "waiting")
            await router.confirm_tool()
            await bench.status(job["id"], "completed")

    told(bench_of("grbl", tmp_path, kind="manual", always_ask=True), story)


@TWO
def test_m6_without_a_t_word_names_the_line_and_nothing_moves(tmp_path: Path, protocol: str) -> None:
    async def story(bench: Bench, shop: Workshop, router: Controller) -> None:
        job = await bench.job("G21\nG90\nG1 X1 F3000\nM6\nG1 X2\nM30\n")
        view = await bench.status(job["id"], "failed", "completed", "waiting")
        assert view["error"]["code"] == "no_tool_word"
        assert "Line 4" in view["error"]["message"]
        assert [block for block in bench.executed() if block in ("M6", "M5", "G1X2", "X2")] == []

    told(bench_of(protocol, tmp_path, kind="loopback"), story)


def test_m61_says_which_tool_is_in_and_is_not_sent_to_a_grbl(tmp_path: Path) -> None:
    async def story(bench: Bench, shop: Workshop, router: Controller) -> None:
        job = await bench.job("G21\nG90\nM61 Q5\nG1 X1 F3000\nT5 M6\nG1 X2\nM30\n")
        view = await bench.status(job["id"], "completed", "failed", "waiting")
        assert view["status"] == "completed", "the tool is in the spindle: nobody is asked"
        assert "G4P0" in bench.executed()
        assert not any("M6" in block for block in bench.executed())
        (changed,) = await history(shop, job["id"], "tool_changed")
        assert (changed["tool"], changed["skipped"]) == (5, True)

    told(bench_of("grbl", tmp_path), story)


def test_coolant_pins_follow_the_program(tmp_path: Path) -> None:
    async def story(bench: Bench, shop: Workshop, router: Controller) -> None:
        reader = shop.hub.subscribe(Filter(topics=frozenset({"io"})))
        job = await bench.job("G21\nG90\nM8\nG1 X1 F3000\nM9\nG1 X2\nM30\n")
        await bench.status(job["id"], "completed", "failed")
        said = [message["data"]["pins"] for message in messages(reader.take(0.0))]
        assert [pins["coolant-flood"] for pins in said if "coolant-flood" in pins] == [True, False]

    told(bench_of("grbl", tmp_path), story)


@pytest.mark.parametrize("protocol", ["grbl", "ncframe"])
def test_coolant_pins_follow_what_people_ask(tmp_path: Path, protocol: str) -> None:
    async def story(s: WiredStory) -> None:
        def coolant() -> list[bool | int]:
            return [s.pin("coolant-flood"), s.pin("coolant-mist")]

        async def typed(*blocks: str) -> None:
            await s.post("commands", 200, blocks=list(blocks))

        await typed("M8")
        assert coolant() == [True, False]
        await typed("M9")
        assert coolant() == [False, False]
        await typed("M8", "M30")
        assert coolant() == [False, False], "the end of a program is an M9"
        if protocol == "grbl":
            await s.post("coolant", 200, flood=True)
            assert coolant() == [True, False]
            await s.post("coolant", 200, flood=False)
            assert coolant() == [False, False]
        await typed("M8")
        await s.post("estop")
        assert coolant() == [False, False]

    told_story(tmp_path, story, protocol=protocol)


def test_on_an_elvinto_m8_is_no_coolant(tmp_path: Path) -> None:
    async def story(s: WiredStory) -> None:
        await s.post("commands", 200, blocks=["M8"])
        assert (await s.ended("G21\nG90\nM8\nG1 X1 F240\nM30\n"))["status"] == "completed"
        events = await s.get("io/events")
        assert not [e for e in events if e["type"] == "io_pins" and "coolant-flood" in dict(e["data"]["pins"])]

    told_story(tmp_path, story)


@EACH
def test_without_a_changer_m6_does_not_pass_the_check(tmp_path: Path, protocol: str) -> None:
    async def story(bench: Bench, shop: Workshop, router: Controller) -> None:
        with pytest.raises(ProblemError) as refused:
            await bench.job(PROGRAM)
        assert refused.value.code == "preflight_failed"
        assert refused.value.extra["report"]["errors"][0]["code"] == "no_tool_changer"

    told(bench_of(protocol, tmp_path, kind="none"), story)


def test_a_grblhal_whose_tools_somebody_else_changes_is_not_sent_m6(tmp_path: Path) -> None:
    async def main() -> None:
        bench = GrblBench(
            tmp_path,
            settings=SimSettings(flavour="grblHAL"),
            grbl={"firmware": "grblhal"},
            options={"toolchanger": {"kind": "loopback"}},
        )
        await bench.connected()
        job = await bench.job(PROGRAM)
        view = await bench.status(job["id"], "completed", "failed", "waiting")
        assert view["status"] == "completed", view
        assert not any("M6" in block for block in bench.executed())
        await bench.shop.stop()  # type: ignore[union-attr]

    run_simulated(main())


def test_a_tool_of_a_program_on_the_card_is_asked_for_and_confirmed(tmp_path: Path) -> None:
    async def story(bench: Bench, shop: Workshop, router: Controller) -> None:
        await router.run_file("part.nc")
        await until(lambda: router.tools.io.may_confirm, within_s=30)
        assert router.tools.io.waiting_for.tool == 4
        await router.confirm_tool()
        assert (router.tools.io.tool, router.state_view()["tool"]) == (4, 4)

    bench = Bench(tmp_path, SimSettingsElvinto(sd_files={"part.nc": b"G90\nG1 X1 F600\nT4 M6\nG1 X2\nM30\n"}))
    told(bench, story)


def test_a_daemon_that_stops_tells_the_changer_why(tmp_path: Path) -> None:
    async def main() -> None:
        bench = bench_of("elvinto", tmp_path)
        shop = await bench.connected()
        router = shop.machines[MACHINE]
        job = await bench.job(PROGRAM)
        await bench.status(job["id"], "waiting")
        await shop.stop()
        pins = {pin.name: pin.value for pin in router.tools.io.pins()}
        assert pins["emc-reason"] == 4
        bench.cable.drop()
        bench.shop = None
        shop = await bench.connected()
        view = await shop.jobs.get(job["id"])
        assert (view["status"], view["tool"]) == ("waiting", 1), "it outlives the daemon"
        await asyncio.sleep(5)
        await shop.machines[MACHINE].confirm_tool()
        await bench.status(job["id"], "waiting")
        await shop.stop()

    run_simulated(main())


def test_every_error_that_ends_a_job_tells_a_changer_something() -> None:
    """An e-stop has its own way, and what was only checked or never began has asked nothing of a changer."""
    apart = {"estop", "line_refused", "cancelled_in_doubt", "preflight_failed"}
    assert set(ABORTS) == set(ERROR_CODES) - apart
