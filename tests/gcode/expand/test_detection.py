"""Whether a program has to be expanded: fast, and never "plain" when it is not."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcode.expand.detection import needs_expansion
from gcode.expand.expander import Expander, ExpandError
from gcode.words import parse_block
from tests.harness.programs import corpus_files, program_lines, quick, thorough


@pytest.mark.parametrize(
    "line",
    [
        "G1 X#1", "#1=5", "# 1 = 5", "#<a> = 1", "##1=2", "X[1+2]", "o100 sub", "O<a> CALL [1]", "o 1 0 0 i f [1]",
        "o#1 call", "WHILE[1]DO1", "end 1", "W H I L E [1] DO1", "GOTO 5", "IF[1]GOTO5", "M98 P5", "m 9 8 p5", "M099",
        "M98. P1", "G65 P5", "g 6 5", "/#1=5", "N5 #1=5", "(a) o1 call", "G1 X#1 (open", "#1 (c) = 5", "X1 (a) [",
        "(a;(b) X#1", "g006 5", "G00065P1", "I(a)F [1] THEN", "M(a)0 9(b)8 P1", "e n d 1", "x1 i f",
    ],
)  # fmt: skip
def test_found(line: str) -> None:
    assert needs_expansion([line.encode()])
    assert needs_expansion([b"G1 X1\n" * 1000 + line.encode() + b"\r\nG1 X2\n"])


@pytest.mark.parametrize(
    "line",
    [
        "", "G1 X1 Y-2.5 F100", "O1234 (PART #5)", ":77", "(o100 sub [1])", "; #1=5", "% #1=5", "// x[1]",
        "# 4mm [square]", "M8 M9", "G1 (open #1", "M980", "N98",
        "(M98 P1)", "G06 X5", "G0", "G00", "G61 X5.65", "I1 F5", "; O100 sub (", "G1 E5 N", "M8 9",
    ],
)  # fmt: skip
def test_plain(line: str) -> None:
    assert not needs_expansion([line.encode()])


@given(st.text(alphabet="GgMXNOo/ \t0123456789.+-()%;#[]=:<>WHILEDFTSUB", max_size=40) | program_lines)
@thorough
def test_what_is_called_plain_is_read_without_any_of_it(text: str) -> None:
    if not needs_expansion([text.encode()]):
        codes = {fault.code for fault in parse_block(text).faults}
        if not codes & {"unclosed_comment"}:
            assert not codes & {"expression", "flow", "macro"}


@given(st.lists(program_lines, max_size=12))
@thorough
def test_plain_programs_pass_through(program: list[str]) -> None:
    raw = [line.encode() for line in program]
    assert not needs_expansion(raw)
    try:
        expanded = list(Expander("linuxcnc").expand(raw))
    except ExpandError:
        return
    for each in expanded:
        words = [word[:3] for word in parse_block(each.text).words]
        assert words == [word[:3] for word in parse_block(program[each.line - 1]).words if word.letter != "O"]


@pytest.mark.parametrize(
    "line", ["G1 X1.5 Y2 F100", "G02 X1 I-2 J0.5", "G01X6.65Y5", "N10 G0 X66", "g1 x1 (a b) e2 ; of"]
)
@given(number=st.integers(0, 400), found=st.sampled_from(["#1=2", "o1 call", "g 0 65 p1", "M98P1", "if [1] then #1=2"]))
@quick
def test_one_line_among_many(line: str, number: int, found: str) -> None:
    lines = [line] * 400
    assert not needs_expansion(["\r\n".join(lines).encode()])
    lines.insert(number, found)
    assert needs_expansion(["\r\n".join(lines).encode()])


def test_only_those_of_the_corpus() -> None:
    found = {path.name for path in corpus_files() if needs_expansion([path.read_bytes()])}
    if not found:
        pytest.skip("the corpus is not here")
    assert {"fanuc_macro_inline_while.nc", "camotics_test_ElseIf.ngc", "lcnc_g76base.ngc"} <= found
    assert not {"lfirig_hash.gcode", "lcnc_cds.ngc", "pcb2gcode_drill.ngc", "camotics_compass.ngc"} & found
