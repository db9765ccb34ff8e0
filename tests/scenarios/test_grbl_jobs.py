"""Jobs on a virtual Grbl through the whole chain, in simulated time: what people, machine and wire do to them."""

import asyncio
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import pytest

from server.app import Workshop
from server.machine.controller import Controller
from server.machine.heldjog import HeldJogs
from server.problems import ProblemError
from sim.grbl.simsettings import SimSettings
from tests.harness.grblworkshop import GrblBench
from tests.harness.simloop import run_simulated, until
from tests.harness.workshop import MACHINE

HEAD = ["G21", "G90", "G54", "G94"]
HOMED = {20: 1.0, 21: 1.0, 22: 1.0}
"""Soft limits, hard limits, homing."""


def zigzag(count: int, *, feed: int = 1200, end: str = "M30") -> str:
    moves = [f"G1 X{i / 10:.1f} Y{i % 7 / 10:.1f} F{feed}" for i in range(1, count + 1)]
    return "\n".join([*HEAD, *moves, end]) + "\n"


def simulated(
    folder: Path, story: Callable[[GrblBench, Workshop, Controller], Awaitable[None]], **options: Any
) -> None:
    """Tell a story on a connected machine, and stop the daemon."""

    async def main() -> None:
        bench = GrblBench(folder, **options)
        shop = await bench.connected()
        await story(bench, shop, shop.machines[MACHINE])
        assert bench.machine.dropped_bytes == 0, "more bytes were sent than the ring takes"
        await bench.shop.stop()  # type: ignore[union-attr]

    run_simulated(main())


async def events_of(shop: Workshop, job: int, kind: str) -> list[dict[str, Any]]:
    return [event["data"] for event in await shop.jobs.events(job) if event["type"] == kind]


def alarm_code(controller: Controller) -> int | None:
    alarm = controller.state.alarm
    return None if alarm is None else alarm.code


async def state_is(controller: Controller, *wanted: str, within_s: float = 60.0) -> None:
    await until(lambda: controller.state.status in wanted, within_s=within_s)


def test_a_program_runs_once_in_order_and_is_complete_at_idle(tmp_path: Path) -> None:
    async def story(bench: GrblBench, shop: Workshop, router: Controller) -> None:
        job = await bench.job(zigzag(120))
        view = await bench.status(job["id"], "completed")
        assert router.state.status == "idle"
        assert view["progress"]["line"] == 125
        moves = [f"X{i / 10:g}Y{i % 7 / 10:g}" for i in range(1, 121)]
        ran = [line.removesuffix("F1200") for line in bench.executed()]
        assert ran == [*HEAD, "G1" + moves[0], *moves[1:], "M30"]
        assert {row["status"] for row in await shop.jobs.batches(job["id"])} == {"ok"}
        following = await bench.job(zigzag(3))
        assert following["status"] == "running", "the machine is free at the moment a job is complete"

    simulated(tmp_path, story)


def test_every_line_is_in_the_journal_before_it_is_on_the_wire(tmp_path: Path) -> None:
    async def story(bench: GrblBench, shop: Workshop, _router: Controller) -> None:
        bare: list[int] = []
        heard = 0
        db = shop.db.db  # type: ignore[attr-defined]

        def check(line: Any) -> None:
            nonlocal heard
            if line.text.startswith(("$", "?")):
                return
            heard += 1  # every line of this program is a block
            if not list(db.query("select 1 from batches where ? between line_from and line_to", [heard])):
                bare.append(heard)

        bench.machine.core.on_line = check
        job = await bench.job(zigzag(150))
        await bench.status(job["id"], "completed")
        assert (bare, heard) == ([], 155)
        (opened,) = db.query("select count(*) as n from batches where status = 'planned'")
        assert opened["n"] == 0

    simulated(tmp_path, story, latency_s=0.05)


def test_pause_holds_in_the_middle_of_a_batch_and_resume_goes_on(tmp_path: Path) -> None:
    async def story(bench: GrblBench, shop: Workshop, router: Controller) -> None:
        job = await bench.job(zigzag(100))
        await state_is(router, "run")
        router.pause()
        view = await bench.status(job["id"], "paused", within_s=1.0)
        assert router.state.status == "hold"
        await asyncio.sleep(5)
        done = len(bench.executed())
        await asyncio.sleep(20)
        assert len(bench.executed()) == done, "nothing is parsed while it holds"
        router.resume()
        await bench.status(job["id"], "running", within_s=1.0)
        view = await bench.status(job["id"], "completed")
        assert view["error"] is None
        assert len(bench.executed()) == 105

    simulated(tmp_path, story)


