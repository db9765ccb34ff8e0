"""The drawings of programs on disk: made once for each content and reader, given out level by level.

Not the format (gcode/toolpath.py). `<sha256>.<reader>.<version>.toolpath` lies beside the program and holds the head
and all levels; together they have a limit, and what nobody has asked for the longest goes first. The one rule: a file
under its final name is complete; who asks while it is made waits for the one making.
"""

import asyncio
import hashlib
import os
import secrets
import shutil
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import BinaryIO

from gcode.ncframe.rules import FrameRules
from gcode.profile import Profile
from gcode.segments import Segments
from gcode.toolpath import (
    FORMAT_VERSION,
    HEAD,
    MAX_LEVEL,
    ToolpathEncoder,
    ToolpathTooLongError,
    for_level,
    head_bytes,
    levels_in,
)
from jobs.program import ProgramStore
from server.background.worker import Worker
from server.problems import ProblemError

SUFFIX = ".toolpath"
MAX_TOTAL_BYTES = 2_000_000_000
"""Of all drawings. One of a million segments has 5 to 10 MB and is made anew in seconds. The newest always stays."""

READ_BYTES = 262_144
"""At a time, on the way to a client."""

SegmentsOf = Callable[[str, Profile, FrameRules | None], Iterator[Segments]]
"""The motion of a program, by its id. Raises UnknownProgramError."""


@dataclass(frozen=True, slots=True)
class Reader:
    """How a program is read; `frames` by a machine that gets NC frames, whose tools and modes are the machine's own."""

    profile: Profile
    frames: FrameRules | None = None

    @property
    def name(self) -> str:
        """One of its own for each way of reading."""
        if self.frames is None:
            return self.profile.name
        return f"{self.profile.name}-{hashlib.sha256(repr(self.frames).encode()).hexdigest()[:8]}"


def version_tag() -> str:
    """What a drawing depends on beside content and profile: the format, and how this release reads programs."""
    return hashlib.sha256(f"{FORMAT_VERSION} {version('millstream')}".encode()).hexdigest()[:8]


class Toolpath:
    """One level of one drawing. `etag` is known before anything is made; `open` makes it if need be."""

    def __init__(self, toolpaths: "Toolpaths", program_id: str, reader: Reader, level: int) -> None:
        self._toolpaths = toolpaths
        self._program_id = program_id
        self._reader = reader
        self._level = level
        self.etag = f'"{program_id[:32]}-{reader.name}-{toolpaths.tag}-{level}"'

    async def open(self) -> tuple[int, AsyncIterator[bytes]]:
        """How many bytes it has, and the bytes. Raises ProblemError, UnknownProgramError, OSError."""
        return await self._toolpaths.open(self._program_id, self._reader, self._level)


class Toolpaths:
    """See the head of this file. `maker` draws, `files` reads what has been drawn."""

    def __init__(self, programs: ProgramStore, segments_of: SegmentsOf, *, maker: Worker, files: Worker) -> None:
        self.tag = version_tag()
        self._programs = programs
        self._drawer = Drawer(programs, segments_of)
        self._maker = maker
        self._files = files
        self._making: dict[Path, asyncio.Future[None]] = {}
        for program_id, path in programs.all_beside(SUFFIX):
            if program_id not in programs or not path.name.endswith(f".{self.tag}{SUFFIX}"):
                path.unlink(missing_ok=True)

    def get(self, program_id: str, reader: Reader, level: int) -> Toolpath:
        """A level of the drawing of a program, or the coarsest that there is."""
        return Toolpath(self, program_id, reader, level)

    async def open(self, program_id: str, reader: Reader, level: int) -> tuple[int, AsyncIterator[bytes]]:
        """See Toolpath.open."""
        path = self._programs.beside(program_id, f".{reader.name}.{self.tag}{SUFFIX}")
        while True:
            # Only the name is looked up here; the file may be on a slow disk.
            await self._made(path, program_id, reader)
            with suppress(FileNotFoundError):
                head, file, length = await self._files.run(_open_level, path, level)
                return len(head) + length, self._chunks(head, file, length)

    async def _made(self, path: Path, program_id: str, reader: Reader) -> None:
        making = self._making.get(path)
        if making is None:
            size = await self._files.run(self._undrawn_bytes, path, program_id)
            if size is None:
                return
            making = self._making.get(path)
            if making is None:
                worker = self._maker.for_bytes(size)
                making = asyncio.ensure_future(worker.run(self._drawer.make, path, program_id, reader))
                self._making[path] = making
                making.add_done_callback(lambda done: self._forget(path, done))
        # Who goes away does not end it for the others.
        await asyncio.shield(making)

    def _undrawn_bytes(self, path: Path, program_id: str) -> int | None:
        """The size of the program; None where its drawing is there."""
        return None if path.is_file() else self._programs.info(program_id).bytes

    def _forget(self, path: Path, done: "asyncio.Future[None]") -> None:
        self._making.pop(path, None)
        if not done.cancelled():
            done.exception()  # somebody waited for it, or nobody does any more

    async def _chunks(self, head: bytes, file: BinaryIO, left: int) -> AsyncIterator[bytes]:
        try:
            yield head
            while left:
                chunk = await self._files.run(file.read, min(left, READ_BYTES))
                if not chunk:
                    raise OSError("a toolpath is shorter than its head says")
                left -= len(chunk)
                yield chunk
        finally:
            file.close()


