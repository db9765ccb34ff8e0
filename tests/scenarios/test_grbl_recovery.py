"""A job on a virtual Grbl is broken off, its plan is shown over HTTP, and it is taken up on the operator's word."""

import asyncio
import json
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import httpx
import pytest

from server.api import recovermodels
from server.job.takingup import TakingUp
from server.machine.controller import Controller
from sim.grbl.simsettings import SimSettings
from tests.harness.apps import create_app
from tests.harness.grblworkshop import GrblBench
from tests.harness.simloop import run_simulated, until
from tests.harness.workshop import MACHINE

ROUTER = f"/api/v1/machines/{MACHINE}"
LIVELY = {110: 6000.0, 111: 6000.0, 112: 6000.0, 120: 200.0, 121: 200.0, 122: 200.0}
LINES = 120
PROGRAM = "\n".join(
    [
        *("G21 G90 G17", "M3 S900", "G0 X10 Y10 Z5", "G1 Z-2 F300"),
        *(f"G1 X{10 + i / 4:g} Y{10 + i % 9} F1200" for i in range(1, LINES + 1)),
        *("G0 Z5", "M5", "M30"),
    ]
)
FINE = {"max_batch_blocks": 8}
"""Rows of the journal of a few lines: after ninety some are certain."""
WAY = {"clearance": 15.0, "plunge_feed": 200.0, "spindle_wait": 1.0}

Story = Callable[[GrblBench, httpx.AsyncClient, Controller], Awaitable[None]]


def told(folder: Path, story: Story, *, reentry: dict[str, Any] | None = None, **settings: Any) -> None:
    """A daemon whose machine is connected; without a configured clearance unless the story has one."""

    async def main() -> None:
        settings["dollar"] = LIVELY | settings.get("dollar", {})
        bench = GrblBench(folder, settings=SimSettings(**settings), options={"reentry": reentry or {}}, grbl=FINE)
        shop = await bench.connected()
        transport = httpx.ASGITransport(create_app(shop))
        async with httpx.AsyncClient(transport=transport, base_url="http://127.0.0.1:8420") as client:
            await story(bench, client, shop.machines[MACHINE])
        await shop.stop()

    run_simulated(main())


async def interrupted(bench: GrblBench, router: Controller, text: str = PROGRAM, *, alone_s: float = 20.0) -> int:
    """The cable is pulled out in the middle of a job and put back when the machine has done what it had."""
    job = (await bench.job(text))["id"]
    await until(lambda: len(bench.executed()) >= 90, within_s=60, step_s=0.01)
    assert router._acks.in_flight > 0
    bench.cable.pull()
    await bench.status(job, "interrupted")
    assert router._acks.in_flight == 0, "what a break leaves open is waited for by nobody"
    await bench.cable.live_alone(alone_s)
    bench.cable.plugged = True
    await until(lambda: router.link_status == "connected" and router.state.status in ("idle", "alarm"), within_s=60)
    return int(job)


async def ask(client: httpx.AsyncClient, job: int, body: Any = None, *, status: int = 200) -> Any:
    answer = await client.post(f"/api/v1/jobs/{job}/recover", json=body)
    assert answer.status_code == status, answer.text
    if status == 200 and (body is None or "action" not in body):
        recovermodels.PlanView.model_validate(answer.json(), strict=True)
    return answer.json()


def cuts(bench: GrblBench, since: int) -> list[tuple[Any, ...]]:
    """The feed motions of the lines from that many on, to a hundredth."""
    return [
        tuple(round(value, 2) for value in (*move.start, *move.end, move.rate_mm_min))
        for line in bench.machine.executed[since:]
        for move in line.moves
        if move.kind == "feed"
    ]