def test_a_pause_right_behind_a_resume_is_obeyed_although_the_last_report_says_hold(tmp_path: Path) -> None:
    async def story(bench: GrblBench, shop: Workshop, router: Controller) -> None:
        job = await bench.job(zigzag(100))
        await state_is(router, "run")
        router.pause()
        await bench.status(job["id"], "paused", within_s=1.0)
        await until(lambda: router.state.substate == 0, within_s=1.0)
        router.resume()
        assert router.state.status == "hold", "the report from before it"
        router.pause()
        done = len(bench.executed())
        await asyncio.sleep(5)
        view = await bench.status(job["id"], "paused", within_s=0.1)
        assert view["hold"] is True
        assert len(bench.executed()) <= done + 16, "only what was in its buffer was parsed"
        router.resume()
        await bench.status(job["id"], "completed")

    simulated(tmp_path, story)


def test_a_hold_at_the_machine_is_a_pause_and_its_door_too(tmp_path: Path) -> None:
    async def story(bench: GrblBench, shop: Workshop, router: Controller) -> None:
        job = await bench.job(zigzag(60))
        await state_is(router, "run")
        bench.machine.press("H", asyncio.get_running_loop().time())
        bench.cable.touch()
        await bench.status(job["id"], "paused", within_s=2.0)
        bench.machine.release("H", asyncio.get_running_loop().time())
        router.resume()
        await bench.status(job["id"], "completed")

    simulated(tmp_path, story)


def test_stop_keeps_the_position_and_names_the_lines_in_doubt(tmp_path: Path) -> None:
    async def story(bench: GrblBench, shop: Workshop, router: Controller) -> None:
        job = await bench.job(zigzag(300))
        await asyncio.sleep(6)
        router.stop()
        view = await bench.status(job["id"], "cancelled", within_s=5.0)
        ran = [line for line in bench.machine.executed if line.text.startswith(("X", "G1"))]
        finished = sum(line.finished for line in ran)
        error, done = view["error"], view["progress"]["line"]
        assert error["code"] == "cancelled_in_doubt"
        assert done <= 4 + finished, "no line is called done that was not"
        assert error["line_from"] == done + 1
        assert error["line_to"] >= 4 + sum(bool(line.moves) for line in ran), "what it had begun is within the doubt"
        assert error["line_to"] - error["line_from"] < 40
        await state_is(router, "idle")
        at = bench.machine.position
        await asyncio.sleep(5)
        assert bench.machine.position == at
        assert router.state.position["x"] == pytest.approx(at["X"], abs=0.01)
        again = await bench.job(zigzag(3))
        await bench.status(again["id"], "completed")

    simulated(tmp_path, story)


def test_stop_of_a_paused_job_ends_it(tmp_path: Path) -> None:
    async def story(bench: GrblBench, shop: Workshop, router: Controller) -> None:
        job = await bench.job(zigzag(100))
        await state_is(router, "run")
        router.pause()
        await bench.status(job["id"], "paused", within_s=2.0)
        await shop.jobs.cancel(job["id"])
        await bench.status(job["id"], "cancelled", within_s=5.0)
        await state_is(router, "idle")

    simulated(tmp_path, story)


def test_e_stop_resets_at_once_and_the_position_is_lost(tmp_path: Path) -> None:
    async def story(bench: GrblBench, shop: Workshop, router: Controller) -> None:
        job = await bench.job(zigzag(300))
        await asyncio.sleep(4)
        router.estop()
        view = await bench.status(job["id"], "failed", within_s=5.0)
        assert view["error"]["code"] == "estop"
        assert view["error"]["line_from"] == view["progress"]["line"] + 1
        await until(lambda: router.unheard_stop is None, within_s=5.0)
        await state_is(router, "alarm")
        with pytest.raises(ProblemError) as refused:
            await router.run_blocks(["G0 X0"])
        assert refused.value.code == "alarm_active"
        await router.unlock()
        await state_is(router, "idle")

    simulated(tmp_path, story)


def test_an_alarm_fails_the_job_and_only_a_reset_leaves_a_soft_limit(tmp_path: Path) -> None:
    async def story(bench: GrblBench, shop: Workshop, router: Controller) -> None:
        await router.home()
        await until(lambda: bool(router.state.homed) and router.state.status == "idle", within_s=120.0)
        job = await bench.job("\n".join([*HEAD, "G1 X-20 F3000", "G1 X-500 F3000", "G1 X-30", "M30"]) + "\n")
        view = await bench.status(job["id"], "failed")
        assert view["error"]["code"] == "alarm"
        assert alarm_code(router) == 2
        with pytest.raises(ProblemError) as locked:
            await asyncio.wait_for(router.unlock(), 30)
        assert locked.value.code == "wrong_state"
        assert "reset" in str(locked.value)
        await router.reset()
        await state_is(router, "alarm", "idle")
        await until(lambda: alarm_code(router) != 2, within_s=10.0)

    simulated(tmp_path, story, settings=SimSettings(dollar=HOMED))


