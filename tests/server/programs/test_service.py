"""Programs for the API: uploads that are whole or nothing, source, check, and what is refused."""

import asyncio
import errno
import sqlite3
from collections.abc import AsyncIterator, Awaitable, Callable
from pathlib import Path
from typing import Any

import pytest

from jobs import store
from jobs.program import Writer
from server.app import Workshop
from server.background.worker import InlineWorker
from server.problems import ProblemError
from server.programs.service import SOURCE_LINES, UPLOAD_AHEAD_S, UPLOAD_BYTES_S
from tests.harness.simloop import run_simulated
from tests.harness.toolpathreader import read_toolpath
from tests.harness.workshop import MACHINE, Bench

GOOD = b"G90\nG1 X1 F100\nM30\n"


async def chunks(*data: bytes) -> AsyncIterator[bytes]:
    for chunk in data:
        yield chunk


def told(folder: Path, story: Callable[[Workshop], Awaitable[None]]) -> None:
    async def main() -> None:
        bench = Bench(folder)
        shop = await bench.start()
        await story(shop)
        await shop.stop()

    run_simulated(main())


def files(folder: Path) -> list[str]:
    return sorted(path.name for path in (folder / "programs").iterdir())


async def refusal(work: Awaitable[Any]) -> ProblemError:
    with pytest.raises(ProblemError) as refused:
        await work
    return refused.value


def test_an_upload_in_pieces_is_one_program_and_the_same_again_is_not_new(tmp_path: Path) -> None:
    async def story(shop: Workshop) -> None:
        program, created = await shop.programs.store(chunks(GOOD[:5], GOOD[5:]), "a.nc")
        assert (program["lines"], program["bytes"], created) == (3, len(GOOD), True)
        again, created = await shop.programs.store(chunks(GOOD), "b.nc")
        assert (again["id"], again["name"], created) == (program["id"], "a.nc", False)
        assert [row["id"] for row in await shop.programs.list()] == [program["id"]]
        assert await shop.programs.get(program["id"]) == program

    told(tmp_path, story)


def test_uploads_leave_the_loop_to_the_others_at_times(tmp_path: Path) -> None:
    """Simulated time: what is not waited for on purpose takes none."""
    piece = b"G1 X1.000 Y2.000\n" * 20_000

    async def story(shop: Workshop) -> None:
        loop = asyncio.get_running_loop()
        await asyncio.sleep(100.0)
        began = loop.time()
        await asyncio.gather(*(shop.programs.store(chunks(*[piece] * count), "a.nc") for count in (10, 20)))
        assert loop.time() - began == pytest.approx(30 * len(piece) / UPLOAD_BYTES_S - UPLOAD_AHEAD_S)
        began = loop.time()
        await shop.programs.store(chunks(GOOD), "b.nc")
        assert loop.time() - began < 1e-6, "a small one waits for nobody"

    told(tmp_path, story)


@pytest.mark.parametrize(
    ("data", "code"),
    [((b"\x7fELF\x00\x01",), "not_a_program"), ((), "empty_program"), ((b"G0 X1\n" * 1000,) * 3, "too_large")],
)
def test_what_is_refused_leaves_nothing(tmp_path: Path, data: tuple[bytes, ...], code: str) -> None:
    async def story(shop: Workshop) -> None:
        shop.programs._max_upload_bytes = 10_000
        assert (await refusal(shop.programs.store(chunks(*data), "a.nc"))).code == code
        assert files(tmp_path) == []
        assert await shop.programs.list() == []

    told(tmp_path, story)


@pytest.mark.parametrize("where", ["write", "finish"])
def test_a_full_disk_leaves_nothing(tmp_path: Path, where: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(_writer: Writer, *_data: bytes) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    async def story(shop: Workshop) -> None:
        monkeypatch.setattr(Writer, where, full)
        assert (await refusal(shop.programs.store(chunks(GOOD), "a.nc"))).code == "disk_full"
        assert files(tmp_path) == []

    told(tmp_path, story)


def test_a_row_that_finds_no_room_takes_its_file_with_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: Any) -> None:
        raise sqlite3.OperationalError("database or disk is full")

    async def story(shop: Workshop) -> None:
        kept, _ = await shop.programs.store(chunks(GOOD), "a.nc")
        monkeypatch.setattr(store, "add_program", full)
        assert (await refusal(shop.programs.store(chunks(b"G0 X7\n"), "b.nc"))).code == "disk_full"
        assert (await refusal(shop.programs.store(chunks(GOOD), "a.nc"))).code == "disk_full"
        assert files(tmp_path) == [f"{kept['id']}{suffix}" for suffix in (".idx", ".nc")], "what had its row stays"

    told(tmp_path, story)


