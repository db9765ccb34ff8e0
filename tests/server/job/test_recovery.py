"""Recovery: what the plan says and when `continue` and `from_line` are refused. The whole stories are scenarios."""

import asyncio
from collections.abc import Awaitable
from pathlib import Path
from typing import Any

import pytest

from server.problems import ProblemError
from tests.harness.simloop import run_simulated, until
from tests.harness.workshop import MACHINE, Bench

PROGRAM = "G90\n" + "".join(f"G1 X{i} Y{i % 7} F6000\n" for i in range(1, 60)) + "M30\n"


async def interrupted(bench: Bench) -> int:
    """A job that was interrupted by a break; its position is proven."""
    shop = await bench.connected()
    job = await bench.job(PROGRAM)
    await until(lambda: len(bench.executed()) >= 25, within_s=60, step_s=0.01)
    bench.cable.pull()
    await bench.status(job["id"], "interrupted")
    bench.cable.plugged = True
    await until(lambda: shop.machines[MACHINE].link_status == "connected", within_s=60)
    return int(job["id"])


async def refusal(work: Awaitable[Any]) -> ProblemError:
    with pytest.raises(ProblemError) as refused:
        await work
    return refused.value


def bench_with(folder: Path, **options: Any) -> Bench:
    return Bench(folder, options={"resume_within": 0, **options})


def test_the_plan_names_what_is_certain_and_what_would_be_sent(tmp_path: Path) -> None:
    async def main() -> None:
        bench = bench_with(tmp_path)
        job = await interrupted(bench)
        shop = bench.shop
        assert shop is not None
        plan = await shop.jobs.recover(job)
        assert plan["certain_line"] == len(bench.executed())
        assert plan["next_line"] == plan["certain_line"] + 1
        assert (plan["line_from"], plan["line_to"], plan["restarted"]) == (None, None, False)
        assert plan["position"] == plan["position_expected"]
        assert plan["reason"]["code"] == "break_too_long"
        assert (plan["can_continue"], plan["why_not"]) == (True, None)
        assert plan["blocks"][:3] == ["G90", "G1", "F6000"]
        assert plan["blocks"][3] == f"X{plan['certain_line']}Y{plan['certain_line'] % 7}"
        stood = len(bench.executed())
        await asyncio.sleep(60)
        assert len(bench.executed()) == stood, "a plan moves nothing"
        await shop.stop()

    run_simulated(main())


def test_only_interrupted_jobs_are_recovered(tmp_path: Path) -> None:
    async def main() -> None:
        bench = bench_with(tmp_path)
        shop = await bench.connected()
        job = await bench.job(PROGRAM)
        assert (await refusal(shop.jobs.recover(job["id"]))).code == "wrong_state"
        await bench.status(job["id"], "completed")
        assert (await refusal(shop.jobs.recover(job["id"], "continue"))).code == "wrong_state"
        await shop.stop()

    run_simulated(main())


def test_refusals_change_nothing(tmp_path: Path) -> None:
    async def main() -> None:
        bench = bench_with(tmp_path)
        job = await interrupted(bench)
        shop = bench.shop
        assert shop is not None
        recover = shop.jobs.recover
        assert (await refusal(recover(job, "from_line"))).code == "invalid_request"
        assert (await refusal(recover(job, "from_line", 62))).code == "invalid_request"
        bench.cable.pull()
        assert (await refusal(recover(job, "continue"))).code == "not_connected"
        assert (await refusal(recover(job, "from_line", 10))).code == "not_connected"
        assert (await shop.jobs.get(job))["status"] == "interrupted"
        await shop.stop()

    run_simulated(main())


def test_an_alarm_stands_in_the_way(tmp_path: Path) -> None:
    async def main() -> None:
        bench = bench_with(tmp_path)
        job = await interrupted(bench)
        shop = bench.shop
        assert shop is not None
        bench.machine.press_emergency(asyncio.get_running_loop().time())
        bench.cable.touch()
        await until(lambda: shop.machines[MACHINE].state.status == "alarm", within_s=10)
        assert (await refusal(shop.jobs.recover(job, "continue"))).code == "alarm_active"
        assert (await shop.jobs.get(job))["status"] == "interrupted"
        await shop.stop()

    run_simulated(main())


def test_a_line_that_goes_on_with_an_arc_is_refused_with_what_to_do(tmp_path: Path) -> None:
    async def main() -> None:
        bench = bench_with(tmp_path)
        shop = await bench.connected()
        arcs = (
            "G90\nG1 X0 Y0 F600\n" + "".join(f"G1 X{i}\n" for i in range(1, 20)) + "G2 X30 Y0 I5.5 J0\nX40 Y0 I5 J0\n"
        )
        job = (await bench.job(arcs))["id"]
        await until(lambda: len(bench.executed()) >= 5, within_s=60, step_s=0.01)
        bench.cable.pull()
        await bench.status(job, "interrupted")
        bench.cable.plugged = True
        await until(lambda: shop.machines[MACHINE].link_status == "connected", within_s=60)
        refused = await refusal(shop.jobs.recover(job, "from_line", 23))
        assert refused.code == "wrong_state"
        assert "names its own motion" in refused.detail
        await shop.stop()

    run_simulated(main())