@pytest.mark.parametrize(("policy", "status"), [("hold", "paused"), ("stop", "failed"), ("ignore", "completed")])
def test_a_refused_line(tmp_path: Path, policy: str, status: str) -> None:
    # P of the dwell is missing: the check before the run warns, the controller refuses it with error:28.
    text = "\n".join([*HEAD, *(f"G1 X{i} F1200" for i in range(1, 9)), "G4", "G1 X9", "G1 X10", "M30"]) + "\n"

    async def story(bench: GrblBench, shop: Workshop, router: Controller) -> None:
        stored, _ = await shop.programs.store(chunk(text.encode()), "part.nc")
        shop.jobs._programs.check = clean  # type: ignore[method-assign]
        job = await shop.jobs.create(stored["id"], MACHINE, force=True, on_error=policy)  # type: ignore[arg-type]
        view = await bench.status(job["id"], status, within_s=60.0)
        (refusal,) = await events_of(shop, job["id"], "line_refused")
        assert (refusal["line"], refusal["block"], refusal["code"]) == (13, "G4", 28)
        assert refusal["inside"] == [14, 15][: len(refusal["inside"])]
        if policy == "hold":
            assert view["error"]["code"] == "line_refused"
            assert "Line 13" in view["error"]["message"]
            router.resume()
            view = await bench.status(job["id"], "completed")
            assert view["error"] is None
        elif policy == "stop":
            assert view["error"]["code"] == "machine_error"
            assert "X10" not in bench.executed() or "M30" not in bench.executed()
        await state_is(router, "idle")

    simulated(tmp_path, story)


async def chunk(data: bytes) -> Any:
    yield data


async def clean(*_args: Any, **_options: Any) -> dict[str, Any]:
    return {"errors": [], "warnings": [], "infos": [], "expanded_lines": None, "seconds": 10.0}


def test_the_controllers_own_check_collects_every_error_and_moves_nothing(tmp_path: Path) -> None:
    text = "\n".join([*HEAD, "G1 X10 F1200", "G4", "G1 Y5", "G4", "M30"]) + "\n"

    async def story(bench: GrblBench, shop: Workshop, router: Controller) -> None:
        stored, _ = await shop.programs.store(chunk(text.encode()), "part.nc")
        shop.jobs._programs.check = clean  # type: ignore[method-assign]
        job = await shop.jobs.create(stored["id"], MACHINE, mode="check")
        view = await bench.status(job["id"], "failed", within_s=60.0)
        assert view["error"]["code"] == "lines_refused"
        assert "2 of the lines" in view["error"]["message"]
        assert [data["line"] for data in await events_of(shop, job["id"], "line_refused")] == [6, 8]
        await state_is(router, "idle", within_s=10.0)
        assert bench.machine.position == {"X": 0.0, "Y": 0.0, "Z": 0.0}
        good = await shop.jobs.create(
            (await shop.programs.store(chunk(zigzag(40).encode()), "b.nc"))[0]["id"], MACHINE, mode="check", force=True
        )
        await bench.status(good["id"], "completed", within_s=60.0)
        await state_is(router, "idle", within_s=10.0)
        assert bench.machine.position == {"X": 0.0, "Y": 0.0, "Z": 0.0}
        real = await bench.job(zigzag(5))
        await bench.status(real["id"], "completed", within_s=60.0)
        assert bench.machine.position["X"] == pytest.approx(0.5, abs=0.01)

    simulated(tmp_path, story)


@pytest.mark.parametrize("resets", [True, False])
def test_a_pulled_plug_interrupts_with_the_lines_and_nothing_moves_by_itself(tmp_path: Path, resets: bool) -> None:
    async def story(bench: GrblBench, shop: Workshop, router: Controller) -> None:
        job = await bench.job(zigzag(300))
        await asyncio.sleep(6)
        bench.cable.pull()
        view = await bench.status(job["id"], "interrupted", within_s=1.0)
        error, done = view["error"], view["progress"]["line"]
        assert error["code"] == "in_doubt"
        assert error["line_from"] == done + 1
        await bench.cable.live_alone(3)
        finished = sum(line.finished for line in bench.machine.executed if line.moves)
        assert done <= 4 + finished
        assert 4 + finished <= error["line_to"]
        bench.cable.plugged = True
        await until(lambda: router.link_status == "connected", within_s=30.0)
        count = len(bench.executed())
        await asyncio.sleep(10)
        assert len(bench.executed()) == count
        view = await bench.status(job["id"], "interrupted", within_s=1.0)
        assert view["error"]["line_from"] == error["line_from"]
        if resets:
            assert view["error"]["code"] == "machine_restarted"
        await shop.jobs.cancel(job["id"])
        await bench.status(job["id"], "cancelled", within_s=1.0)

    simulated(tmp_path, story, settings=SimSettings(reset_on_open=resets))


