"""The check of programs that are expanded: findings name the lines as they were written."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcode.check import CheckOptions, check_program
from gcode.expand.checked import check_expanded
from gcode.expand.detection import needs_expansion
from gcode.expand.errors import Limits
from gcode.expand.expander import Expander, ExpandError, MemoryProgram
from gcode.findings import Finding, Report
from gcode.profile import load_profile
from tests.harness.programs import quick

ELVINTO = load_profile("elvinto")
LOOP = """G21 G90
#1=0
o1 while [#1 LT 3]
  G1 X#1 F600
  G54 Y0
#1=[#1+1]
o1 endwhile
M30
"""


def checked(text: str, limits: Limits | None = None, **options: bool) -> Report:
    data = text.encode()
    lines = MemoryProgram(data.splitlines())
    return check_expanded(lines, [data], ELVINTO, limits=limits, **CheckOptions(**options))  # type: ignore[typeddict-item]


def codes(findings: tuple[Finding, ...]) -> list[tuple[int, int, str, int]]:
    return [(found.line, found.column, found.code, found.count) for found in findings]


def test_the_turns_of_a_loop_are_one_finding_of_the_line_that_was_written() -> None:
    report = checked(LOOP)
    assert report.ok
    assert (5, 3, "ignored", 3) in codes(report.warnings)
    assert codes(report.infos)[0] == (1, 0, "expanded", 1)
    assert "8 plain lines" in report.infos[0].message
    assert (report.lines, report.expanded_lines, report.blocks) == (8, 8, 8)
    assert (report.bytes, report.line_ends, report.encoding) == (len(LOOP), "lf", "ascii")
    assert report.bounds["x"] == (0.0, 2.0)


def test_a_line_that_came_out_changed_has_no_column() -> None:
    report = checked("#1=1\nG21 G90\nG1 X[#1] F100 G999\nG1 X2 G998\nM30\n")
    assert codes(report.errors) == [(3, 0, "unknown_code", 1), (4, 7, "unknown_code", 1)]


@pytest.mark.parametrize(
    ("text", "line", "column", "code"),
    [
        ("G21 G90\nG1 X#5420\n", 2, 5, "machine_parameter"),
        ("G21 G90\nG1 X#<_x>\n", 2, 5, "machine_parameter"),
        ("G21 G90\nM98 P7\nM30\n", 2, 1, "m98_target"),
        ("G21 G90\nG1 X#<nothing>\n", 2, 5, "undefined_parameter"),
        ("o1 while [1]\nG1 X1\n", 1, 1, "not_closed"),
        ("o1 while [1]\nG0 X#1\n#1=[#1+1]\no1 endwhile\n", 2, 1, "too_many_lines"),
        ("o1 while [1]\n#1=[#1+1]\no1 endwhile\n", 3, 1, "too_many_iterations"),
        ("#1=1\no1 while [1]\nG0 X1\no1 endwhile\n", 4, 1, "endless"),
    ],
)
def test_what_cannot_be_expanded_is_an_error_of_its_place(text: str, line: int, column: int, code: str) -> None:
    report = checked(text, Limits(max_lines_out=50, max_iterations=100))
    assert (line, column, code, 1) in codes(report.errors)
    assert {found.code for found in report.errors + report.warnings} & {"no_end", "no_blocks", "offset_left"} == set()
    assert report.expanded_lines is None
    assert "expanded" not in [found.code for found in report.infos]


def test_what_was_wrong_before_it_is_told_too() -> None:
    report = checked("G21 G90\nG999\nG1 X#5420 F1\n")
    assert codes(report.errors) == [(2, 1, "unknown_code", 1), (3, 5, "machine_parameter", 1)]


def test_deleted_blocks_are_not_expanded() -> None:
    text = "G21 G90\n/G1 X#5420 F1\n#1=2\nG1 X#1 F5\nM30\n"
    assert not checked(text).ok
    assert checked(text, block_delete=True).ok


@given(st.lists(st.sampled_from(["G1 X1 F100", "#1=[#1+1]", "G0 Y#1", "  G54", "o1 repeat [2]", "o1 endrepeat"])))
@quick
def test_the_same_as_the_check_of_what_comes_out(lines: list[str]) -> None:
    text = "G21 G90\n#1=0\n" + "\n".join(lines) + "\nM30\n"
    report = checked(text)
    try:
        plain = list(Expander().expand([line.encode() for line in text.splitlines()]))
    except ExpandError as refused:
        told = refused.code
    else:
        told = "expanded"
    assert told in {found.code for found in report.errors + report.infos}
    if told != "expanded":
        return
    expected = check_program([each.text.encode() for each in plain], ELVINTO)
    assert not needs_expansion([each.text.encode() for each in plain])
    assert (report.seconds, report.bounds, report.blocks) == (expected.seconds, expected.bounds, expected.blocks)
    for found, wanted in ((report.errors, expected.errors), (report.warnings, expected.warnings)):
        assert sum(one.count for one in found) == sum(one.count for one in wanted)
        assert all(1 <= one.line <= len(text.splitlines()) for one in found)
