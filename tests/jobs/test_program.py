"""Programs on disk: the same bytes back, nothing half-kept, constant memory."""

import errno
import hashlib
import itertools
import os
import re
import tracemalloc
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gcode.lines import BOM, MAX_LINE_BYTES
from jobs.linecount import LINES_PER_ENTRY, NotAProgramError
from jobs.program import SYNC_BYTES, UNLISTED_KEPT_S, ProgramInfo, ProgramStore, UnknownProgramError, Writer
from tests.harness.programs import quick


def keep(store: ProgramStore, *chunks: bytes, name: str = "part.nc") -> ProgramInfo:
    with store.writer(name) as writer:
        for chunk in chunks:
            writer.write(chunk)
        return writer.finish()


def send(writer: Writer, data: bytes) -> None:
    for at in range(0, len(data), 4096):
        writer.write(data[at : at + 4096])
    writer.finish()


def files(root: Path) -> list[str]:
    return sorted(path.name for path in root.iterdir())


def test_a_program_is_kept_by_its_content(tmp_path: Path) -> None:
    store = ProgramStore(tmp_path)
    info = keep(store, b"G21\nG0 ", b"X1\r\nM30")
    digest = hashlib.sha256(b"G21\nG0 X1\r\nM30").hexdigest()
    assert info == ProgramInfo(digest, "part.nc", 3, 14, digest)
    assert list(store.lines(info.id)) == [(1, b"G21"), (2, b"G0 X1"), (3, b"M30")]
    assert keep(store, b"G21\nG0 X1\r\nM30", name="other.nc").id == info.id
    assert files(tmp_path) == [f"{digest}.idx", f"{digest}.nc"]
    assert ProgramStore(tmp_path).info(info.id, "part.nc") == info
    assert info.id in store
    store.delete(info.id)
    assert info.id not in store
    assert files(tmp_path) == []


@pytest.mark.parametrize(
    ("first", "last", "expected"),
    [(1, None, [1, 2, 3]), (2, None, [2, 3]), (2, 2, [2]), (3, 9, [3]), (4, None, []), (2, 1, []), (1, 0, [])],
)
def test_a_range_of_lines(tmp_path: Path, first: int, last: int | None, expected: list[int]) -> None:
    store = ProgramStore(tmp_path)
    info = keep(store, b"a\nb\nc\n")
    assert [line for line, _ in store.lines(info.id, first, last)] == expected


ENDS = (b"\n", b"\r\n", b"\r")


@pytest.mark.parametrize(("first", "last"), [(1, None), (1, 2500), (2, 1023), (1024, 1025), (1500, None), (2049, 9999)])
@pytest.mark.parametrize("ended", [True, False])
def test_runs_are_the_same_lines(tmp_path: Path, first: int, last: int | None, ended: bool) -> None:
    store = ProgramStore(tmp_path)
    text = b"".join([b"G1 X%d" % number + ENDS[number % 3] for number in range(2600)])
    info = keep(store, BOM + (text if ended else text.rstrip(b"\r\n")))
    runs = list(store.runs(info.id, first, last))
    assert all(run.endswith(b"\n") for _, run in runs)
    lines = [found for number, run in runs for found in enumerate(run.splitlines(), number)]
    assert lines == list(store.lines(info.id, first, last))


@pytest.mark.parametrize("count", [1023, 1024, 1025, 2048])
def test_runs_end_with_the_program(tmp_path: Path, count: int) -> None:
    store = ProgramStore(tmp_path)
    info = keep(store, b"\n" * count)
    assert sum(run.count(b"\n") for _, run in store.runs(info.id)) == count
    assert [list(store.runs(info.id, *none)) for none in ((count + 1, None), (2, 1), (1, 0))] == [[], [], []]


def test_a_run_is_opened_when_it_is_wanted(tmp_path: Path) -> None:
    store = ProgramStore(tmp_path)
    info = keep(store, b"a\nb\n")
    runs, late = store.runs(info.id), store.runs(info.id)
    store.delete(info.id)
    with pytest.raises(UnknownProgramError):
        next(runs)
    late.close()  # type: ignore[attr-defined]


def test_an_empty_program(tmp_path: Path) -> None:
    store = ProgramStore(tmp_path)
    info = keep(store)
    assert info.lines == 0
    assert list(store.lines(info.id)) == []