def test_a_daemon_that_dies_leaves_the_lines_in_doubt_named(tmp_path: Path) -> None:
    async def story(bench: GrblBench, shop: Workshop, _router: Controller) -> None:
        job = await bench.job(zigzag(300))
        await asyncio.sleep(9)
        bench.crash()
        await bench.cable.live_alone(4)
        before = len(bench.executed())
        moved = sum(bool(line.moves) for line in bench.machine.executed)
        await bench.connected()
        view = await bench.status(job["id"], "interrupted", within_s=60.0)
        assert view["error"]["line_from"] == view["progress"]["line"] + 1
        assert view["progress"]["line"] <= 4 + moved <= view["error"]["line_to"]
        await asyncio.sleep(10)
        assert len(bench.executed()) == before, "nothing goes on by itself"

    simulated(tmp_path, story)


def test_a_board_that_restarts_in_the_middle_interrupts_the_job(tmp_path: Path) -> None:
    async def story(bench: GrblBench, shop: Workshop, router: Controller) -> None:
        job = await bench.job(zigzag(300))
        await asyncio.sleep(5)
        bench.machine.restart(asyncio.get_running_loop().time())
        bench.cable.touch()
        view = await bench.status(job["id"], "interrupted", within_s=10.0)
        assert view["error"]["code"] == "machine_restarted"
        assert view["error"]["line_from"] == view["progress"]["line"] + 1

    simulated(tmp_path, story)


def test_a_reset_by_hand_in_the_middle_interrupts_the_job(tmp_path: Path) -> None:
    async def story(bench: GrblBench, shop: Workshop, router: Controller) -> None:
        job = await bench.job(zigzag(300))
        await asyncio.sleep(5)
        await router.reset()
        view = await bench.status(job["id"], "interrupted", within_s=5.0)
        assert view["error"]["code"] == "machine_reset"

    simulated(tmp_path, story)


def test_a_tool_change_of_grblhal_waits_for_the_operator(tmp_path: Path) -> None:
    text = "\n".join([*HEAD, "G1 X1 F600", "T3 M6", "G1 X2", "G1 X3", "M30"]) + "\n"

    async def story(bench: GrblBench, shop: Workshop, router: Controller) -> None:
        job = await bench.job(text)
        view = await bench.status(job["id"], "waiting", within_s=30.0)
        assert view["tool"] == 3
        await asyncio.sleep(10)
        assert "X3" not in [line.text for line in bench.machine.executed if line.finished and line.moves]
        await router.confirm_tool()
        await bench.status(job["id"], "completed", within_s=30.0)
        assert bench.executed()[-1] == "M30"

    simulated(tmp_path, story, settings=SimSettings(flavour="grblHAL"), grbl={"firmware": "grblhal"})


def test_a_pendant_stops_the_stream_until_it_gives_the_machine_back(tmp_path: Path) -> None:
    async def story(bench: GrblBench, shop: Workshop, router: Controller) -> None:
        job = await bench.job(zigzag(600))
        await asyncio.sleep(2)
        bench.machine.set_mpg(True, asyncio.get_running_loop().time())
        bench.cable.touch()
        await until(lambda: router.state.pendant, within_s=5.0)
        await asyncio.sleep(1)
        count = bench.machine.executed_count
        await asyncio.sleep(20)
        assert bench.machine.executed_count <= count + 130, "only what was inside goes on"
        assert (await shop.jobs.get(job["id"]))["status"] == "running"
        bench.machine.set_mpg(False, asyncio.get_running_loop().time())
        bench.cable.touch()
        await bench.status(job["id"], "completed", within_s=120.0)

    simulated(tmp_path, story, settings=SimSettings(flavour="grblHAL"), grbl={"firmware": "grblhal"})