def wanted(line: int) -> list[tuple[Any, ...]]:
    """What the program cuts from a line on, by its own text."""
    found, place = [], (10.0, 10.0)
    for number, text in enumerate(PROGRAM.splitlines(), 1):
        if text.startswith("G1 X"):
            x, y = (float(word[1:]) for word in text.split()[1:3])
            if number >= line:
                found.append((*place, -2.0, x, y, -2.0, 1200.0))
            place = (x, y)
    return found


def test_unplugged_in_the_middle_planned_and_completed(tmp_path: Path) -> None:
    async def story(bench: GrblBench, client: httpx.AsyncClient, router: Controller) -> None:
        job = await interrupted(bench, router)
        plan = await ask(client, job, WAY)
        done, line = plan["certain_line"], plan["next_line"]
        assert plan["line_from"] == line == done + 1
        assert plan["line_to"] > line
        assert not plan["can_continue"]
        assert plan["needs"] == ["force"], "nobody has homed it since the cable was out"
        texts = [step["text"] for step in plan["steps"]]
        assert "G0 Z15" in texts[-9:-6], texts
        assert texts[-6:] == ["M3 S900", "G4 P1", "M9", "G1 Z-2 F200", "F1200", "G1"]
        assert plan["blocks"][0] == texts[0]
        stood = bench.executed()
        await asyncio.sleep(30)
        assert bench.executed() == stood, "a plan moves nothing"

        refused = await ask(client, job, {"action": "from_line", **WAY}, status=409)
        assert (refused["code"], "homed" in refused["detail"]) == ("wrong_state", True)
        before = len(bench.machine.executed)
        view = await ask(client, job, {"action": "from_line", "force": True, **WAY})
        assert (view["status"], view["progress"]["line"]) == ("running", done)
        await bench.status(job, "completed")
        plunge, *rest = cuts(bench, before)
        assert plunge[5:] == (-2.0, 200.0)
        assert rest == wanted(line)
        events = (await client.get(f"/api/v1/jobs/{job}/events")).json()
        (said,) = [event["data"] for event in events if event["type"] == "prologue"]
        assert (said["line"], said["blocks"]) == (line, [text for text in texts if text])

    told(tmp_path, story)


def test_a_board_that_resets_is_homed_and_then_needs_no_force(tmp_path: Path) -> None:
    reentry = {"clearance": -3.0, "clearance_is_machine": True, "plunge_feed": 150.0, "spindle_wait": 0.0}

    async def story(bench: GrblBench, client: httpx.AsyncClient, router: Controller) -> None:
        async def home() -> None:
            await until(lambda: router.state.status == "alarm", within_s=30)
            assert (await client.post(f"{ROUTER}/home")).status_code == 202
            await until(lambda: router.state.homed is True and router.state.status == "idle", within_s=120)

        await home()
        # Its zero lies within the machine, in G55, and nothing in the program says so.
        zero = {"blocks": ["G10 L2 P2 X-150 Y-150 Z-50", "G55"]}
        assert (await client.post(f"{ROUTER}/commands", json=zero)).status_code == 200
        job = await interrupted(bench, router, alone_s=0.5)
        refused = await ask(client, job, {"action": "from_line"}, status=409)
        assert refused["code"] == "alarm_active"
        await home()
        plan = await ask(client, job)
        assert plan["needs"] == []
        assert "G55" in [step["text"] for step in plan["steps"]]
        assert plan["way"] == reentry
        line = plan["next_line"]
        before = len(bench.machine.executed)
        await ask(client, job, {"action": "from_line", "line": line})
        await bench.status(job, "completed")
        _, *rest = cuts(bench, before)
        shifted = [(x - 150, y - 150, z - 50, a - 150, b - 150, c - 50, f) for x, y, z, a, b, c, f in wanted(line)]
        assert rest == [tuple(round(value, 2) for value in cut) for cut in shifted]

    told(tmp_path, story, reentry=reentry, reset_on_open=True, dollar={20: 1.0, 21: 1.0, 22: 1.0})


