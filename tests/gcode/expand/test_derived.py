"""The expanded program as a file: each line names where it came from."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcode.expand.derived import source_line, write_expanded
from gcode.expand.expander import Expanded
from tests.harness.programs import quick


def test_a_line_names_its_source() -> None:
    assert list(write_expanded([Expanded(12, "G1 X1 Y2")])) == [b"G1 X1 Y2 ;@12\n"]


@pytest.mark.parametrize("raw", [b"", b"G1 X1", b"G1 ;@", b"G1 ;@0", b"G1 ;@5 x", b"G1 ;@-5", b"@5"])
def test_lines_of_other_files(raw: bytes) -> None:
    assert source_line(raw) is None


@given(st.integers(1, 10**12), st.text(alphabet="GX1 ;@()9ф", max_size=20))
@quick
def test_what_is_written_is_read_back(line: int, text: str) -> None:
    (raw,) = write_expanded([Expanded(line, text)])
    assert source_line(raw) == source_line(raw.rstrip()) == line
