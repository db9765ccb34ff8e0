"""The whole daemon over HTTP and WebSocket, with a virtual machine, in simulated time.

What the services really answer is compared here with the models that the OpenAPI document shows.
"""

import asyncio
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import httpx
import pytest
from pydantic import BaseModel

from server.api import machinemodels, models
from sim.elvinto.settings import SimSettings
from tests.harness.apps import create_app
from tests.harness.asgisocket import AsgiSocket
from tests.harness.simloop import run_simulated
from tests.harness.workshop import Bench

BASE_URL = "http://127.0.0.1:8420"
ROUTER = "/api/v1/machines/router"
PROGRAM = "G21 G90\n" + "".join(f"G1 X{i % 20} Y{i % 7} F3000\n" for i in range(1, 200)) + "M30\n"

Story = Callable[[Bench, httpx.AsyncClient], Awaitable[None]]


def told(folder: Path, story: Story, **settings: Any) -> None:
    """Run a story against a daemon whose machine is connected."""

    async def main() -> None:
        bench = Bench(folder, SimSettings(**settings))
        shop = await bench.connected()
        transport = httpx.ASGITransport(create_app(shop))
        async with httpx.AsyncClient(transport=transport, base_url=BASE_URL) as client:
            await story(bench, client)
        await shop.stop()

    run_simulated(main())


async def get(client: httpx.AsyncClient, path: str) -> Any:
    answer = await client.get(path)
    assert answer.status_code == 200, answer.text
    return answer.json()


async def upload(client: httpx.AsyncClient, text: str = PROGRAM, name: str = "part.nc") -> str:
    answer = await client.post(f"/api/v1/programs?name={name}", content=text.encode())
    assert answer.status_code == 201, answer.text
    program = models.ProgramView.model_validate(answer.json())
    assert program.bytes == len(text)
    return program.id


async def queue(client: httpx.AsyncClient, program: str, **options: Any) -> Any:
    body = {"program": program, "machine": "router", "force": True, **options}
    answer = await client.post("/api/v1/jobs", json=body)
    assert answer.status_code == 201, answer.text
    return answer.json()


async def ended(client: httpx.AsyncClient, job: int) -> Any:
    for _ in range(10_000):
        view = await get(client, f"/api/v1/jobs/{job}")
        if view["status"] in ("completed", "failed", "cancelled", "interrupted"):
            return view
        await asyncio.sleep(0.1)
    raise AssertionError("the job does not end")


def exactly(model: type[BaseModel], value: Any) -> None:
    """What a service answers fits its model, and the model leaves nothing of it out that it does not say."""
    items = value if isinstance(value, list) else [value]
    assert items, f"nothing to compare with {model.__name__}"
    for item in items:
        model.model_validate(item, strict=True)


def test_from_the_upload_to_the_last_block(tmp_path: Path) -> None:
    async def story(bench: Bench, client: httpx.AsyncClient) -> None:
        program = await upload(client)
        job = await queue(client, program)
        exactly(models.JobView, job)
        done = await ended(client, job["id"])
        assert (done["status"], done["progress"]["line"], done["error"]) == ("completed", 201, None)
        moves = [block for block in bench.executed() if block.startswith(("G1", "X", "Y"))]
        assert len(moves) >= 190
        exactly(models.JobView, done)
        exactly(models.JobView, await get(client, "/api/v1/jobs?machine=router&status=completed,failed"))
        exactly(models.BatchView, await get(client, f"/api/v1/jobs/{job['id']}/batches"))
        exactly(models.JobEventView, await get(client, f"/api/v1/jobs/{job['id']}/events"))
        exactly(models.JobReportView, await get(client, f"/api/v1/jobs/{job['id']}/report"))
        again = (await client.post(f"/api/v1/jobs/{job['id']}/rerun")).json()
        assert (await ended(client, again["id"]))["status"] == "completed"

    told(tmp_path, story, instant=True)


def test_everything_that_can_be_read_fits_its_model(tmp_path: Path) -> None:
    async def story(_bench: Bench, client: httpx.AsyncClient) -> None:
        program = await upload(client)
        exactly(machinemodels.MachineView, await get(client, "/api/v1/machines"))
        exactly(machinemodels.MachineView, await get(client, ROUTER))
        exactly(machinemodels.StateView, await get(client, f"{ROUTER}/state"))
        exactly(machinemodels.ConsoleLine, await get(client, f"{ROUTER}/console"))
        exactly(machinemodels.FilesView, await get(client, f"{ROUTER}/sd"))
        exactly(models.ProgramView, await get(client, "/api/v1/programs"))
        exactly(models.SourceView, await get(client, f"/api/v1/programs/{program}/source?from=2&to=4"))
        exactly(models.CheckView, await get(client, f"/api/v1/programs/{program}/check?machine=router"))
        exactly(models.CheckView, await get(client, f"/api/v1/programs/{program}/check?profile=elvinto"))
        assert b"millstream_connected" in (await client.get("/metrics")).content

    told(tmp_path, story, sd_files={"part1.nc": b"G0 X1\n"})


