"""Programs on disk: by content hash, with an index of line offsets. Not the table of programs; that is store.py.

`<sha256>.nc` is the upload byte for byte, `<sha256>.idx` the offset of every 1,024th line; whatever else is made of a
program is `<sha256>.*` beside it, and goes with it. The one rule: a file under its final name is complete and durable;
what a crash left half-done (a `.part`, an index alone) the next start removes, what has no row it puts aside. Memory
stays constant whatever the size.
"""

import hashlib
import os
import re
import secrets
import struct
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from functools import partial
from itertools import islice
from pathlib import Path
from types import TracebackType
from typing import BinaryIO, Self

from gcode.lines import BOM, split_lines
from jobs.lineaccess import LineAccess
from jobs.linecount import LINES_PER_ENTRY, LineCounter, NotAProgramError

CHUNK_BYTES = 65_536

PIECE_BYTES = 1 << 18
"""How much of a stored program is worked on at once: a daemon that runs for a year has less memory to give than a
command that ends, and the stream beside it waits for shorter pieces of work."""

SYNC_BYTES = 4 * 1024 * 1024
"""An upload goes to the disk in portions of this: the journal's commit of a running job waits for one of them at most,
and not for a gigabyte that the system has kept in memory."""

UNLISTED = ".unlisted"
"""Behind the name of a program that no row names: its upload was never answered, or its deletion was not finished."""
UNLISTED_KEPT_S = 30 * 86_400.0
"""From when it was found. Should the rows be what was lost (a disk that breaks its word), there is time to see."""

_PART = ".part"
_HEADER = struct.Struct("<8sQQ")  # magic, lines, bytes
_OFFSET = struct.Struct("<Q")
_MAGIC = b"MSIDX01\n"
_ID = re.compile(r"[0-9a-f]{64}")


class UnknownProgramError(KeyError):
    """There is no program of this id."""


@dataclass(frozen=True, slots=True)
class ProgramInfo:
    """`id` is the content's SHA-256 in hex, as is `sha256`; `lines` counts a last line without an end."""

    id: str
    name: str
    lines: int
    bytes: int
    sha256: str


