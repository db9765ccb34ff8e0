"""Lines of a stored program in any order."""

import random
from collections.abc import Iterator
from pathlib import Path

import pytest

from jobs import lineaccess
from jobs.lineaccess import LineAccess
from jobs.program import ProgramStore, UnknownProgramError


def stored(folder: Path, data: bytes) -> tuple[ProgramStore, str]:
    programs = ProgramStore(folder)
    with programs.writer("a.nc") as writer:
        writer.write(data)
        return programs, writer.finish().id


@pytest.mark.parametrize("end", [b"\n", b"\r\n", b"\r"])
def test_every_line_in_any_order(tmp_path: Path, end: bytes) -> None:
    lines = [b"G1 X%d" % number for number in range(1, 3001)]
    programs, id = stored(tmp_path, end.join(lines))
    access = programs.access(id)
    assert access.count == 3000
    order = random.Random(7).choices(range(1, 3001), k=2000)
    assert [access.line(number) for number in order] == [lines[number - 1] for number in order]
    assert (access.line(0), access.line(3001), access.line(-5)) == (None, None, None)


def test_forwards_the_file_is_opened_once_and_loops_open_none(monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[int] = []

    def lines_from(first: int) -> Iterator[tuple[int, bytes]]:
        opened.append(first)
        return iter([(number, b"%d" % number) for number in range(first, 1001)])

    access = LineAccess(1000, lines_from)
    for _ in range(3):
        assert [access.line(number) for number in range(1, 1001)] == [b"%d" % number for number in range(1, 1001)]
    assert opened == [1]
    monkeypatch.setattr(lineaccess, "KEPT_BYTES", 400)
    small = LineAccess(1000, lines_from)
    for number in (1, 1000, 1, 1000, 500):
        assert small.line(number) == b"%d" % number
    assert len(small._kept) <= 4
    assert small._bytes == sum(len(line) for lines in small._kept.values() for line in lines)


def test_a_program_that_is_deleted_meanwhile_says_so(tmp_path: Path) -> None:
    programs, id = stored(tmp_path, b"G1 X1\n" * 5000)
    access = programs.access(id)
    assert access.line(1) == b"G1 X1"
    programs.delete(id)
    with pytest.raises(UnknownProgramError):
        access.line(4000)
    with pytest.raises(UnknownProgramError):
        programs.access(id)