def test_the_same_content_has_the_same_id(tmp_path: Path) -> None:
    async def story(_bench: Bench, client: httpx.AsyncClient) -> None:
        first = await upload(client)
        assert await upload(client, name="other.nc") == first
        files = {"file": ("form.nc", PROGRAM.encode())}
        assert (await client.post("/api/v1/programs", files=files)).json()["id"] == first
        assert (await client.delete(f"/api/v1/programs/{first}")).status_code == 204
        assert (await client.get(f"/api/v1/programs/{first}")).json()["code"] == "unknown_program"

    told(tmp_path, story, instant=True)


@pytest.mark.parametrize(
    ("content", "status", "code"),
    [(b"\x00\x01\x02" * 100, 422, "not_a_program"), (b"", 422, "empty_program")],
)
def test_uploads_that_are_refused(tmp_path: Path, content: bytes, status: int, code: str) -> None:
    async def story(_bench: Bench, client: httpx.AsyncClient) -> None:
        answer = await client.post("/api/v1/programs?name=part.nc", content=content)
        assert (answer.status_code, answer.json()["code"]) == (status, code)
        assert await get(client, "/api/v1/programs") == []

    told(tmp_path, story, instant=True)


def test_a_broken_form_leaves_nothing_behind(tmp_path: Path) -> None:
    async def story(_bench: Bench, client: httpx.AsyncClient) -> None:
        body = b'--x\r\nContent-Disposition: form-data; name="file"; filename="a.nc"\r\n\r\nG0 X1\n'
        headers = {"content-type": "multipart/form-data; boundary=x"}
        answer = await client.post("/api/v1/programs", content=body, headers=headers)
        assert (answer.status_code, answer.json()["code"]) == (422, "invalid_request")
        assert await get(client, "/api/v1/programs") == []
        assert [path for path in (tmp_path / "programs").rglob("*") if path.is_file()] == []

    told(tmp_path, story, instant=True)


def test_a_program_that_fails_the_check_is_refused_with_the_report(tmp_path: Path) -> None:
    async def story(_bench: Bench, client: httpx.AsyncClient) -> None:
        program = await upload(client, "G20\nG1 X1 F100\nM30\n")
        body = {"program": program, "machine": "router", "force": True}
        answer = await client.post("/api/v1/jobs", json=body)
        assert (answer.status_code, answer.json()["code"]) == (422, "preflight_failed")
        exactly(models.CheckView, answer.json()["report"])
        assert await get(client, "/api/v1/jobs") == []

    told(tmp_path, story, instant=True)


def test_a_repeat_under_the_same_key_is_harmless(tmp_path: Path) -> None:
    async def story(_bench: Bench, client: httpx.AsyncClient) -> None:
        body = {"program": await upload(client), "machine": "router", "force": True, "hold": True}
        headers = {"Idempotency-Key": "k1"}
        first = await client.post("/api/v1/jobs", json=body, headers=headers)
        second = await client.post("/api/v1/jobs", json=body, headers=headers)
        assert (first.status_code, second.status_code) == (201, 201)
        assert first.json()["id"] == second.json()["id"]
        other = await client.post("/api/v1/jobs", json={**body, "note": "different"}, headers=headers)
        assert (other.status_code, other.json()["code"]) == (409, "idempotency_conflict")

    told(tmp_path, story, instant=True)


def test_by_hand(tmp_path: Path) -> None:
    async def story(bench: Bench, client: httpx.AsyncClient) -> None:
        answer = await client.post(f"{ROUTER}/commands", json={"blocks": ["G90", "G1 X5 F600"]})
        exactly(machinemodels.CommandsResult, answer.json())
        assert [result["ok"] for result in answer.json()["results"]] == [True, True]
        assert (await client.post(f"{ROUTER}/jog", json={"x": -1, "feed": 600})).status_code == 202
        await asyncio.sleep(5)
        assert bench.machine.position["X"] == pytest.approx(4.0)
        assert (await client.post(f"{ROUTER}/home")).status_code == 202
        await asyncio.sleep(60)
        assert (await get(client, f"{ROUTER}/state"))["position"]["machine"]["x"] == pytest.approx(0.0)

    told(tmp_path, story)


