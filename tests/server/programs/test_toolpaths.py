"""Drawings on disk: made once, whole or not at all, gone with their program."""

import asyncio
import errno
import os
from collections.abc import AsyncIterator, Callable, Coroutine, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gcode import toolpath as encoding
from gcode.ncframe.rules import FrameRules
from gcode.profile import Profile, load_profile
from gcode.segments import Segments
from jobs.program import ProgramStore, UnknownProgramError
from server.background.worker import InlineWorker, ThreadWorker
from server.problems import ProblemError
from server.programs import toolpaths as serving
from server.programs.toolpaths import SUFFIX, Reader, Toolpaths
from tests.harness.segmentrows import through
from tests.harness.toolpathreader import read_toolpath

PROFILE = load_profile("elvinto")
AXES = "".join(PROFILE.axes).upper()


def spiral(turns: int = 100) -> Segments:
    angle = np.linspace(0, turns, 5001)
    rest = [np.zeros(5001)] * (len(AXES) - 2)
    return through(np.array([angle * np.cos(angle), angle * np.sin(angle), *rest]), axes=AXES)


class World:
    """A folder with one program, and motion that is said to be its."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.store = ProgramStore(folder)
        with self.store.writer("a.nc") as writer:
            writer.write(b"G1 X1\n")
            self.id = writer.finish().id
        self.made = 0
        self.while_making: Callable[[], None] = lambda: None

    def segments_of(self, program_id: str, profile: Profile, frames: FrameRules | None) -> Iterator[Segments]:
        if program_id not in self.store:
            raise UnknownProgramError(program_id)
        self.made += 1
        whole = spiral()
        yield whole.take(slice(0, 2000))
        self.while_making()
        yield whole.take(slice(2000, 5000))

    def toolpaths(self, worker: Any = None) -> Toolpaths:
        return Toolpaths(self.store, self.segments_of, maker=worker or InlineWorker(), files=InlineWorker())

    def files(self) -> list[str]:
        return sorted(path.name.replace(self.id, "id") for path in self.folder.iterdir())

    def drawings(self) -> int:
        return sum(name.endswith(SUFFIX) for name in self.files())


async def fetched(toolpaths: Toolpaths, program_id: str, level: int = 0) -> bytes:
    length, chunks = await toolpaths.get(program_id, Reader(PROFILE), level).open()
    data = b"".join([chunk async for chunk in chunks])
    assert len(data) == length
    return data


def told(story: Coroutine[Any, Any, None]) -> None:
    asyncio.run(story)


def test_each_level_is_a_file_of_its_own_and_all_are_made_once(tmp_path: Path) -> None:
    async def story() -> None:
        world = World(tmp_path)
        toolpaths = world.toolpaths()
        finest = read_toolpath(await fetched(toolpaths, world.id))
        assert len(finest.line) == 5001
        levels = finest.head["levels"]
        assert len(levels) > 1
        for level, listed in enumerate(levels):
            found = read_toolpath(await fetched(toolpaths, world.id, level))
            assert (found.head["level"], len(found.line)) == (level, listed["vertices"])
        assert await fetched(toolpaths, world.id, 99) == await fetched(toolpaths, world.id, len(levels) - 1)
        assert await fetched(world.toolpaths(), world.id) == await fetched(toolpaths, world.id)
        assert world.made == 1
        assert world.files() == ["id.elvinto." + toolpaths.tag + SUFFIX, "id.idx", "id.nc"]

    told(story())


def test_the_tag_names_program_profile_and_level(tmp_path: Path) -> None:
    world = World(tmp_path)
    toolpaths = world.toolpaths()
    tags = {toolpaths.get(program, Reader(PROFILE), level).etag for program in (world.id, "f" * 64) for level in (0, 1)}
    assert len(tags) == 4
    assert all(tag.startswith('"') and "elvinto" in tag for tag in tags)
    assert world.made == 0


def test_many_who_ask_wait_for_one_making_and_may_go_away(tmp_path: Path) -> None:
    async def story() -> None:
        world = World(tmp_path)
        worker = ThreadWorker("test")
        toolpaths = world.toolpaths(worker)
        asked = [asyncio.ensure_future(fetched(toolpaths, world.id, level % 2)) for level in range(6)]
        while not world.made:
            await asyncio.sleep(0)
        asked.pop(0).cancel()
        answers = await asyncio.gather(*asked)
        assert world.made == 1
        assert len(set(answers)) == 2
        worker.close()

    told(story())


def test_a_disk_that_is_full_leaves_nothing_and_the_next_tries_again(tmp_path: Path) -> None:
    def full() -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    async def story() -> None:
        world = World(tmp_path)
        toolpaths = world.toolpaths()
        world.while_making = full
        with pytest.raises(OSError, match="No space"):
            await fetched(toolpaths, world.id)
        assert world.files() == ["id.idx", "id.nc"]
        world.while_making = lambda: None
        assert len(await fetched(toolpaths, world.id)) > 1000
        assert world.made == 2

    told(story())


def test_a_program_that_is_too_long_is_no_drawing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    async def story() -> None:
        world = World(tmp_path)
        monkeypatch.setattr(encoding, "MAX_VERTICES", 1000)
        with pytest.raises(ProblemError) as refused:
            await fetched(world.toolpaths(), world.id)
        assert refused.value.code == "no_preview"
        assert world.files() == ["id.idx", "id.nc"]

    told(story())


def test_it_goes_with_its_program(tmp_path: Path) -> None:
    async def story() -> None:
        world = World(tmp_path)
        toolpaths = world.toolpaths()
        await fetched(toolpaths, world.id)
        world.store.delete(world.id)
        assert world.files() == []
        with pytest.raises(UnknownProgramError):
            await fetched(toolpaths, world.id)

    told(story())


def test_together_they_have_a_limit_and_the_least_asked_for_goes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def story() -> None:
        world = World(tmp_path)
        ids = [world.id]
        for number in range(3):
            with world.store.writer(f"{number}.nc") as writer:
                writer.write(f"G1 Y{number}\n".encode())
                ids.append(writer.finish().id)
        toolpaths = world.toolpaths()
        paths = [tmp_path / f"{program}.elvinto.{toolpaths.tag}{SUFFIX}" for program in ids]
        for program, path, opened_s in zip(ids[:3], paths, (1000, 2000, 3000), strict=False):
            await fetched(toolpaths, program)
            os.utime(path, (opened_s, opened_s))
        await fetched(toolpaths, ids[0])  # not the oldest any more
        monkeypatch.setattr(serving, "MAX_TOTAL_BYTES", paths[0].stat().st_size * 3 + 10)
        _, chunks = await toolpaths.get(ids[1], Reader(PROFILE), 0).open()
        first = await anext(chunks)
        os.utime(paths[1], (2000, 2000))
        await fetched(toolpaths, ids[3])
        assert [path.exists() for path in paths] == [True, False, True, True]
        assert len(read_toolpath(first + b"".join([chunk async for chunk in chunks])).line) == 5001
        assert world.made == 4
        await fetched(toolpaths, ids[1])
        assert world.made == 5
        monkeypatch.setattr(serving, "MAX_TOTAL_BYTES", 1)
        paths[3].unlink()
        await fetched(toolpaths, ids[3])
        assert [path.exists() for path in paths] == [False, False, False, True], "the newest stays"

    told(story())


def test_a_program_that_goes_while_it_is_drawn_leaves_nothing(tmp_path: Path) -> None:
    async def story() -> None:
        world = World(tmp_path)
        world.while_making = lambda: world.store.delete(world.id)
        with pytest.raises(UnknownProgramError):
            await fetched(world.toolpaths(), world.id)
        assert world.files() == []

    told(story())


def test_who_is_reading_reads_to_the_end(tmp_path: Path) -> None:
    async def story() -> None:
        world = World(tmp_path)
        toolpaths = world.toolpaths()
        whole = await fetched(toolpaths, world.id)
        chunks: AsyncIterator[bytes]
        _, chunks = await toolpaths.get(world.id, Reader(PROFILE), 0).open()
        first = await anext(chunks)
        world.store.delete(world.id)
        assert first + b"".join([chunk async for chunk in chunks]) == whole

    told(story())


def test_what_is_old_or_half_done_is_cleared_away_at_the_start(tmp_path: Path) -> None:
    world = World(tmp_path)
    tag = world.toolpaths().tag
    kept = f"{world.id}.elvinto.{tag}{SUFFIX}"
    for name in (
        kept,
        f"{world.id}.elvinto.00000000{SUFFIX}",
        f"{'e' * 64}.elvinto.{tag}{SUFFIX}",
        f"0123456789abcdef.0{SUFFIX}.part",
    ):
        (tmp_path / name).write_bytes(b"x")
    world.store = ProgramStore(tmp_path)
    world.toolpaths()
    assert world.files() == [kept.replace(world.id, "id"), "id.idx", "id.nc"]


def test_a_program_without_motion_is_an_empty_drawing(tmp_path: Path) -> None:
    async def story() -> None:
        world = World(tmp_path)
        toolpaths = Toolpaths(world.store, lambda *_: iter(()), maker=InlineWorker(), files=InlineWorker())
        assert read_toolpath(await fetched(toolpaths, world.id, 2)).line == []

    told(story())
