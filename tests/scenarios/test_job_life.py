"""Jobs from the upload to their end, through the whole chain in simulated time: what people can do with them."""

import asyncio
from pathlib import Path
from typing import Any

import pytest

from jobs.feed import BatchSource
from jobs.runner import Runner
from jobs.upcoming import LINES_AT_ONCE
from server.problems import ProblemError
from sim.elvinto.gcode import ERR_UNKNOWN_CODE, BlockError
from sim.elvinto.settings import SimSettings
from tests.harness.simloop import run_simulated, until
from tests.harness.workshop import MACHINE, Bench


def zigzag(count: int, *, end: str = "M30") -> str:
    """A program whose blocks all end in different places."""
    moves = [f"G1 X{i} Y{i % 7} F3000" for i in range(1, count + 1)]
    return "\n".join(["G90", *moves, end]) + "\n"


def ends(executed: list[str]) -> list[str]:
    """What was executed, without the words that compacting leaves out."""
    return [block.removeprefix("G1").removesuffix("F3000") for block in executed]


def wanted(count: int, *, end: str = "M30") -> list[str]:
    return ["G90", *[f"X{i}Y{i % 7}" for i in range(1, count + 1)], end]


def test_a_program_runs_once_from_the_first_block_to_the_last(tmp_path: Path) -> None:
    async def main() -> None:
        bench = Bench(tmp_path)
        shop = await bench.connected()
        job = await bench.job(zigzag(100))
        assert job["status"] == "running"
        view = await bench.status(job["id"], "completed")
        assert ends(bench.executed()) == wanted(100)
        assert view["progress"]["acknowledged_lines"] == 102
        assert view["error"] is None
        rows = await shop.jobs.batches(job["id"])
        assert {row["status"] for row in rows} == {"ok"}
        assert [row["wire_id"] for row in rows] == sorted(row["wire_id"] for row in rows)
        assert shop.machines[MACHINE].view()["active_job"] is None
        await shop.stop()

    run_simulated(main())


def test_a_thousand_pages_of_comments_do_not_keep_the_loop(tmp_path: Path) -> None:
    async def main() -> None:
        bench = Bench(tmp_path)
        shop = await bench.connected()
        comments = "(a page)\n" * 20_000
        job = await bench.job("G90\nG1 X1 F3000\nM5\n" + comments + "G1 X2\nM30\n")
        turns, pieces = shop.machines[MACHINE].stream._turns, []
        read = turns._read

        def counted(runner: Runner, source: BatchSource) -> Any:
            pieces.append(True)
            return read(runner, source)

        turns._read = counted  # type: ignore[method-assign]
        view = await bench.status(job["id"], "completed")
        assert len(pieces) >= 20_000 // LINES_AT_ONCE - 1, "the first was read before it began"
        assert view["progress"]["line"] == 20_005
        await shop.stop()

    run_simulated(main())


def test_journal_is_durable_before_the_wire_and_at_most_two_rows_are_open(tmp_path: Path) -> None:
    async def main() -> None:
        bench = Bench(tmp_path, latency_s=0.5)  # a slow card: longer than it takes to send
        shop = await bench.connected()
        seen: list[int] = []

        def check(block: Any) -> None:
            if block.id < 1000 or block.text in ("W90", "W95"):
                return
            rows = list(shop.db.db.query("select * from batches where wire_id = ?", [block.id]))  # type: ignore[attr-defined]
            assert len(rows) == 1, f"block {block.text} of ID {block.id} is executed and not in the journal"
            (opened,) = shop.db.db.query("select count(*) as n from batches where status = 'planned'")  # type: ignore[attr-defined]
            seen.append(opened["n"])

        bench.machine._on_block = check
        job = await bench.job(zigzag(100))
        await bench.status(job["id"], "completed")
        assert max(seen) == 2
        await shop.stop()

    run_simulated(main())