class Drawer:
    """Makes drawings, in the worker: it may travel to another process."""

    def __init__(self, programs: ProgramStore, segments_of: SegmentsOf) -> None:
        self._programs = programs
        self._segments_of = segments_of

    def make(self, path: Path, program_id: str, reader: Reader) -> None:
        """The drawing under its name. Raises ProblemError, UnknownProgramError, OSError."""
        stem = secrets.token_hex(8)
        parts = [path.with_name(f"{stem}.{number}{SUFFIX}.part") for number in range(MAX_LEVEL + 2)]
        try:
            self._draw(parts, program_id, reader)
            parts[-1].replace(path)
            self._make_room(path)
        except ToolpathTooLongError as error:
            raise ProblemError("no_preview", f"The program is too long to be drawn: {error}.") from error
        finally:
            for part in parts:
                part.unlink(missing_ok=True)
        if program_id not in self._programs:
            # It was deleted meanwhile, perhaps before there was anything of ours to delete with it.
            path.unlink(missing_ok=True)

    def _make_room(self, newest: Path) -> None:
        """Away with those that were opened longest ago. Who is reading one of them reads to the end."""
        drawings = []
        for _, path in self._programs.all_beside(SUFFIX):
            with suppress(FileNotFoundError):
                found = path.stat()
                drawings.append((path != newest, -found.st_mtime_ns, found.st_size, path))
        total = 0
        for older, _, size, path in sorted(drawings):
            total += size
            if older and total > MAX_TOTAL_BYTES:
                path.unlink(missing_ok=True)

    def _draw(self, parts: list[Path], program_id: str, reader: Reader) -> None:
        """The levels into a file each, as they come, then all into the last."""
        encoder = ToolpathEncoder("".join(reader.profile.axes).upper())
        with ExitStack() as stack:
            rungs = [stack.enter_context(part.open("w+b")) for part in parts[:-1]]
            for segments in self._segments_of(program_id, reader.profile, reader.frames):
                for rung, data in encoder.add(segments):
                    rungs[rung].write(data)
            for rung, data in encoder.finish():
                rungs[rung].write(data)
            whole = stack.enter_context(parts[-1].open("wb"))
            whole.write(encoder.head())
            for rung in encoder.rungs():
                rungs[rung].seek(0)
                shutil.copyfileobj(rungs[rung], whole, READ_BYTES)
            whole.flush()
            os.fsync(whole.fileno())


def _open_level(path: Path, level: int) -> tuple[bytes, BinaryIO, int]:
    """The head for this level, the file where its blocks begin, and their length."""
    file = path.open("rb")
    try:
        with suppress(OSError):
            os.utime(path)  # asked for just now; see _make_room
        start = file.read(HEAD.size)
        head = start + file.read(head_bytes(start) - HEAD.size)
        sizes = [found.bytes for found in levels_in(head)]
        level = min(level, len(sizes) - 1)
        file.seek(sum(sizes[:level]), 1)
    except BaseException:
        file.close()
        raise
    return for_level(head, level), file, sizes[level]
