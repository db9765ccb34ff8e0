"""The way in: parameters, names, limits, and that nothing but an ExpandError comes of any bytes."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcode.expand.blocks import written_out
from gcode.expand.expander import Expander, ExpandError, Limits, MemoryProgram
from gcode.words import parse_block
from tests.harness.programs import thorough

SMALL = Limits(max_lines_out=200, max_iterations=100, max_steps=2000, max_depth=5, max_labels=50)


def lines(program: str, dialect: str = "auto", **settings: object) -> list[str]:
    expander = Expander(dialect, **settings)  # type: ignore[arg-type]
    return [expanded.text for expanded in expander.expand(MemoryProgram(program.encode().splitlines()))]


def refusal(program: str, **settings: object) -> tuple[str, int, int]:
    with pytest.raises(ExpandError) as caught:
        lines(program, **settings)  # type: ignore[arg-type]
    return caught.value.code, caught.value.line, caught.value.column


@pytest.mark.parametrize(
    ("program", "wanted"),
    [
        ("G1 X1.50 (a)\n\n%\n(b)\n; c", ["G1 X1.50 (a)", "(b)", "; c"]),
        ("#1=[1/3]\nG1 x#1 y 2.0 (c) ; d", ["G1 X0.333333333 Y2.0 (c) ; d"]),
        ("/G1 X[2]\n/X3", ["/G1 X2", "/X3"]),
        ("O1234 (PART)\nG0 X#1\nM2\nX9", ["(PART)", "G0 X0", "M2"]),
        ("#1=5 (debug, at #1)\n(msg, fit tool #5)", ["(debug, at 5.000000)", "(msg, fit tool #5)"]),
        ("N10 #1=5\nN20 X#1", ["N20 X5"]),
        ("o1 call\nM2\no1 sub\nX1\no1 endsub", ["X1", "M2"]),
    ],
)
def test_lines(program: str, wanted: list[str]) -> None:
    assert lines(program) == wanted


@pytest.mark.parametrize(
    ("program", "wanted"),
    [
        ("G1 X[1/0]", ("division_by_zero", 1, 7)),
        ("G1 X#<depth>", ("undefined_parameter", 1, 5)),
        ("G1 X#5420", ("machine_parameter", 1, 5)),
        ("G1 X#<_x>", ("machine_parameter", 1, 5)),
        ("#5221=1", ("machine_parameter", 1, 1)),
        ("o<probe> call [1]", ("sub_not_found", 1, 1)),
        ("o1 if [1]\nX1", ("not_closed", 1, 1)),
        ("o1 if [1]\no2 if [1]\no1 endif\no2 endif", ("not_nested", 3, 1)),
        ("X[" + "[" * 500 + "1" + "]" * 500 + "]", ("too_nested", 1, 52)),
        ("X[1e5]", ("bad_expression", 1, 4)),
        ("#1=1 X--5 !", ("bad_statement", 1, 6)),
        ("X#1 X(open", ("unclosed_comment", 1, 6)),
        ("X[1000000*1000]", ("bad_number", 1, 1)),
        ("o1 sub\no1 call\no1 endsub\no1 call", ("too_deep", 2, 1)),
        ("o1 while [1]\n#1=[#1+1]\no1 endwhile", ("too_many_iterations", 3, 1)),
        ("o1 while [1]\no2 repeat [2]\nX1\no2 endrepeat\no1 endwhile", ("endless", 5, 1)),
        ("o1 do\nX1\no1 while [#1 LT 5]", ("endless", 3, 1)),
        ("o1 repeat [99]\nX1\nX2\nX3\no1 endrepeat", ("too_many_lines", 4, 1)),
        ("#<a>=1\nWHILE[1]DO1\nEND1", ("other_dialect", 2, 1)),
        ("N1 X1\n" * 60 + "GOTO 1", ("too_many_labels", 1, 1)),
        ("o1 if [1]\no1 endif\n" * 30, ("too_many_labels", 51, 1)),
    ],
)
def test_refusals_say_where(program: str, wanted: tuple[str, int, int]) -> None:
    assert refusal(program, limits=SMALL) == wanted


def test_many_line_numbers_do_no_harm_without_a_jump() -> None:
    assert len(lines("N1 X[1]\n" * 60, limits=SMALL)) == 60


def test_what_the_machine_knows_is_asked_for() -> None:
    known: dict[int | str, float] = {5420: 7.5, "_metric": 1.0}
    assert lines("X#5420 Y#<_metric>", system=known.get) == ["X7.5 Y1"]
    assert lines("X#100 Y#1", parameters={100: 2.5, 1: 4.0}) == ["X2.5 Y4"]
    assert lines("WHILE[#1 GT 3]DO1\nX#500\n#1=0\nEND1", parameters={500: 2.5, 1: 4.0}) == ["X2.5"]


def test_block_delete() -> None:
    program = "/#1=5\nX#1\n/o1 if [0]\nY1\n/o1 endif"
    assert lines(program, block_delete=True) == ["X0", "Y1"]
    assert lines(program) == ["X5"]


def test_an_expansion_can_be_made_again() -> None:
    expander = Expander()
    program = [b"#100=[#100+1]", b"X#100"]
    assert list(expander.expand(program)) == list(expander.expand(program))


@given(st.floats(-1e9, 1e9))
@thorough
def test_numbers_are_written_out_exactly_enough(value: float) -> None:
    text = written_out(value)
    assert abs(float(text) - value) <= 1e-9
    assert "e" not in text
    assert text not in ("-0", "")


FRAGMENTS = """
o1 sub|o1 endsub|o1 call [#1]|o1 if [#1 LT 3]|o1 else|o1 elseif [1]|o1 endif|o1 while [#2 LT 9]|o1 endwhile|o2 do
o2 while [1]|o2 repeat [3]|o2 endrepeat|o1 break|o2 continue|o1 return [2]|#1=[#1+1]|#2=#1|##1=3|#<a>=[2]|X[#1**#2]
G1 X#1 Y[#2*3]|X#<a>|(debug,#1 #<a>)|M98 P5 L2|O5|M99|M99 P7|M30|WHILE[#1 LT 5]DO1|END1|IF[#1 GT 2]GOTO 7|N7 X1
GOTO#1|IF[#1 EQ #0]THEN #1=4|G65 P5 A1|#1=#1+1|DO2|END2|/X[1]|X[ATAN[1]/[#2]]|X[5 MOD #1]|X[EXISTS[#<a>]]
""".strip().replace("\n", "|")
hostile = st.binary(max_size=60) | st.text(
    alphabet="GgXxNOo/ \t019.+-()%;#[]=<>*WHILEDOTSUBCALRNGMPX\x00\n\u0444", max_size=40
).map(str.encode)
programs = st.lists(st.sampled_from(FRAGMENTS.split("|")).map(str.encode) | hostile, max_size=14)


@given(programs, st.sampled_from(("auto", "linuxcnc", "fanuc")), st.booleans())
@thorough
def test_any_bytes_give_plain_lines_or_one_error(program: list[bytes], dialect: str, deleted: bool) -> None:
    expander = Expander(dialect, SMALL, block_delete=deleted)  # type: ignore[arg-type]
    refused: ExpandError | None = None
    try:
        for expanded in expander.expand(program):
            assert 1 <= expanded.line <= len(program)
            assert parse_block(expanded.text).faults == ()
            assert "\n" not in expanded.text
    except ExpandError as error:
        refused = error
    if refused is not None:
        assert refused.line >= 1
        assert refused.column >= 1
        assert refused.code
        assert refused.message


def test_a_loop_that_repeats_itself_is_not_taken_for_an_endless_one() -> None:
    """The same turn again and again, but counted: by a repeat, by an inner loop, by calls."""
    twice = "o1 repeat [3]\no2 repeat [2]\nX1\no2 endrepeat\no1 endrepeat"
    assert [line.text for line in Expander().expand(MemoryProgram(twice.encode().splitlines()))] == ["X1"] * 6
    called = "o9 sub\no1 repeat [2]\nX1\no1 endrepeat\no9 endsub\no2 repeat [2]\no9 call\no2 endrepeat"
    assert [line.text for line in Expander().expand(MemoryProgram(called.encode().splitlines()))] == ["X1"] * 4