def test_jogs_home_and_unlock_by_hand(tmp_path: Path) -> None:
    async def story(bench: GrblBench, shop: Workshop, router: Controller) -> None:
        await state_is(router, "alarm", within_s=10.0)
        with pytest.raises(ProblemError) as locked:
            await router.jog({"x": 1.0}, 600)
        assert locked.value.code == "alarm_active"
        await router.home()
        assert router.state.status == "home", "the controller itself says nothing while it homes"
        await until(lambda: router.state.homed is True and router.state.status == "idle", within_s=120.0)
        before = bench.machine.position["X"]
        await router.jog({"x": -5.0}, 600)
        await state_is(router, "jog", within_s=2.0)
        await state_is(router, "idle", within_s=10.0)
        assert bench.machine.position["X"] == pytest.approx(before - 5, abs=0.01)
        with pytest.raises(ProblemError) as beyond:
            await router.jog({"x": -5000.0}, 600)
        assert beyond.value.code == "command_failed"
        assert "travel" in str(beyond.value)
        await router.jog({"x": -100.0}, 600)
        await state_is(router, "jog", within_s=2.0)
        router.cancel_jog()
        await state_is(router, "idle", within_s=3.0)
        assert bench.machine.position["X"] > before - 60
        with pytest.raises(ProblemError) as wrong:
            await router.unlock()
        assert wrong.value.code == "wrong_state"

    simulated(tmp_path, story, settings=SimSettings(dollar=HOMED))


def test_a_held_jog_runs_without_a_stop_and_ends_with_its_heartbeat(tmp_path: Path) -> None:
    async def story(bench: GrblBench, _shop: Workshop, router: Controller) -> None:
        held, me = HeldJogs({MACHINE: router}.__getitem__), object()
        loop = asyncio.get_running_loop()
        states: set[str] = set()
        for _ in range(40):
            await held.beat(MACHINE, me, {"x": 1.0}, 600.0)
            await asyncio.sleep(0.1)
            states.add(router.state.status)
        let_go_at, far_mm = loop.time(), bench.machine.position["X"]
        assert states <= {"idle", "jog"}
        assert far_mm == pytest.approx(600 / 60 * 4.0, abs=5.0), "it does not stop between its steps"
        await state_is(router, "idle", within_s=2.0)
        assert bench.machine.position["X"] - far_mm < 600 / 60 * 1.0
        count = bench.machine.executed_count
        await asyncio.sleep(5)
        assert bench.machine.executed_count == count
        assert loop.time() > let_go_at

    simulated(tmp_path, story, settings=SimSettings(dollar={110: 5000.0, 120: 200.0}))


def test_a_job_begins_in_idle_only(tmp_path: Path) -> None:
    async def story(bench: GrblBench, shop: Workshop, router: Controller) -> None:
        await router.jog({"x": 50.0}, 600)
        await state_is(router, "jog", within_s=2.0)
        job = await bench.job(zigzag(3))
        assert (job["status"], job["hold"]) == ("queued", True)
        with pytest.raises(ProblemError) as refused:
            await shop.jobs.resume(job["id"])
        assert refused.value.code == "wrong_state"
        await state_is(router, "idle", within_s=30.0)
        await shop.jobs.resume(job["id"])
        await bench.status(job["id"], "completed")

    simulated(tmp_path, story)


def test_a_controller_that_is_not_the_configured_one_is_named(tmp_path: Path) -> None:
    async def main() -> None:
        bench = GrblBench(tmp_path, settings=SimSettings(flavour="grblHAL"))
        shop = await bench.start()
        said: list[Any] = []
        publish = shop.hub.publish

        def listen(kind: str, machine: str | None, data: Any) -> None:
            said.append((kind, data))
            publish(kind, machine, data)

        shop.hub.publish = listen  # type: ignore[method-assign, assignment]
        await bench.connected()
        (warning,) = [data for kind, data in said if kind == "log" and data.get("kind") == "firmware"]
        assert 'set firmware = "grblhal"' in warning["message"]
        await shop.stop()

    run_simulated(main())


@pytest.mark.parametrize("command", ["$H", "$RST=*", "$C", "G0 X1 ! "])
def test_what_no_block_by_hand_may_be(tmp_path: Path, command: str) -> None:
    async def story(_bench: GrblBench, _shop: Workshop, router: Controller) -> None:
        with pytest.raises(ProblemError) as refused:
            await router.run_blocks([command])
        assert refused.value.code == "invalid_request"

    simulated(tmp_path, story)


def test_blocks_by_hand_have_a_result_each(tmp_path: Path) -> None:
    async def story(bench: GrblBench, _shop: Workshop, router: Controller) -> None:
        results = await router.run_blocks(["G91", "G1 X2 F600", "M6", "G1 X2"])
        assert [result["ok"] for result in results] == [True, True, False]
        assert results[-1]["error"]["code"] == 20
        assert bench.machine.position["X"] == pytest.approx(2.0, abs=0.01)

    simulated(tmp_path, story)