def test_what_is_not_said_is_asked_for_and_what_is_wrong_is_refused(tmp_path: Path) -> None:
    async def story(bench: GrblBench, client: httpx.AsyncClient, router: Controller) -> None:
        job = await interrupted(bench, router, PROGRAM.replace("M3", "T2 M3"))
        plan = await ask(client, job)
        assert plan["needs"] == ["clearance", "force"]
        assert (plan["steps"], plan["way"]) == ([], None)
        assert "clearance" in plan["line_why_not"]
        run = {"action": "from_line", "force": True}
        assert (await ask(client, job, run, status=422))["code"] == "invalid_request"
        plan = await ask(client, job, {"line": 30, **WAY})
        assert (plan["next_line"], plan["needs"]) == (30, ["operator_done", "force"])
        run |= WAY
        asked = await ask(client, job, run, status=409)
        assert "tool 2" in asked["detail"]
        run["operator_done"] = True
        edited = await ask(client, job, run | {"blocks": ["G90", "G41 D1"]}, status=409)
        assert "Block 2 of the edited plan" in edited["detail"]
        assert (await ask(client, job, run | {"line": 900}, status=422))["code"] == "invalid_request"
        assert (await ask(client, job, {"line": 900}, status=422))["code"] == "invalid_request"
        assert (await ask(client, job, {"action": "continue"}, status=409))["code"] == "wrong_state"
        stood = len(bench.executed())
        blocks = [step["text"] for step in plan["steps"] if step["text"]]
        slower = [block.replace("F200", "F77") for block in blocks]
        await ask(client, job, run | {"line": 30, "blocks": slower})
        await bench.status(job, "completed")
        plunge, *rest = cuts(bench, stood)
        assert plunge[-1] == 77.0
        assert rest == wanted(30)

    told(tmp_path, story)


def test_a_line_that_cannot_be_taken_up_has_a_reason(tmp_path: Path) -> None:
    text = "G21 G91\n" + "G1 X0.5 F1200\n" * 100 + "M30\n"

    async def story(bench: GrblBench, client: httpx.AsyncClient, router: Controller) -> None:
        job = await interrupted(bench, router, text)
        # Where a program in G91 began is known: the controller was asked.
        plan = await ask(client, job, {"line": 50, **WAY})
        assert plan["place"] == {"x": 24.0, "y": 0.0, "z": 0.0}
        refused = await ask(client, job, {"action": "from_line", "line": 102, "force": True, **WAY})
        assert refused["status"] == "running"
        await bench.status(job, "completed")

    told(tmp_path, story)


def test_a_new_job_may_begin_in_the_middle(tmp_path: Path) -> None:
    async def story(bench: GrblBench, client: httpx.AsyncClient, _router: Controller) -> None:
        job = await bench.job(PROGRAM, start_line=60)
        await bench.status(job["id"], "completed")
        _, *rest = cuts(bench, 0)
        assert rest == wanted(60)

    told(tmp_path, story, reentry={"clearance": 15.0})


def test_a_new_job_in_the_middle_without_a_clearance_is_no_job(tmp_path: Path) -> None:
    async def story(bench: GrblBench, client: httpx.AsyncClient, _router: Controller) -> None:
        program = (await client.post("/api/v1/programs?name=part.nc", content=PROGRAM)).json()["id"]
        body = {"program": program, "machine": MACHINE, "force": True, "start_line": 60}
        answer = await client.post("/api/v1/jobs", json=body)
        assert (answer.status_code, answer.json()["code"]) == (422, "invalid_request")
        assert "[machine.reentry]" in answer.json()["detail"]
        assert (await client.get("/api/v1/jobs")).json() == []
        assert bench.executed() == []

    told(tmp_path, story)


