"""Plain programs that are made of stored ones."""

import errno
from pathlib import Path

import pytest

from gcode.check import CheckOptions
from gcode.expand.derived import source_line
from gcode.expand.errors import ExpandError, Limits
from gcode.motion import Motion
from gcode.profile import load_profile
from jobs.expansion import TooLargeError, check_stored, has_to_be_expanded, motion_of, store_expanded
from jobs.program import ProgramStore, Writer

SOURCE = b"G21 G90\r\n#1=3\r\no1 repeat [#1]\r\n  G1 X#1 Y5 F600\r\n  G0 Y0\r\no1 endrepeat\r\nM30\r\n"
PLAIN = b"G21 G90 ;@1\n" + b"G1 X3 Y5 F600 ;@4\nG0 Y0 ;@5\n" * 3 + b"M30 ;@7\n"


def stored(folder: Path, data: bytes = SOURCE) -> tuple[ProgramStore, str]:
    programs = ProgramStore(folder)
    with programs.writer("a.ngc") as writer:
        writer.write(data)
        return programs, writer.finish().id


def content(programs: ProgramStore, id: str) -> bytes:
    return b"".join(programs.chunks(id))


def files(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_each_line_names_its_source_and_the_same_again_is_the_same(tmp_path: Path) -> None:
    programs, id = stored(tmp_path)
    assert has_to_be_expanded(programs, id)
    made = store_expanded(programs, id, "a.ngc")
    assert (made.name, made.lines, content(programs, made.id)) == ("a.ngc (expanded)", 8, PLAIN)
    assert [source_line(raw) for _, raw in programs.lines(made.id)] == [1, 4, 5, 4, 5, 4, 5, 7]
    assert not has_to_be_expanded(programs, made.id)
    assert store_expanded(programs, id, "b.ngc").id == made.id


def test_motion_names_the_lines_of_the_source(tmp_path: Path) -> None:
    programs, id = stored(tmp_path)
    elvinto = load_profile("elvinto")
    made = store_expanded(programs, id, "a.ngc")
    drawn = list(motion_of(programs, id, elvinto))
    assert [int(line) for segments in drawn for line in segments.line] == [4, 5] * 3
    plain = list(motion_of(programs, made.id, elvinto))
    assert [int(line) for segments in plain for line in segments.line] == [2, 3, 4, 5, 6, 7]
    assert drawn[0].end[:2].tolist() == plain[0].end[:2].tolist() == [[3.0] * 6, [5.0, 0.0] * 3]


def test_a_plain_program_is_checked_as_it_stands(tmp_path: Path) -> None:
    programs, id = stored(tmp_path, b"G21 G90\nG1 X1 F5\nM30\n")
    report = check_stored(programs, id, load_profile("elvinto"), Motion(), CheckOptions())
    assert (report.expanded_lines, report.lines, report.ok) == (None, 3, True)


@pytest.mark.parametrize(
    ("limits", "max_bytes", "error"),
    [(Limits(max_lines_out=5), None, ExpandError), (None, 100, TooLargeError)],
)
def test_bounds_leave_nothing_behind(
    tmp_path: Path, limits: Limits | None, max_bytes: int | None, error: type[Exception]
) -> None:
    programs, id = stored(tmp_path, SOURCE.replace(b"#1=3", b"#1=9999"))
    before = files(tmp_path)
    with pytest.raises(error):
        store_expanded(programs, id, "a.ngc", limits=limits, max_bytes=max_bytes)
    assert files(tmp_path) == before


@pytest.mark.parametrize("where", ["write", "finish"])
def test_a_full_disk_leaves_nothing_behind(tmp_path: Path, where: str, monkeypatch: pytest.MonkeyPatch) -> None:
    programs, id = stored(tmp_path)
    before = files(tmp_path)

    def full(_writer: Writer, *_data: bytes) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Writer, where, full)
    with pytest.raises(OSError, match="No space"):
        store_expanded(programs, id, "a.ngc")
    assert files(tmp_path) == before