class ProgramStore:
    """A folder of programs. May be used by several threads; a Writer by one."""

    def __init__(self, root: Path) -> None:
        self._root = root
        root.mkdir(parents=True, exist_ok=True)
        for left_over in root.glob(f"*{_PART}"):
            left_over.unlink(missing_ok=True)
        for index in root.glob("*.idx"):
            if not index.with_suffix(".nc").exists():
                index.unlink(missing_ok=True)

    def writer(self, name: str) -> "Writer":
        """Begin an upload. Raises OSError when the disk does not take it."""
        return Writer(self._root, name)

    def __contains__(self, program_id: str) -> bool:
        return _ID.fullmatch(program_id) is not None and self._program(program_id).is_file()

    def info(self, program_id: str, name: str = "") -> ProgramInfo:
        """What is known of a program from its files. Raises UnknownProgramError."""
        with self._open_index(program_id) as index:
            _, lines, size = _HEADER.unpack(index.read(_HEADER.size))
        return ProgramInfo(program_id, name, lines, size, program_id)

    def lines(self, program_id: str, first: int = 1, last: int | None = None) -> Iterator[tuple[int, bytes]]:
        """Lines `first` to `last` (both inclusive, from 1) with their numbers, without their ends.

        Opens the file at once, so a program that is deleted meanwhile is read to its end all the same. Raises
        UnknownProgramError.
        """
        if first < 1:
            raise ValueError(f"lines count from 1, not {first}")
        with self._open_index(program_id) as index:
            _, count, _ = _HEADER.unpack(index.read(_HEADER.size))
            entry = min(first - 1, max(count - 1, 0)) // LINES_PER_ENTRY
            index.seek(_HEADER.size + entry * _OFFSET.size)
            (offset,) = _OFFSET.unpack(index.read(_OFFSET.size))
        file = self._program(program_id).open("rb")
        file.seek(offset)
        return _numbered(file, entry * LINES_PER_ENTRY + 1, first, last)

    def runs(self, program_id: str, first: int = 1, last: int | None = None) -> Iterator[tuple[int, bytes]]:
        r"""The same lines, up to LINES_PER_ENTRY together as they stand in the file, each with `\n` for an end; with
        the number of the first of them.

        Opens the file when the first is wanted, so that who gives up before holds nothing open. Raises
        UnknownProgramError then.
        """
        with self._open_index(program_id) as index, self._program(program_id).open("rb") as file:
            _, count, size = _HEADER.unpack(index.read(_HEADER.size))
            last = count if last is None else min(last, count)
            if last < first:
                return
            entry = (first - 1) // LINES_PER_ENTRY
            index.seek(_HEADER.size + entry * _OFFSET.size)
            end = file.seek(_next_offset(index, size))
            for number in range(entry * LINES_PER_ENTRY + 1, last + 1, LINES_PER_ENTRY):
                begin, end = end, _next_offset(index, size)
                text = _with_line_feeds(file.read(end - begin), first=number == 1)
                if number < first or number + LINES_PER_ENTRY > last + 1:
                    text = b"".join(text.splitlines(keepends=True)[max(first - number, 0) : last - number + 1])
                yield max(number, first), text

    def access(self, program_id: str) -> LineAccess:
        """The lines of a program in any order. Raises UnknownProgramError, and its `line` does, too."""
        return LineAccess(self.info(program_id).lines, partial(self.lines, program_id))

    def chunks(self, program_id: str) -> Iterator[bytes]:
        """The bytes of a program. Opens the file at once, as `lines` does. Raises UnknownProgramError."""
        if program_id not in self:
            raise UnknownProgramError(program_id)
        return _chunks(self._program(program_id).open("rb"))

    def delete(self, program_id: str) -> None:
        """Remove a program and what was made of it. Raises UnknownProgramError."""
        if program_id not in self:
            raise UnknownProgramError(program_id)
        # The program first: what is being made of it meanwhile is taken away again when the program is not there.
        self._program(program_id).unlink()
        # Not `glob`, which keeps a compiled pattern of each name that it was ever asked for.
        for made_of_it in list(self._root.iterdir()):
            if made_of_it.name.startswith(f"{program_id}."):
                made_of_it.unlink(missing_ok=True)

    def put_aside(self, listed: Collection[str], *, now_s: float) -> list[Path]:
        """Put programs aside that have no row, and remove those that were put aside long ago or have come again; those
        that were put aside now. `now_s` in seconds since 1970. Before the first upload. Raises OSError."""
        for path in self._root.glob(f"*.nc{UNLISTED}"):
            if path.name.partition(".")[0] in listed or now_s - path.stat().st_mtime > UNLISTED_KEPT_S:
                path.unlink(missing_ok=True)
        aside = []
        for path in self._root.glob("*.nc"):
            if _ID.fullmatch(path.stem) is None or path.stem in listed:
                continue
            kept = path.with_name(f"{path.name}{UNLISTED}")
            os.utime(path, (now_s, now_s))
            path.replace(kept)
            for made_of_it in set(self._root.glob(f"{path.stem}.*")) - {kept}:
                made_of_it.unlink(missing_ok=True)
            aside.append(kept)
        return sorted(aside)

    def beside(self, program_id: str, suffix: str) -> Path:
        """Where something that is made of a program is kept: it goes when the program goes."""
        return self._root / f"{program_id}{suffix}"

    def all_beside(self, suffix: str) -> list[tuple[str, Path]]:
        """Everything of this suffix with the program that it was made of, whether that is still there or not."""
        return [(path.name.partition(".")[0], path) for path in self._root.glob(f"*{suffix}")]

    def _open_index(self, program_id: str) -> BinaryIO:
        if program_id not in self:
            raise UnknownProgramError(program_id)
        return self._index(program_id).open("rb")

    def _program(self, program_id: str) -> Path:
        return self._root / f"{program_id}.nc"

    def _index(self, program_id: str) -> Path:
        return self._root / f"{program_id}.idx"