def test_pause_takes_effect_after_the_batch_in_flight_and_resume_goes_on(tmp_path: Path) -> None:
    async def main() -> None:
        bench = Bench(tmp_path)
        shop = await bench.connected()
        job = await bench.job(zigzag(100))
        await until(lambda: len(bench.executed()) > 30, within_s=30)
        shop.machines[MACHINE].pause()
        view = await bench.status(job["id"], "paused", within_s=5)
        stood = len(bench.executed())
        rows = await shop.jobs.batches(job["id"])
        assert [row["status"] for row in rows if row["status"] != "ok"] == ["unsent"]
        assert view["progress"]["line"] == stood
        await _pass(120)
        assert len(bench.executed()) == stood
        with pytest.raises(ProblemError, match="uses"):
            await shop.machines[MACHINE].run_blocks(["G0 X0"])
        shop.machines[MACHINE].resume()
        await bench.status(job["id"], "completed")
        assert ends(bench.executed()) == wanted(100)
        await shop.stop()

    run_simulated(main())


async def _pass(seconds: float) -> None:
    await asyncio.sleep(seconds)


def test_cancel_ends_after_the_batch_in_flight_and_holds_the_queue(tmp_path: Path) -> None:
    async def main() -> None:
        bench = Bench(tmp_path)
        shop = await bench.connected()
        job = await bench.job(zigzag(100))
        following = await bench.job(zigzag(3))
        assert (following["status"], following["hold"]) == ("queued", False)
        await until(lambda: len(bench.executed()) > 30, within_s=30)
        await shop.jobs.cancel(job["id"])
        view = await bench.status(job["id"], "cancelled", within_s=5)
        stood = len(bench.executed())
        assert view["progress"]["line"] == stood
        assert view["error"] is None
        await _pass(60)
        assert len(bench.executed()) == stood, "nothing moves because another job was cancelled"
        assert (await shop.jobs.get(following["id"]))["hold"] is True
        await shop.jobs.resume(following["id"])
        await bench.status(following["id"], "completed")
        await shop.stop()

    run_simulated(main())


def test_the_next_job_follows_a_completed_one_by_itself(tmp_path: Path) -> None:
    async def main() -> None:
        bench = Bench(tmp_path)
        shop = await bench.connected()
        first = await bench.job(zigzag(5))
        second = await bench.job(zigzag(6))
        held = await bench.job(zigzag(7), hold=True)
        await bench.status(second["id"], "completed")
        assert (await shop.jobs.get(first["id"]))["status"] == "completed"
        assert ends(bench.executed()) == wanted(5) + wanted(6)
        assert (await shop.jobs.get(held["id"]))["status"] == "queued"
        await shop.stop()

    run_simulated(main())


def test_a_job_for_a_machine_that_is_not_there_is_held_and_does_not_start_by_itself(tmp_path: Path) -> None:
    async def main() -> None:
        bench = Bench(tmp_path)
        bench.cable.plugged = False
        shop = await bench.start()
        job = await bench.job(zigzag(5))
        assert (job["status"], job["hold"]) == ("queued", True)
        bench.cable.plugged = True
        await bench.connected()
        await _pass(60)
        assert bench.executed() == []
        await shop.jobs.resume(job["id"])
        await bench.status(job["id"], "completed")
        await shop.stop()

    run_simulated(main())


def test_an_alarm_in_mid_job_fails_it_and_names_the_lines(tmp_path: Path) -> None:
    async def main() -> None:
        bench = Bench(tmp_path)
        shop = await bench.connected()
        job = await bench.job(zigzag(100))
        await until(lambda: len(bench.executed()) > 30, within_s=30)
        bench.machine.press_emergency(_now())
        bench.cable.touch()
        view = await bench.status(job["id"], "failed", within_s=10)
        stood = bench.executed()
        error = view["error"]
        assert error["code"] == "alarm"
        assert error["line_from"] == view["progress"]["line"] + 1
        assert error["line_from"] <= len(stood) <= error["line_to"]
        await _pass(30)
        assert bench.executed() == stood
        assert shop.machines[MACHINE].state_view()["alarm"]["code"] == 100
        with pytest.raises(ProblemError) as refused:
            await shop.machines[MACHINE].run_blocks(["G0 X0"])
        assert refused.value.code == "alarm_active"
        frames = [event for event in await shop.jobs.events(job["id"]) if event["type"] == "frames"]
        assert len(frames) == 1
        assert len(frames[0]["data"]["frames"]) > 10
        await shop.machines[MACHINE].unlock()
        await until(lambda: shop.machines[MACHINE].state.status == "idle", within_s=20)
        results = await shop.machines[MACHINE].run_blocks(["G0 X0", "G0 Y0"])
        assert [result["ok"] for result in results] == [True, True]
        await shop.stop()

    run_simulated(main())