def test_a_daemon_that_is_killed_between_file_and_row_leaves_no_program_that_takes_room_unseen(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    async def main() -> None:
        bench = Bench(tmp_path)
        shop = await bench.start()
        kept, _ = await shop.programs.store(chunks(GOOD), "a.nc")
        with shop.programs._programs.writer("b.nc") as writer:
            writer.write(b"G0 X7\n")
            lost = writer.finish().id
        bench.crash()
        shop = await bench.start()
        there = [f"{kept['id']}{suffix}" for suffix in (".idx", ".nc")]
        assert files(tmp_path) == sorted([*there, f"{lost}.nc.unlisted"])
        assert f"{lost}.nc.unlisted" in caplog.text
        again, created = await shop.programs.store(chunks(b"G0 X7\n"), "b.nc")
        assert (again["id"], again["name"], created) == (lost, "b.nc", True)
        await shop.stop()
        shop = await bench.start()
        assert files(tmp_path) == sorted([*there, f"{lost}.idx", f"{lost}.nc"])
        await shop.stop()

    run_simulated(main())


def test_an_upload_that_breaks_off_leaves_nothing(tmp_path: Path) -> None:
    async def broken() -> AsyncIterator[bytes]:
        yield GOOD
        raise ConnectionResetError(errno.ECONNRESET, "gone")

    async def story(shop: Workshop) -> None:
        with pytest.raises(ConnectionResetError):
            await shop.programs.store(broken(), "a.nc")
        assert files(tmp_path) == []

    told(tmp_path, story)


def test_an_upload_that_is_given_up_leaves_nothing(tmp_path: Path) -> None:
    async def endless() -> AsyncIterator[bytes]:
        while True:
            yield b"G0 X1\n"
            await asyncio.sleep(1)

    async def story(shop: Workshop) -> None:
        upload = asyncio.ensure_future(shop.programs.store(endless(), "a.nc"))
        await asyncio.sleep(5)
        assert files(tmp_path) != []
        upload.cancel()
        with pytest.raises(asyncio.CancelledError):
            await upload
        assert files(tmp_path) == []

    told(tmp_path, story)


@pytest.mark.parametrize("late_s", [0.0, 0.05, 0.15, 0.25, 0.35])
def test_what_is_uploaded_again_while_it_is_deleted_has_its_file(tmp_path: Path, late_s: float) -> None:
    class Slow(InlineWorker):
        async def run(self, fn: Any, *args: Any, **kwargs: Any) -> Any:
            await asyncio.sleep(0.1)
            found = fn(*args, **kwargs)
            await asyncio.sleep(0.1)
            return found

    async def story(shop: Workshop) -> None:
        program, _ = await shop.programs.store(chunks(GOOD), "a.nc")
        shop.programs._files = Slow()
        again = asyncio.create_task(shop.programs.store(chunks(GOOD), "a.nc"))
        await asyncio.sleep(0.2 + late_s)
        await shop.programs.delete(program["id"])
        await again
        rows = [row["id"] for row in await shop.programs.list()]
        assert files(tmp_path) == [f"{id}{suffix}" for id in rows for suffix in (".idx", ".nc")]

    told(tmp_path, story)


def test_source_has_numbers_and_bounds(tmp_path: Path) -> None:
    async def story(shop: Workshop) -> None:
        program, _ = await shop.programs.store(chunks(b"G0 X1\n" * (SOURCE_LINES + 100)), "a.nc")
        source = await shop.programs.source(program["id"], 2, 3)
        assert source["lines"] == [{"line": 2, "text": "G0 X1"}, {"line": 3, "text": "G0 X1"}]
        assert len((await shop.programs.source(program["id"], 1, 10**9))["lines"]) == SOURCE_LINES
        assert (await refusal(shop.programs.source("f" * 64, 1, 2))).code == "unknown_program"

    told(tmp_path, story)


def test_the_check_is_made_once_and_forgotten_with_the_program(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    async def story(shop: Workshop) -> None:
        program, _ = await shop.programs.store(chunks(GOOD), "a.nc")
        made: list[Any] = []
        check = shop.programs._planning.check
        monkeypatch.setattr(shop.programs._planning, "check", lambda *args: made.append(args) or check(*args))
        for _ in range(3):
            report = await shop.programs.check(program["id"], machine=MACHINE)
        assert (report["errors"], report["lines"], len(made)) == ([], 3, 1)
        await shop.programs.check(program["id"], profile="elvinto")
        assert len(made) == 2
        await shop.programs.delete(program["id"])
        assert (await refusal(shop.programs.check(program["id"], machine=MACHINE))).code == "unknown_program"

    told(tmp_path, story)


def test_a_check_knows_the_tool_table_of_now(tmp_path: Path) -> None:
    async def story(shop: Workshop) -> None:
        program, _ = await shop.programs.store(chunks(b"G21 G90\nT1 M6\nT2 M6\nM30\n"), "part.nc")

        async def missing() -> list[int]:
            report = await shop.programs.check(program["id"], machine=MACHINE)
            return [one["line"] for one in report["warnings"] if one["code"] == "tool_not_in_table"]

        assert await missing() == []
        for text, lines in (("T1 P1\n", [3]), ("T2 P1\n", [2]), ("", [2, 3]), ("T1 P1\nT2 P2\n", []), (None, [])):
            shop.changers[MACHINE].replace_table(text, None)
            assert await missing() == lines, text
        shop.changers[MACHINE].replace_table("T1 P1\n", None)
        with pytest.raises(ProblemError) as refused:
            await shop.jobs.create(program["id"], MACHINE)
        assert refused.value.code == "preflight_warnings"

    told(tmp_path, story)


def test_the_drawing_of_a_program(tmp_path: Path) -> None:
    async def story(shop: Workshop) -> None:
        program, _ = await shop.programs.store(chunks(b"G21 G90\nG0 X0 Y0 Z5\nG1 X10 F300\nG2 X20 I5\nM30\n"), "a.nc")
        drawing = await shop.programs.toolpath(program["id"])
        assert drawing.etag == (await shop.programs.toolpath(program["id"], machine=MACHINE)).etag
        assert drawing.etag != (await shop.programs.toolpath(program["id"], profile="elvinto", level=1)).etag
        length, pieces = await drawing.open()
        data = b"".join([piece async for piece in pieces])
        assert len(data) == length
        found = read_toolpath(data)
        assert set(found.line) == {2, 3, 4}
        assert found.places[-1][:3] == pytest.approx((20, 0, 5))
        assert found.feed[-1] == 300
        await shop.programs.delete(program["id"])
        assert files(tmp_path) == []
        assert (await refusal(drawing.open())).code == "unknown_program"
        assert (await refusal(shop.programs.toolpath(program["id"]))).code == "unknown_program"

    told(tmp_path, story)


def test_no_drawing_without_room_for_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(_fd: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    async def story(shop: Workshop) -> None:
        program, _ = await shop.programs.store(chunks(GOOD), "a.nc")
        before = files(tmp_path)
        monkeypatch.setattr("os.fsync", full)
        refused = await refusal((await shop.programs.toolpath(program["id"])).open())
        assert (refused.code, "drawing" in refused.detail) == ("disk_full", True)
        assert files(tmp_path) == before

    told(tmp_path, story)


@pytest.mark.parametrize(
    ("against", "code"),
    [({"machine": "nobody"}, "unknown_machine"), ({"profile": "nothing"}, "invalid_request")],
)
def test_a_check_against_what_does_not_exist(tmp_path: Path, against: dict[str, str], code: str) -> None:
    async def story(shop: Workshop) -> None:
        program, _ = await shop.programs.store(chunks(GOOD), "a.nc")
        assert (await refusal(shop.programs.check(program["id"], **against))).code == code
        assert (await refusal(shop.programs.toolpath(program["id"], **against))).code == code

    told(tmp_path, story)


def test_a_program_that_a_job_needs_stays(tmp_path: Path) -> None:
    async def story(shop: Workshop) -> None:
        program, _ = await shop.programs.store(chunks(GOOD), "a.nc")
        job = await shop.jobs.create(program["id"], MACHINE, force=True, hold=True)
        assert (await refusal(shop.programs.delete(program["id"]))).code == "program_in_use"
        await shop.jobs.cancel(job["id"])
        await shop.programs.delete(program["id"])
        assert files(tmp_path) == []
        assert (await refusal(shop.programs.delete(program["id"]))).code == "unknown_program"

    told(tmp_path, story)


def test_a_file_that_somebody_took_away(tmp_path: Path) -> None:
    async def story(shop: Workshop) -> None:
        program, _ = await shop.programs.store(chunks(GOOD), "a.nc")
        (tmp_path / "programs" / f"{program['id']}.nc").unlink()
        assert (await refusal(shop.programs.source(program["id"], 1, 2))).code == "unknown_program"

    told(tmp_path, story)


def test_other_errors_of_the_disk_are_errors_of_the_daemon(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(_writer: Writer, _data: bytes) -> None:
        raise OSError(errno.EIO, "I/O error")

    async def story(shop: Workshop) -> None:
        monkeypatch.setattr(Writer, "write", broken)
        with pytest.raises(OSError, match="I/O error"):
            await shop.programs.store(chunks(GOOD), "a.nc")

    told(tmp_path, story)


def test_the_codes_of_a_machine_are_those_that_its_controller_has(tmp_path: Path) -> None:
    async def story(shop: Workshop) -> None:
        found = {one["code"]: one["text"] for one in shop.programs.codes(MACHINE)}
        assert {"G0", "G1", "G28", "M3", "M30"} <= set(found)
        assert "G20" not in found, "in the table of the profile, but not in the controller"
        assert "Z to the safe plane" in found["G28"]
        with pytest.raises(ProblemError):
            shop.programs.codes("nobody")

    told(tmp_path, story)