def _next_offset(index: BinaryIO, size: int) -> int:
    """Where the lines of the next entry begin; behind the last one the end of the program."""
    entry = index.read(_OFFSET.size)
    return int(_OFFSET.unpack(entry)[0]) if entry else size


def _with_line_feeds(text: bytes, *, first: bool) -> bytes:
    r"""Whole lines, each with `\n` for an end. `first`: they begin the program, perhaps with a byte order mark."""
    if first:
        text = text.removeprefix(BOM)
    if b"\r" in text:
        text = text.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    return text if text.endswith(b"\n") else text + b"\n"


def _chunks(file: BinaryIO) -> Iterator[bytes]:
    with file:
        while chunk := file.read(CHUNK_BYTES):
            yield chunk


def _numbered(file: BinaryIO, number: int, first: int, last: int | None) -> Iterator[tuple[int, bytes]]:
    if last is not None and last < first:
        file.close()
        return iter(())
    # No generator that gives out line by line: there would be one step of it for every line of a job.
    lines = enumerate(split_lines(_chunks(file)), number)
    return islice(lines, first - number, None if last is None else last - number + 1)


class Writer:
    """One upload: `write` as often as needed, then `finish` or `abort`. As a context manager it aborts by itself.

    An error of the disk (OSError, as when it is full) or of the content (NotAProgramError) leaves nothing behind.
    """

    def __init__(self, root: Path, name: str) -> None:
        self._root = root
        self._name = name
        stem = secrets.token_hex(8)
        self._paths = (root / f"{stem}.nc{_PART}", root / f"{stem}.idx{_PART}")
        self._hash = hashlib.sha256()
        self._counter = LineCounter()
        self._bytes = 0
        self._unsynced_bytes = 0
        self._files: list[BinaryIO] = []
        try:
            self._files = [path.open("xb") for path in self._paths]
            self._files[1].write(_HEADER.pack(_MAGIC, 0, 0) + _OFFSET.pack(0))
        except OSError:
            self.abort()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.abort()

    @property
    def bytes_written(self) -> int:
        """How much has come so far."""
        return self._bytes

    @property
    def id(self) -> str:
        """Of the program, were it to end here."""
        return self._hash.hexdigest()

    def write(self, chunk: bytes) -> None:
        """The next piece, of any size. Raises NotAProgramError or OSError; nothing is left behind then."""
        try:
            self._files[1].write(self._counter.feed(chunk))
            self._files[0].write(chunk)
            self._unsynced_bytes += len(chunk)
            if self._unsynced_bytes >= SYNC_BYTES:
                self._files[0].flush()
                os.fdatasync(self._files[0].fileno())
                self._unsynced_bytes = 0
        except (OSError, NotAProgramError):
            self.abort()
            raise
        self._hash.update(chunk)
        self._bytes += len(chunk)

    def finish(self) -> ProgramInfo:
        """Make it durable under its hash. Raises OSError; nothing is left behind then."""
        digest = self._hash.hexdigest()
        try:
            self._files[1].write(self._counter.finish())
            lines = self._counter.lines
            self._files[1].seek(0)
            self._files[1].write(_HEADER.pack(_MAGIC, lines, self._bytes))
            for file in self._files:
                file.flush()
                os.fsync(file.fileno())
                file.close()
            # The index first: a program that is there has its index.
            self._paths[1].replace(self._root / f"{digest}.idx")
            self._paths[0].replace(self._root / f"{digest}.nc")
            _sync_folder(self._root)
        except OSError:
            self.abort()
            raise
        self._files = []
        return ProgramInfo(digest, self._name, lines, self._bytes, digest)

    def abort(self) -> None:
        """Leave nothing. Harmless after `finish` and when called twice."""
        files, self._files = self._files, []
        for file in files:
            try:
                file.close()
            except OSError:
                # What could not be flushed is thrown away anyway.
                continue
        for path in self._paths:
            path.unlink(missing_ok=True)


def _sync_folder(folder: Path) -> None:
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