def _now() -> float:
    return asyncio.get_running_loop().time()


def _refuse(bench: Bench, block: str) -> None:
    """The machine answers ERROR to this block."""
    begin = bench.machine.mill.begin

    def refusing(text: str) -> Any:
        if text == block:
            raise BlockError(ERR_UNKNOWN_CODE)
        return begin(text)

    bench.machine.mill.begin = refusing  # type: ignore[method-assign]


def test_an_error_in_a_batch_stops_the_job_and_names_its_lines(tmp_path: Path) -> None:
    async def main() -> None:
        bench = Bench(tmp_path)
        shop = await bench.connected()
        _refuse(bench, "X60Y4")
        job = await bench.job(zigzag(100))
        view = await bench.status(job["id"], "failed", "completed")
        assert view["status"] == "failed"
        assert view["error"]["code"] == "machine_error"
        assert view["error"]["line_from"] <= 61 <= view["error"]["line_to"]
        assert view["progress"]["line"] == view["error"]["line_from"] - 1
        await _pass(30)
        assert ends(bench.executed())[:60] == wanted(59)[:60]
        assert len(bench.executed()) <= 61
        await shop.stop()

    run_simulated(main())


@pytest.mark.parametrize("pause_meanwhile", [False, True])
def test_m06_waits_for_the_operator(tmp_path: Path, pause_meanwhile: bool) -> None:
    async def main() -> None:
        bench = Bench(tmp_path)
        shop = await bench.connected()
        program = "G90\nG1 X1 Y1 F3000\nT2 M06\nG1 X2 Y2\nM30\n"
        job = await bench.job(program)
        view = await bench.status(job["id"], "waiting", "failed")
        assert (view["status"], view["tool"]) == ("waiting", 2)
        stood = len(bench.executed())
        await _pass(60)
        assert len(bench.executed()) == stood
        machine = shop.machines[MACHINE]
        if pause_meanwhile:
            machine.pause()
            await machine.confirm_tool()
            await bench.status(job["id"], "paused")
            await _pass(60)
            assert len(bench.executed()) == stood
            machine.resume()
        else:
            await machine.confirm_tool()
        await bench.status(job["id"], "completed")
        assert machine.state_view()["tool"] == 2
        assert len(bench.executed()) == 5
        await shop.stop()

    run_simulated(main())


def test_m06_waits_although_the_tool_message_was_lost(tmp_path: Path) -> None:
    async def main() -> None:
        bench = Bench(tmp_path)
        shop = await bench.connected()
        bench.machine._voice.say = _without_tool(bench.machine._voice.say)  # type: ignore[method-assign]
        job = await bench.job("G90\nG1 X1 Y1 F3000\nT2 M06\nG1 X2 Y2\nM30\n")
        view = await bench.status(job["id"], "waiting", "completed")
        assert view["status"] == "waiting"
        await shop.machines[MACHINE].confirm_tool()
        await bench.status(job["id"], "completed")
        await shop.stop()

    run_simulated(main())


def _without_tool(say: Any) -> Any:
    return lambda name, *params: None if name == "TOOL" else say(name, *params)


def test_estop_fails_the_job_with_its_lines_in_doubt(tmp_path: Path) -> None:
    async def main() -> None:
        bench = Bench(tmp_path)
        shop = await bench.connected()
        job = await bench.job(zigzag(100))
        await until(lambda: len(bench.executed()) > 30, within_s=30)
        shop.machines[MACHINE].estop()
        await _pass(0.01)
        assert bench.machine.status == "cnscalarm"
        view = await bench.status(job["id"], "failed")
        assert view["error"]["code"] == "estop"
        assert view["error"]["line_from"] == view["progress"]["line"] + 1
        stood = len(bench.executed())
        await _pass(60)
        assert len(bench.executed()) == stood
        types = [event["type"] for event in await shop.jobs.events(job["id"])]
        assert "estop_demanded" in types
        await shop.stop()

    run_simulated(main())