def test_unknown_programs(tmp_path: Path) -> None:
    store = ProgramStore(tmp_path / "new" / "folder")
    for wrong in ("0" * 64, "../../etc/passwd", ""):
        assert wrong not in store
        with pytest.raises(UnknownProgramError):
            store.info(wrong)
        with pytest.raises(UnknownProgramError):
            store.lines(wrong)
        with pytest.raises(UnknownProgramError):
            store.delete(wrong)
    info = keep(store, b"G0")
    with pytest.raises(ValueError, match="count from 1"):
        store.lines(info.id, 0)


pieces = st.lists(st.sampled_from((b"\r", b"\n", b"\r\n", b"G1 X1", b"\xef\xbb\xbf", b"(\xd1\x84)")), max_size=30)


@given(pieces, st.integers(1, 7), st.integers(1, 12))
@settings(quick, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_lines_do_not_depend_on_how_they_came(tmp_path: Path, parts: list[bytes], size: int, first: int) -> None:
    data = b"".join(parts)
    store = ProgramStore(tmp_path)
    info = keep(store, *[data[at : at + size] for at in range(0, len(data), size)])
    expected = re.split(rb"\r\n|\r|\n", data.removeprefix(b"\xef\xbb\xbf"))
    if not expected[-1] and not data.endswith(b"\xef\xbb\xbf"):
        expected.pop()
    if data == b"\xef\xbb\xbf":
        expected = []
    got = list(store.lines(info.id))
    assert [raw for _, raw in got] == expected
    assert list(store.lines(info.id, first)) == got[first - 1 :]


@pytest.mark.parametrize("end", [b"\n", b"\r\n", b"\r"])
def test_the_index_finds_every_line(tmp_path: Path, end: bytes) -> None:
    store = ProgramStore(tmp_path)
    count = 3 * LINES_PER_ENTRY + 17
    data = end.join(b"N%d" % number for number in range(1, count + 1))
    info = keep(store, *[data[at : at + 1001] for at in range(0, len(data), 1001)])
    assert info.lines == count
    for first in (1, 2, LINES_PER_ENTRY, LINES_PER_ENTRY + 1, LINES_PER_ENTRY + 2, 3 * LINES_PER_ENTRY + 1, count):
        assert next(store.lines(info.id, first)) == (first, b"N%d" % first)
    assert list(store.lines(info.id, count + 1)) == []
    assert len(list(store.lines(info.id))) == count


def test_the_index_is_not_read_in_vain(tmp_path: Path) -> None:
    """Line n is found without reading what stands before it."""
    store = ProgramStore(tmp_path)
    info = keep(store, b"G1 X1\n" * (4 * LINES_PER_ENTRY), b"M30\n")
    program = tmp_path / f"{info.id}.nc"
    spoiled = program.read_bytes()
    program.write_bytes(b"#" * (2 * LINES_PER_ENTRY * 6) + spoiled[2 * LINES_PER_ENTRY * 6 :])
    assert next(store.lines(info.id, 3 * LINES_PER_ENTRY + 5)) == (3 * LINES_PER_ENTRY + 5, b"G1 X1")


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"G0 X1\n\x00\x00", "byte 6"),
        ("G0 X1".encode("utf-16-le"), "binary"),
        (b"\x89PNG\r\n\x1a\n\x00", "binary"),
        (b"PK\x03\x04", "binary"),
        (b"(" + b"x" * MAX_LINE_BYTES + b"y", "line 1 is longer"),
    ],
)
def test_what_is_no_text_is_refused_early(tmp_path: Path, data: bytes, message: str) -> None:
    store = ProgramStore(tmp_path)
    writer = store.writer("virus.nc")
    with pytest.raises(NotAProgramError, match=message):
        send(writer, data)
    assert files(tmp_path) == []


def test_tabs_escapes_and_the_end_mark_of_dos_are_text(tmp_path: Path) -> None:
    assert keep(ProgramStore(tmp_path), b"G0\tX1\x0c\r\n\x1a").lines == 2


def test_an_upload_that_stops_leaves_nothing(tmp_path: Path) -> None:
    store = ProgramStore(tmp_path)
    with store.writer("half.nc") as writer:
        writer.write(b"G0 X1\n")
        assert writer.bytes_written == 6
        assert len(files(tmp_path)) == 2
    assert files(tmp_path) == []
    writer.abort()