def test_a_new_job_in_the_middle_that_cannot_be_planned_fails_before_anything_moves(tmp_path: Path) -> None:
    async def story(bench: GrblBench, client: httpx.AsyncClient, _router: Controller) -> None:
        # Where the machine would stand behind the lines before, nobody can know.
        job = await bench.job("G91\nG1 X1 F600\nG1 X1\nM30\n", start_line=3)
        view = await bench.status(job["id"], "failed")
        assert view["error"]["code"] == "not_plannable"
        assert "Start at a line" in view["error"]["message"]
        assert bench.executed() == []

    told(tmp_path, story, reentry={"clearance": 15.0})


@pytest.mark.parametrize("reset", [False, True])
def test_a_reset_shows_in_what_the_controller_holds(tmp_path: Path, reset: bool) -> None:
    """What `continue` hangs on where no line is in doubt."""

    async def story(bench: GrblBench, client: httpx.AsyncClient, router: Controller) -> None:
        job = await interrupted(bench, router)
        if reset:
            assert (await client.post(f"{ROUTER}/reset")).status_code == 202
            await asyncio.sleep(2)
        assert bench.shop is not None
        jobs = bench.shop.jobs
        against = await TakingUp(jobs.db, jobs._starter).against(router, await jobs.row(job))
        assert (against is None) == (not reset)

    told(tmp_path, story)


def test_where_everything_is_proven_it_goes_on_as_if_nothing_had_been(tmp_path: Path) -> None:
    """Somebody knows that all that was inside was executed, as it was here: no plan, no line twice."""

    async def story(bench: GrblBench, client: httpx.AsyncClient, router: Controller) -> None:
        job = await interrupted(bench, router)
        assert bench.shop is not None
        ran = len(bench.executed())

        place = json.dumps(dict(router.program_position))

        def prove(db: Any) -> None:
            db.execute(
                "update batches set status = 'ok', \"end\" = ? where job = ? and line_from <= ?", [place, job, ran]
            )
            columns = "line_done = ?, error_line_from = null, error_line_to = null"
            db.execute(f"update jobs set {columns} where id = ?", [ran, job])

        await bench.shop.db.run(prove)
        plan = await ask(client, job)
        assert (plan["can_continue"], plan["why_not"], plan["certain_line"]) == (True, None, ran)
        await router.run_blocks(["G0 X11"])
        moved = await ask(client, job, {"action": "continue"}, status=409)
        assert "moved" in moved["detail"]
        expected = plan["position_expected"]
        await router.run_blocks([f"G0 X{expected['x']:g} Y{expected['y']:g}"])
        changed = await ask(client, job, {"action": "continue"}, status=409)
        assert "reset" in changed["detail"], "the program stands in G1"
        await router.run_blocks(["G1 F1200"])
        before = len(bench.machine.executed)
        await ask(client, job, {"action": "continue"})
        await bench.status(job, "completed")
        assert cuts(bench, before) == wanted(ran + 1)

    told(tmp_path, story)


def test_a_plan_that_is_broken_off_itself_is_made_anew_for_the_same_line(tmp_path: Path) -> None:
    async def story(bench: GrblBench, client: httpx.AsyncClient, router: Controller) -> None:
        job = await interrupted(bench, router)
        line = (await ask(client, job, WAY))["next_line"]
        slow = {"action": "from_line", "force": True, **WAY, "spindle_wait": 30.0}
        await ask(client, job, slow)
        await asyncio.sleep(10)
        bench.cable.pull()
        await bench.status(job, "interrupted")
        await bench.cable.live_alone(60.0)
        bench.cable.plugged = True
        await until(lambda: router.link_status == "connected" and router.state.status == "idle", within_s=60)
        plan = await ask(client, job, WAY)
        assert (plan["certain_line"], plan["next_line"]) == (line - 1, line)
        before = len(bench.machine.executed)
        await ask(client, job, {"action": "from_line", "force": True, **WAY})
        await bench.status(job, "completed")
        _, *rest = cuts(bench, before)
        assert rest == wanted(line)

    told(tmp_path, story)
