"""Making a job of a program that has to be read first: who waits, who goes away, and what happens meanwhile."""

import asyncio
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import pytest
from starlette.requests import ClientDisconnect

from jobs import store
from server.background.childworker import ChildEndedError
from server.background.worker import InlineWorker
from server.problems import ProblemError
from tests.harness.apps import create_app
from tests.harness.simloop import run_simulated
from tests.harness.workshop import MACHINE, Bench, one_chunk

PROGRAM = b"G90\nG1 X1 F600\nG1 X2\nM30\n"
EXPANDED = b"G90\n#1=3\nG1 X#1 F600\nM30\n"
LONG = "G90\n" + "".join(f"G1 X{at % 50} F600\n" for at in range(200)) + "M30\n"
READ_S = 20.0


class Slow(InlineWorker):
    """Reads a program for so long, and counts how often."""

    def __init__(self) -> None:
        self.runs = 0

    async def run(self, fn: Callable[..., Any], *args: Any, **kwargs: Any) -> Any:
        self.runs += 1
        await asyncio.sleep(READ_S)
        return fn(*args, **kwargs)


class Killed(InlineWorker):
    async def run(self, fn: Callable[..., Any], *args: Any, **kwargs: Any) -> Any:
        raise ChildEndedError("the process for checks ended with -9 before its answer")


def told(folder: Path, story: Callable[[Bench, str], Awaitable[None]], *, program: bytes = PROGRAM) -> None:
    async def main() -> None:
        bench = Bench(folder)
        shop = await bench.connected()
        shop.programs._checks = Slow()
        stored, _ = await shop.programs.store(one_chunk(program), "part.nc")
        await story(bench, stored["id"])
        await shop.stop()

    run_simulated(main())


async def refusal(work: Awaitable[Any]) -> ProblemError:
    with pytest.raises(ProblemError) as refused:
        await work
    return refused.value


def test_who_asks_twice_waits_for_one_check_and_has_one_job(tmp_path: Path) -> None:
    async def story(bench: Bench, program: str) -> None:
        jobs, slow = bench.shop.jobs, bench.shop.programs._checks  # type: ignore[union-attr]
        first = asyncio.ensure_future(jobs.create(program, MACHINE, idempotency_key="k", hold=True, force=True))
        await asyncio.sleep(READ_S / 2)
        began = asyncio.get_running_loop().time()
        again = await jobs.create(program, MACHINE, idempotency_key="k", hold=True, force=True)
        assert asyncio.get_running_loop().time() - began < READ_S * 0.6
        assert (await first)["id"] == again["id"]
        assert slow.runs == 1
        assert len(await jobs.list(None, None, 10, None)) == 1

    told(tmp_path, story)


def test_a_client_that_goes_away_has_no_job_and_finds_the_check_done_when_it_comes_again(tmp_path: Path) -> None:
    async def story(bench: Bench, program: str) -> None:
        app, shop = create_app(bench.shop), bench.shop
        body = b'{"program": "%s", "machine": "router", "force": true}' % program.encode()

        async def post(stays_s: float) -> list[int]:
            loop = asyncio.get_running_loop()
            gone_at, said, answers = loop.time() + stays_s, [False], []

            async def receive() -> dict[str, Any]:
                if not said[0]:
                    said[0] = True
                    return {"type": "http.request", "body": body, "more_body": False}
                if loop.time() < gone_at:
                    await asyncio.sleep(gone_at - loop.time())
                return {"type": "http.disconnect"}

            async def send(message: Any) -> None:
                answers.extend([message["status"]] if message["type"] == "http.response.start" else [])

            headers = [(b"host", b"127.0.0.1:8420"), (b"content-type", b"application/json")]
            scope = {"type": "http", "method": "POST", "path": "/api/v1/jobs", "raw_path": b"/api/v1/jobs"}
            scope |= {"query_string": b"", "headers": headers, "client": ("127.0.0.1", 5), "scheme": "http"}
            await app({**scope, "http_version": "1.1", "server": ("127.0.0.1", 8420)}, receive, send)
            return answers

        assert await post(READ_S / 2) == []
        assert await shop.jobs.list(None, None, 10, None) == []  # type: ignore[union-attr]
        assert await post(READ_S / 2) == [201]
        assert shop.programs._checks.runs == 1  # type: ignore[union-attr]

    told(tmp_path, story)


def test_nobody_waits_for_the_check_any_more_and_it_fails(tmp_path: Path) -> None:
    async def story(bench: Bench, program: str) -> None:
        making = asyncio.ensure_future(bench.shop.jobs.create(program, MACHINE))  # type: ignore[union-attr]
        await asyncio.sleep(1)
        making.cancel()
        (bench.folder / "programs" / f"{program}.nc").unlink()
        await asyncio.sleep(READ_S + 1)
        assert bench.shop.programs._checking == {}  # type: ignore[union-attr]

    told(tmp_path, story)


