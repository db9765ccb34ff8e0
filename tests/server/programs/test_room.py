"""Room for programs: what is kept free for the journal, and how much they may take in all."""

from collections import namedtuple
from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from server.config.limits import LimitsConfig
from server.problems import ProblemError
from server.programs import room
from server.programs.room import Room
from tests.harness.simloop import run_simulated
from tests.harness.workshop import Bench, one_chunk

Usage = namedtuple("Usage", "total used free")


def test_what_is_kept_for_the_journal_is_not_for_uploads(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    one = Room(tmp_path, LimitsConfig(disk_reserve_bytes=1000))
    monkeypatch.setattr("shutil.disk_usage", lambda _folder: Usage(9000, 8000, 1000))
    one.check_disk()
    monkeypatch.setattr("shutil.disk_usage", lambda _folder: Usage(9000, 8001, 999))
    with pytest.raises(ProblemError) as refused:
        one.check_disk()
    assert refused.value.code == "disk_full"
    assert "limits.disk_reserve_bytes" in refused.value.detail


def test_all_programs_together(tmp_path: Path) -> None:
    Room(tmp_path, LimitsConfig()).check_total(10**15, 10**15)
    one = Room(tmp_path, LimitsConfig(programs_bytes=100))
    one.check_total(50, 50)
    with pytest.raises(ProblemError) as refused:
        one.check_total(50, 51)
    assert refused.value.code == "programs_full"


async def pieces(size: int, count: int) -> AsyncIterator[bytes]:
    for _ in range(count):
        yield b"G1 X1 (filling)\n" * (size // 16)


def test_an_upload_ends_where_the_room_does_and_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("server.programs.service.LOOK_EVERY_BYTES", 4096)
    free = [10**9]
    monkeypatch.setattr(room.shutil, "disk_usage", lambda _folder: Usage(10**9, 0, free[0]))

    async def main() -> None:
        bench = Bench(tmp_path)
        shop = await bench.start()
        programs = shop.programs
        programs._room = Room(tmp_path, LimitsConfig(programs_bytes=10_000))
        await programs.store(one_chunk(b"G0 X0\n" * 100), "small.nc")
        with pytest.raises(ProblemError) as refused:
            await programs.store(pieces(1024, 20), "large.nc")
        assert refused.value.code == "programs_full"
        programs._room = Room(tmp_path, LimitsConfig(programs_bytes=600))
        _, created = await programs.store(one_chunk(b"G0 X0\n" * 100), "the same.nc")
        assert not created, "what is there already takes no room"
        for size in (1, 100, 101):  # as large as one that is there, or larger: refused at its end, or on the way
            with pytest.raises(ProblemError) as refused:
                await programs.store(one_chunk(b"G0 X1\n" * size), "another.nc")
            assert refused.value.code == "programs_full"
        programs._room = Room(tmp_path, LimitsConfig())

        async def while_the_disk_fills() -> AsyncIterator[bytes]:
            async for piece in pieces(1024, 20):
                free[0] -= 10**8
                yield piece

        with pytest.raises(ProblemError) as refused:
            await programs.store(while_the_disk_fills(), "large.nc")
        assert refused.value.code == "disk_full"
        assert [one["name"] for one in await programs.list()] == ["small.nc"]
        assert len([file for file in (tmp_path / "programs").rglob("*") if file.suffix == ".nc"]) == 1
        await shop.stop()

    run_simulated(main())