def test_an_interrupted_job_can_be_cancelled_and_its_machine_used(tmp_path: Path) -> None:
    async def main() -> None:
        bench = bench_with(tmp_path)
        job = await interrupted(bench)
        shop = bench.shop
        assert shop is not None
        other = await bench.job(PROGRAM)
        assert (other["status"], other["hold"]) == ("queued", True), "somebody has to decide first"
        assert (await shop.jobs.cancel(job))["status"] == "cancelled"
        await shop.jobs.resume(other["id"])
        await bench.status(other["id"], "completed")
        await shop.stop()

    run_simulated(main())


def test_a_daemon_before_this_one_may_have_interrupted_it(tmp_path: Path) -> None:
    async def main() -> None:
        bench = bench_with(tmp_path)
        job = await interrupted(bench)
        bench.crash()
        shop = await bench.connected()
        plan = await shop.jobs.recover(job)
        assert plan["can_continue"]
        await shop.jobs.recover(job, "continue")
        view = await bench.status(job, "completed")
        assert view["error"] is None
        assert view["progress"]["line"] == 61
        await shop.stop()

    run_simulated(main())


def test_a_job_that_was_interrupted_behind_its_last_line_is_completed_by_continue(tmp_path: Path) -> None:
    async def main() -> None:
        bench = bench_with(tmp_path)
        shop = await bench.connected()
        job = (await bench.job("G90\nG1 X1 F600\nG1 X20\n"))["id"]
        await until(lambda: len(bench.executed()) >= 3, within_s=60, step_s=0.01)
        bench.cable.pull()
        await bench.status(job, "interrupted")
        await bench.cable.live_alone(10.0)
        bench.cable.plugged = True
        await until(lambda: shop.machines[MACHINE].link_status == "connected", within_s=60)
        plan = await shop.jobs.recover(job)
        assert (plan["certain_line"], plan["can_continue"], plan["blocks"]) == (3, True, [])
        stood = bench.executed()
        await shop.jobs.recover(job, "continue")
        await bench.status(job, "completed")
        assert bench.executed() == stood
        await shop.stop()

    run_simulated(main())


def test_lines_in_doubt_forbid_continue_and_are_named(tmp_path: Path) -> None:
    async def main() -> None:
        bench = bench_with(tmp_path)
        shop = await bench.connected()
        job = (await bench.job(PROGRAM))["id"]
        await until(lambda: len(bench.executed()) >= 25, within_s=60, step_s=0.01)
        bench.cable.pull()
        view = await bench.status(job, "interrupted")
        plan = await shop.jobs.recover(job)
        assert not plan["can_continue"]
        assert (plan["line_from"], plan["line_to"]) == (view["error"]["line_from"], view["error"]["line_to"])
        assert f"Lines {plan['line_from']} to {plan['line_to']} are in doubt" in plan["why_not"]
        assert (await refusal(shop.jobs.recover(job, "continue"))).code == "wrong_state"
        await shop.stop()

    run_simulated(main())


def test_a_machine_that_restarted_is_taken_up_when_it_is_homed_or_somebody_says_so(tmp_path: Path) -> None:
    async def main() -> None:
        bench = bench_with(tmp_path)
        shop = await bench.connected()
        job = (await bench.job(PROGRAM))["id"]
        await until(lambda: len(bench.executed()) >= 25, within_s=60, step_s=0.01)
        bench.machine.restart(asyncio.get_running_loop().time())
        bench.cable.touch()
        await bench.status(job, "interrupted")
        mill = shop.machines[MACHINE]
        await until(lambda: mill.link_status == "connected" and not mill.manual.busy, within_s=60)
        assert (await shop.jobs.recover(job))["needs"] == ["force"]
        assert (await refusal(shop.jobs.recover(job, "from_line", 30))).code == "wrong_state"
        await mill.run_blocks(["W93", "G28"])
        assert (await shop.jobs.recover(job))["needs"] == ["force"], "it was told to ignore G28"
        await mill.run_blocks(["W94"])
        await mill.home()
        await until(lambda: mill.state.homed is True, within_s=60)
        assert (await shop.jobs.recover(job))["needs"] == []
        await shop.jobs.recover(job, "from_line", 30)
        await bench.status(job, "completed")
        await shop.stop()

    run_simulated(main())