def test_what_is_not_possible_now_says_so(tmp_path: Path) -> None:
    async def story(_bench: Bench, client: httpx.AsyncClient) -> None:
        for path in ("pause", "resume", "stop", "tool/confirm"):
            answer = await client.post(f"{ROUTER}/{path}")
            assert (answer.status_code, answer.json()["code"]) == (409, "wrong_state")
        job = await queue(client, await upload(client))
        for path, body in (("commands", {"blocks": ["G0 X1"]}), ("jog", {"x": 1, "feed": 100}), ("home", None)):
            answer = await client.post(f"{ROUTER}/{path}", json=body)
            assert (answer.status_code, answer.json()["code"]) == (409, "job_active")
        assert (await client.post(f"/api/v1/jobs/{job['id']}/recover")).json()["code"] == "wrong_state"
        assert (await client.post(f"/api/v1/jobs/{job['id']}/cancel")).status_code == 202
        assert (await ended(client, job["id"]))["status"] == "cancelled"
        assert (await client.post(f"/api/v1/jobs/{job['id']}/resume")).json()["code"] == "wrong_state"
        assert (await client.get("/api/v1/jobs/999")).json()["code"] == "unknown_job"
        assert (await client.get("/api/v1/jobs?status=nonsense")).json()["code"] == "invalid_request"

    told(tmp_path, story)


def test_the_websocket_tells_a_job_from_its_beginning_to_its_end(tmp_path: Path) -> None:
    async def story(bench: Bench, client: httpx.AsyncClient) -> None:
        shop = bench.shop
        assert shop is not None
        async with AsgiSocket(create_app(shop), query={"topics": "state,job"}) as socket:
            exactly(machinemodels.MachineView, (await socket.hear())["data"]["machines"])
            job = await queue(client, await upload(client))
            statuses: list[str] = []
            lines: list[int] = []
            states = 0
            while "completed" not in statuses:
                message = await socket.hear(within_s=60)
                if message["type"] == "state":
                    exactly(machinemodels.StateView, message["data"])
                    states += 1
                    continue
                exactly(models.JobView, message["data"])
                assert message["data"]["id"] == job["id"]
                lines.append(message["data"]["progress"]["line"])
                if message["data"]["status"] not in statuses[-1:]:
                    statuses.append(message["data"]["status"])
            assert statuses == ["queued", "checking", "running", "completed"]
            assert lines == sorted(lines)
            assert lines[-1] == 201
            assert states > 3

    told(tmp_path, story)


def test_pause_and_estop_over_the_websocket(tmp_path: Path) -> None:
    async def story(bench: Bench, client: httpx.AsyncClient) -> None:
        shop = bench.shop
        assert shop is not None
        job = await queue(client, await upload(client))
        await asyncio.sleep(2)
        async with AsgiSocket(create_app(shop), query={"topics": "job"}) as socket:
            await socket.hear()
            assert (await socket.ask({"type": "pause", "id": 1}))["ok"]
            await asyncio.sleep(3)
            executed = bench.executed()
            await asyncio.sleep(30)
            assert bench.executed() == executed, "paused within a batch"
            assert (await socket.ask({"type": "resume", "machine": "router"}))["ok"]
            await asyncio.sleep(1)
            assert (await socket.ask({"type": "estop"}))["ok"]
            failed = await ended(client, job["id"])
            assert failed["status"] == "failed"
            exactly(models.JobErrorView, failed["error"])
            assert (await get(client, f"{ROUTER}/state"))["status"] == "alarm"

    told(tmp_path, story)


def test_a_held_jog_moves_while_it_is_held_and_not_much_longer(tmp_path: Path) -> None:
    async def story(bench: Bench, _client: httpx.AsyncClient) -> None:
        shop = bench.shop
        assert shop is not None
        async with AsgiSocket(create_app(shop), query={"topics": "log"}) as socket:
            await socket.hear()
            for _ in range(20):
                held = {"type": "jog", "machine": "router", "x": 1, "feed": 600, "hold": True}
                assert (await socket.ask(held))["ok"]
                await asyncio.sleep(0.1)
            at_let_go = bench.machine.position["X"]
            assert at_let_go > 5.0, "two seconds at 10 mm/s, less what the wire and the ramps take"
            await asyncio.sleep(30)
            # 0.2 s of heartbeat, the step that had begun, and one that was with the machine already.
            assert bench.machine.position["X"] - at_let_go <= 600 / 60 * 0.6
            assert bench.machine.status == "idle"

    told(tmp_path, story)


def test_a_reader_that_does_not_read_changes_nothing_for_the_job(tmp_path: Path) -> None:
    async def story(bench: Bench, client: httpx.AsyncClient) -> None:
        shop = bench.shop
        assert shop is not None

        async def run_time_s() -> float:
            program = await upload(client)
            begin = asyncio.get_running_loop().time()
            assert (await ended(client, (await queue(client, program))["id"]))["status"] == "completed"
            return asyncio.get_running_loop().time() - begin

        alone = await run_time_s()
        async with AsgiSocket(create_app(shop)) as stuck:
            await stuck.hear()
            stuck.reading.clear()
            assert await run_time_s() == pytest.approx(alone, rel=0.05)

    told(tmp_path, story)