def test_estop_goes_out_while_the_database_stands_still(tmp_path: Path) -> None:
    async def main() -> None:
        bench = Bench(tmp_path, latency_s=10_000)
        shop = await bench.connected()
        controller = shop.machines[MACHINE]
        await controller.jog({"x": 100.0}, 600)
        controller.estop()
        await _pass(0.01)
        assert bench.machine.status == "cnscalarm"
        await shop.stop()

    run_simulated(main())


def test_estop_without_a_link_fails_the_job_and_says_that_nobody_heard(tmp_path: Path) -> None:
    async def main() -> None:
        bench = Bench(tmp_path)
        shop = await bench.connected()
        job = await bench.job(zigzag(100))
        await until(lambda: len(bench.executed()) > 30, within_s=30)
        bench.cable.pull()
        with pytest.raises(ProblemError) as refused:
            shop.machines[MACHINE].estop()
        assert refused.value.code == "not_connected"
        view = await bench.status(job["id"], "failed")
        assert view["error"]["line_from"] is not None
        await shop.stop()

    run_simulated(main())


def test_by_hand_a_result_for_each_block_and_jogs_leave_the_mode_alone(tmp_path: Path) -> None:
    async def main() -> None:
        bench = Bench(tmp_path)
        shop = await bench.connected()
        controller = shop.machines[MACHINE]
        results = await controller.run_blocks(["G90", "G0 X10 Y5", "G555", "G0 X0"])
        assert [result["ok"] for result in results] == [True, True, False]
        await controller.jog({"x": 2.0, "y": -1.0}, 600)
        await until(lambda: not controller.manual.busy, within_s=10)
        await _pass(1)
        position = controller.state_view()["position"]["machine"]
        assert (position["x"], position["y"]) == (12.0, 4.0)
        assert controller.state.absolute is True
        with pytest.raises(ProblemError):
            await controller.run_blocks(["G0 X1|G0 X2"])
        await shop.stop()

    run_simulated(main())


def test_the_sd_card(tmp_path: Path) -> None:
    async def main() -> None:
        bench = Bench(tmp_path, SimSettings(sd_files={"part1.nc": b"G90\nG1 X5 Y5 F600\nM30\n"}))
        shop = await bench.connected()
        controller = shop.machines[MACHINE]
        files = await controller.list_files()
        assert files["names"] == ["part1.nc"]
        await controller.run_file("part1.nc")
        with pytest.raises(ProblemError) as refused:
            await controller.run_blocks(["G0 X0"])
        assert refused.value.code == "machine_busy"
        await until(lambda: "M30" in bench.executed(), within_s=30)
        await until(lambda: controller.own_program is None, within_s=30)
        await controller.run_blocks(["G0 X0"])
        await shop.stop()

    run_simulated(main())


def test_idempotency_key_makes_a_repeat_harmless(tmp_path: Path) -> None:
    async def main() -> None:
        bench = Bench(tmp_path)
        shop = await bench.connected()
        first = await bench.job(zigzag(5), idempotency_key="k")
        again = await bench.job(zigzag(5), idempotency_key="k")
        assert first["id"] == again["id"]
        with pytest.raises(ProblemError) as refused:
            await bench.job(zigzag(6), idempotency_key="k")
        assert refused.value.code == "idempotency_conflict"
        await bench.status(first["id"], "completed")
        assert ends(bench.executed()) == wanted(5)
        await shop.stop()

    run_simulated(main())


def test_errors_of_the_check_cannot_be_forced_and_warnings_can(tmp_path: Path) -> None:
    async def main() -> None:
        bench = Bench(tmp_path)
        shop = await bench.connected()
        with pytest.raises(ProblemError) as refused:
            await bench.job("G90\nG20\nG1 X1 F100\n")
        assert refused.value.code == "preflight_failed"
        assert refused.value.extra["report"]["errors"]
        stored, _ = await shop.programs.store(_chunks(b"G90\nG17\nG1 X1 F100\nM30\n"), "w.nc")
        with pytest.raises(ProblemError) as refused:
            await shop.jobs.create(stored["id"], MACHINE)
        assert refused.value.code == "preflight_warnings"
        job = await shop.jobs.create(stored["id"], MACHINE, force=True)
        await bench.status(job["id"], "completed")
        await shop.stop()

    run_simulated(main())


async def _chunks(*data: bytes) -> Any:
    for chunk in data:
        yield chunk