def test_no_job_where_it_is_not_wanted_any_more(tmp_path: Path) -> None:
    async def story(bench: Bench, program: str) -> None:
        async def gone() -> None:
            raise ClientDisconnect

        with pytest.raises(ClientDisconnect):
            await bench.shop.jobs.create(program, MACHINE, force=True, still_wanted=gone)  # type: ignore[union-attr]
        assert await bench.shop.jobs.list(None, None, 10, None) == []  # type: ignore[union-attr]
        await bench.shop.programs.delete(program)  # type: ignore[union-attr]

    told(tmp_path, story)


@pytest.mark.parametrize("text", [PROGRAM, EXPANDED])
def test_a_program_is_not_deleted_while_a_job_is_made_of_it(tmp_path: Path, text: bytes) -> None:
    async def story(bench: Bench, program: str) -> None:
        shop = bench.shop
        assert shop is not None
        making = asyncio.ensure_future(shop.jobs.create(program, MACHINE, hold=True, force=True))
        for _ in range(4):
            await asyncio.sleep(READ_S / 3)
            ids = [program, *(row["id"] for row in await shop.programs.list())]
            for one in ids:
                assert (await refusal(shop.programs.delete(one))).code == "program_in_use"
        job = await making
        assert (await refusal(shop.programs.delete(program))).code == "program_in_use"
        await shop.jobs.cancel(job["id"])
        await shop.programs.delete(program)

    told(tmp_path, story, program=text)


def test_a_process_that_is_killed_is_a_refusal_with_a_code(tmp_path: Path) -> None:
    async def story(bench: Bench, program: str) -> None:
        shop = bench.shop
        assert shop is not None
        shop.programs._checks = Killed()
        refused = await refusal(shop.jobs.create(program, MACHINE))
        assert (refused.code, refused.status) == ("process_ended", 503)
        assert "-9" in refused.detail
        assert (await refusal(shop.programs.check(program, machine=MACHINE))).code == "process_ended"
        await shop.programs.delete(program)

    told(tmp_path, story)


def test_what_waits_on_hold_says_why(tmp_path: Path) -> None:
    async def main() -> None:
        bench = Bench(tmp_path)
        shop = await bench.start()
        assert shop.machines[MACHINE].link_status == "connecting"
        early = await bench.job(PROGRAM.decode())
        assert (early["status"], early["hold"]) == ("queued", True)
        assert early["hold_reason"]["code"] == "not_connected"
        assert "router is connecting" in early["hold_reason"]["message"]
        await bench.connected()
        asked = await bench.job(PROGRAM.decode(), hold=True)
        assert asked["hold_reason"]["code"] == "asked"
        assert await _whys(bench) == ["not_connected", "asked"]
        runs = await bench.job(PROGRAM.decode())
        assert (runs["status"], runs["hold_reason"]) == ("running", None)
        behind = await bench.job(PROGRAM.decode())
        assert (behind["hold"], behind["hold_reason"]) == (False, None)
        await shop.jobs.cancel(runs["id"])
        await bench.status(runs["id"], "cancelled")
        assert (await shop.jobs.get(behind["id"]))["hold_reason"]["code"] == "job_ended"
        assert await _whys(bench) == ["not_connected", "asked", "job_ended"], "the first reason stays"
        await shop.jobs.resume(behind["id"])
        await bench.status(behind["id"], "completed")
        assert (await shop.jobs.get(behind["id"]))["hold_reason"] is None
        for id in (early["id"], asked["id"]):
            await shop.jobs.cancel(id)
        waits = await bench.job(LONG)
        last = await bench.job(PROGRAM.decode())
        assert last["hold_reason"] is None
        await shop.jobs.pause(last["id"])
        assert (await shop.jobs.get(last["id"]))["hold_reason"]["code"] == "asked"
        await shop.stop()
        assert waits["status"] == "running"

    run_simulated(main())


async def _whys(bench: Bench) -> list[str]:
    assert bench.shop is not None
    return [one["hold_reason"]["code"] for one in await bench.shop.jobs.queue(MACHINE)]


def test_after_a_restart_the_queue_says_so(tmp_path: Path) -> None:
    async def main() -> None:
        bench = Bench(tmp_path)
        await bench.connected()
        await bench.job(LONG)
        ready = await bench.job(PROGRAM.decode())
        await bench.shop.jobs.cancel(1)  # type: ignore[union-attr]
        await bench.status(1, "cancelled")
        await bench.shop.db.run(store.hold_waiting, ready["id"], False)  # type: ignore[union-attr]
        bench.crash()
        await bench.start()
        assert await _whys(bench) == ["restarted"]
        await bench.shop.stop()  # type: ignore[union-attr]

    run_simulated(main())


def test_who_queues_a_job_is_not_kept_waiting_while_it_is_planned(tmp_path: Path) -> None:
    async def story(bench: Bench, program: str) -> None:
        shop = bench.shop
        assert shop is not None
        await shop.programs.check(program, machine=MACHINE)
        shop.jobs._starter.worker = Slow()
        began = asyncio.get_running_loop().time()
        job = await shop.jobs.create(program, MACHINE, force=True)
        assert job["status"] == "checking"
        assert asyncio.get_running_loop().time() - began < READ_S / 2
        await bench.status(job["id"], "completed")

    told(tmp_path, story)
