"""The tool table: LinuxCNC's format, hostile text, and where tools are kept (§4)."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from protocol.iocontrol.tooltable import (
    COMMENT_MAX,
    NUMBER_MAX,
    TOOLS_MAX,
    VALUE_MAX,
    WARNINGS_MAX,
    Place,
    Tool,
    ToolTable,
    parse,
    render,
)

FILE = """\
; Tools of the small mill
T1 P1 D6.0 Z+10.0 ;six mm

T99999 P17 Z-.5 I95.000000 J155 Q2 ;a lathe tool; with two semicolons
  t3\tp3  x1 Y2 A3 b4 C5 u6 V7 w8e0 d-1
"""


def test_the_format() -> None:
    table, warnings = parse(FILE)
    assert warnings == ()
    assert table.remarks == ("Tools of the small mill",)
    assert table.tools == (
        Tool(1, 1, diameter=6.0, z=10.0, comment="six mm"),
        Tool(
            99999,
            17,
            z=-0.5,
            front_angle=95.0,
            back_angle=155.0,
            orientation=2,
            comment="a lathe tool; with two semicolons",
        ),
        Tool(3, 3, x=1.0, y=2.0, a=3.0, b=4.0, c=5.0, u=6.0, v=7.0, w=8.0, diameter=-1.0),
    )


def test_it_is_written_as_it_is_read() -> None:
    table, _ = parse(FILE)
    assert render(table) == (
        "; Tools of the small mill\n"
        "T1 P1 D+6.0 Z+10.0 ;six mm\n"
        "T99999 P17 Z-0.5 I+95.0 J+155.0 Q2 ;a lathe tool; with two semicolons\n"
        "T3 P3 D-1.0 X+1.0 Y+2.0 A+3.0 B+4.0 C+5.0 U+6.0 V+7.0 W+8.0\n"
    )


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("T1 P1 K5", "'K5' is not known; the line is left out"),
        ("hello", "'hello' is not known; the line is left out"),
        ("T1 P1 D", "'D' is no value of D; the line is left out"),
        ("T1 P1 Dnan", "'Dnan' is no value of D; the line is left out"),
        ("T1 P1 D1e999", "'D1e999' is no value of D; the line is left out"),
        ("T1 P1 D1000001", "'D1000001' is no value of D; the line is left out"),
        ("T1 P1 D1_0", "'D1_0' is no value of D; the line is left out"),
        ("T1 P1 Z٣", "'Z٣' is no value of Z; the line is left out"),
        ("T1.5 P1", "'T1.5' is no value of T; the line is left out"),
        ("T-1 P1", "'T-1' is no value of T; the line is left out"),
        (f"T{NUMBER_MAX + 1} P1", "'T100000' is no value of T; the line is left out"),
        ("T1 P" + "9" * 5000, "'P9999999999999999999' is no value of P; the line is left out"),
        ("T1 P1 Q10", "'Q10' is no value of Q; the line is left out"),
        ("T1 P1 T2", "T stands twice; the line is left out"),
        ("P1 D5", "there is no T; the line is left out"),
        ("T1 D5 ;no pocket", "there is no P; the line is left out"),
    ],
)
def test_a_line_that_is_not_understood_is_left_out_and_told(line: str, message: str) -> None:
    table, warnings = parse(f"T8 P8\n{line}\nT9 P9\n")
    assert [tool.number for tool in table.tools] == [8, 9]
    assert [(warning.line, warning.message) for warning in warnings] == [(2, message)]


def test_the_first_of_two_lines_for_a_tool_counts() -> None:
    table, warnings = parse("T1 P1\nT1 P2\n")
    assert table.tools == (Tool(1, 1),)
    assert warnings[0].message == "T1 stands twice; the later line is left out"


def test_two_tools_may_share_a_label_but_not_a_pocket() -> None:
    assert len(parse("T1 P1\nT2 P1\n")[0].tools) == 2
    table, warnings = parse("T1 P1\nT2 P1\n", random=True)
    assert table.tools == (Tool(1, 1),)
    assert warnings[0].message == "pocket 1 is taken; T2 is left out"


def test_everything_is_bounded() -> None:
    table, warnings = parse("".join(f"T{n} P{n} ;{'x' * 1000}\n" for n in range(1, TOOLS_MAX + 3)))
    assert (len(table.tools), len(warnings)) == (TOOLS_MAX, 2)
    assert len(table.tools[0].comment) == COMMENT_MAX
    _, warnings = parse("?\n" * (WARNINGS_MAX + 5))
    assert len(warnings) == WARNINGS_MAX + 1
    assert warnings[-1].message == "5 more lines are left out"
    _, warnings = parse("?" * 1_000_000)
    assert len(warnings[0].message) < 100


def test_a_comment_is_shown_without_what_moves_a_cursor() -> None:
    table, _ = parse("T1 P1 ;\x1b[2Jsix\x00mm\u202e\r\n")
    assert table.tools[0].comment == "[2Jsix mm"


def test_where_a_tool_is() -> None:
    table, _ = parse(FILE)
    assert table.place(1) == Place(1, 1, 1)
    assert table.place(99999) == Place(99999, 17, 2)  # the index is the order in the file
    assert table.place(0) == Place(0, 0, 0)
    assert table.place(2) is None
    assert table.in_spindle == 0


def test_where_a_tool_is_in_a_random_changer() -> None:
    table, _ = parse("T1 P0\nT5 P12\nT7 P3\n", random=True)
    assert table.place(5) == Place(5, 12, 12)  # the index is the pocket
    assert table.place(0) is None
    assert table.in_spindle == 1
    after = table.exchanged(5)
    assert {tool.number: tool.pocket for tool in after.tools} == {1: 12, 5: 0, 7: 3}
    assert after.in_spindle == 5
    assert after.exchanged(5) == after
    assert table.exchanged(99) == table
    assert parse("T5 P12", random=True)[0].in_spindle == 0
    plain, _ = parse(FILE)
    assert plain.exchanged(3) == plain


@given(st.text(), st.booleans())
def test_any_text_can_be_read(text: str, random: bool) -> None:
    table, _ = parse(text, random=random)
    assert parse(render(table), random=random) == (table, ())


@given(st.lists(st.text("TPDXYZABCUVWIJQ;+-.eE0123456789 \t\r\n", max_size=60), max_size=8), st.booleans())
def test_any_text_like_a_table_can_be_read(lines: list[str], random: bool) -> None:
    table, warnings = parse("\n".join(lines), random=random)
    assert parse(render(table), random=random) == (table, ())
    assert all(warning.line >= 1 for warning in warnings)


LENGTHS = st.floats(-VALUE_MAX, VALUE_MAX).map(lambda value: value + 0.0)


@given(
    st.lists(
        st.builds(
            Tool,
            number=st.integers(0, NUMBER_MAX),
            pocket=st.integers(0, NUMBER_MAX),
            diameter=LENGTHS,
            z=LENGTHS,
            w=LENGTHS,
            back_angle=LENGTHS,
            orientation=st.integers(0, 9),
            comment=st.text(st.characters(codec="utf-8"), max_size=40).map(
                lambda text: "".join(c for c in text if c.isprintable()).strip()
            ),
        ),
        unique_by=lambda tool: tool.number,
        max_size=6,
    )
)
def test_what_is_written_is_read_again(tools: list[Tool]) -> None:
    table = ToolTable(tuple(tools))
    assert parse(render(table)) == (table, ())