def test_a_program_without_a_row_is_put_aside_and_kept_for_a_while(tmp_path: Path) -> None:
    store = ProgramStore(tmp_path)
    listed, other = keep(store, b"G0 X1\n").id, keep(store, b"G0 X2\n").id
    store.beside(other, ".elvinto.toolpath").write_bytes(b"")
    (tmp_path / "notes.nc").write_bytes(b"M30\n")
    there = sorted(f"{listed}{suffix}" for suffix in (".idx", ".nc"))
    aside = tmp_path / f"{other}.nc.unlisted"
    assert store.put_aside({listed}, now_s=1000.0) == [aside]
    assert files(tmp_path) == sorted([*there, aside.name, "notes.nc"]), "only names of our own are touched"
    assert aside.read_bytes() == b"G0 X2\n"
    assert other not in ProgramStore(tmp_path)
    assert store.put_aside({listed}, now_s=1000.0 + UNLISTED_KEPT_S) == []
    assert aside.exists(), "from when it was found, whenever it was written"
    store.put_aside({listed}, now_s=1001.0 + UNLISTED_KEPT_S)
    assert files(tmp_path) == sorted([*there, "notes.nc"])


def test_a_program_that_was_put_aside_and_comes_again_is_there_once(tmp_path: Path) -> None:
    store = ProgramStore(tmp_path)
    id = keep(store, b"G0 X2\n").id
    store.put_aside(set(), now_s=1000.0)
    assert keep(store, b"G0 X2\n").id == id
    assert [text for _, text in store.lines(id)] == [b"G0 X2"]
    assert store.put_aside({id}, now_s=1000.0) == []
    assert files(tmp_path) == [f"{id}.idx", f"{id}.nc"]


def test_what_a_crash_left_is_removed_at_the_next_start(tmp_path: Path) -> None:
    store = ProgramStore(tmp_path)
    info = keep(store, b"G0\n")
    for name in ("0123.nc.part", "0123.idx.part", f"{'0' * 64}.idx"):
        (tmp_path / name).write_bytes(b"G1\n")
    again = ProgramStore(tmp_path)
    assert files(tmp_path) == [f"{info.id}.idx", f"{info.id}.nc"]
    assert info.id in again


class FullDisk:
    """A file on a disk that takes no more."""

    def __init__(self, file: object, fails_at: str) -> None:
        self._file = file
        self._fails_at = fails_at

    def __getattr__(self, name: str) -> object:
        if name == self._fails_at:
            raise OSError(errno.ENOSPC, "No space left on device")
        return getattr(self._file, name)


@pytest.mark.parametrize("fails_at", ["write", "flush"])
@pytest.mark.parametrize("which", [0, 1])
def test_a_full_disk_leaves_nothing(tmp_path: Path, fails_at: str, which: int) -> None:
    store = ProgramStore(tmp_path)
    writer = store.writer("part.nc")
    writer._files[which] = FullDisk(writer._files[which], fails_at)  # type: ignore[call-overload]
    with pytest.raises(OSError, match="No space"):
        send(writer, b"G0 X1\n")
    assert files(tmp_path) == []


def test_a_full_disk_at_the_very_beginning(tmp_path: Path) -> None:
    store = ProgramStore(tmp_path)
    tmp_path.rmdir()
    with pytest.raises(OSError, match="No such file"):
        store.writer("part.nc")
    assert not tmp_path.exists()


def test_reading_goes_on_when_the_program_is_deleted(tmp_path: Path) -> None:
    store = ProgramStore(tmp_path)
    info = keep(store, b"G0\nG1\n")
    lines = store.lines(info.id)
    store.delete(info.id)
    assert [raw for _, raw in lines] == [b"G0", b"G1"]


def test_a_large_program_is_never_in_memory(tmp_path: Path) -> None:
    store = ProgramStore(tmp_path)
    chunk = b"G1 X123.456 Y-7.5 F1200\n" * 4096
    tracemalloc.start()
    info = keep(store, *[chunk for _ in range(24)])
    last = 0
    for line, _ in store.lines(info.id):
        last = line
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert last == info.lines == 24 * 4096
    assert peak < 2_000_000 < info.bytes


def test_a_long_upload_goes_to_the_disk_in_portions(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What the system still keeps in memory, a commit of the journal may have to wait for."""
    synced: list[int] = []
    sync = os.fdatasync

    def counting(handle: int) -> None:
        sync(handle)
        synced.append(os.fstat(handle).st_size)

    monkeypatch.setattr("jobs.program.os.fdatasync", counting)
    keep(ProgramStore(tmp_path), *[b"G1 X1\n" * 50_000] * 60)
    assert len(synced) == 60 * 300_000 // SYNC_BYTES
    steps = [later - earlier for earlier, later in itertools.pairwise([0, *synced])]
    assert max(steps) <= SYNC_BYTES + 300_000
