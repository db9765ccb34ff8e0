"""Fanuc's macro statements, subprograms and macro calls, on small programs of our own."""

import pytest

from gcode.expand.expander import Expander, ExpandError, Limits


def lines(program: str, **settings: object) -> list[str]:
    expander = Expander("fanuc", **settings)  # type: ignore[arg-type]
    return [expanded.text for expanded in expander.expand(program.encode().splitlines())]


def refusal(program: str, **settings: object) -> tuple[str, int, int]:
    with pytest.raises(ExpandError) as caught:
        lines(program, **settings)
    return caught.value.code, caught.value.line, caught.value.column


@pytest.mark.parametrize(
    ("program", "wanted"),
    [
        ("#1=0\nWHILE[#1LT3]DO1\nG1X#1\n#1=#1+1\nEND1\nM30", ["G1 X0", "G1 X1", "G1 X2", "M30"]),
        ("#1=3 WHILE [ #1 GT 0 ] DO1 #1= #1 - 1 X#1 END1", ["X2", "X1", "X0"]),
        ("#1=2\nN10 X#1\n#1=#1-1\nIF[#1GE0]GOTO10\nM30", ["N10 X2", "N10 X1", "N10 X0", "M30"]),
        ("GOTO 5\nX1\nN5 X2", ["N5 X2"]),
        ("#1=5\nGOTO#1\nX1\nN5X2", ["N5X2"]),
        ("#1=4\nIF [#1 GT 3] THEN #1=3\nX#1", ["X3"]),
        ("DO1\n#1=#1+1\nIF[#1 EQ 3]GOTO9\nEND1\nN9 X#1", ["N9 X3"]),
        # A decimal control takes a tenth away ten times and stands at -1.
        ("#1=0\n#2=0\nWHILE[#1 GT -1]DO1\n#1=#1-0.1\n#2=#2+1\nEND1\nX#2", ["X10"]),
        # Null: not there in a word, 0 in arithmetic, unequal to 0.
        ("G0X#1Y5", ["G0 Y5"]),
        ("X[#1+2]", ["X2"]),
        ("IF[#1 EQ #0]THEN #2=1\nIF[#1 EQ 0]THEN #2=2\nX#2", ["X1"]),
        ("#1=7\n#1=#0\nX#1Y1", ["Y1"]),
        ("X FIX[-2.5] Y FUP[-2.5] Z ROUND[-2.5]", ["X-2 Y-3 Z-3"]),
        ("X ATAN[-1]/[-1] Y ASIN[-0.5] Z ATAN[1]", ["X225 Y330 Z45"]),
        ("X[7 OR 8] Y[6 AND 3] Z[7 XOR 2] W[-7 MOD 3]", ["X15 Y2 Z5 W-1"]),
        ("#500 = 800. (PODA4A)\nF#500 (F)", ["F800 (F)"]),
        ("#3006=1 (TURN THE PART)\nM30", ["M0 (TURN THE PART)", "M30"]),
    ],
)
def test_macro_statements(program: str, wanted: list[str]) -> None:
    assert lines(program) == wanted


def test_subprograms() -> None:
    program = "O1 (MAIN)\nG0 X0 M98 P1000 L2\nM98 P31000\nM30\nO1000\nG91 X1\nM99\n"
    assert lines(program) == ["(MAIN)", "G0 X0", *["G91 X1"] * 5, "M30"]


def test_a_subprogram_shares_the_parameters_of_its_caller_and_a_macro_does_not() -> None:
    assert lines("#1=5\nM98P7\nX#1\nM30\n:7\n#1=#1+1\nM99") == ["X6", "M30"]
    macro = "#1=5\nG65 P7 A1.5 Z-2 L2\nX#1\nM30\nO7\nX#1 Z#26\n#1=9\nM99"
    assert lines(macro) == ["X1.5 Z-2", "X1.5 Z-2", "X5", "M30"]


def test_return_to_a_line() -> None:
    assert lines("M98 P7\nX1\nN5 X2\nM30\nO7\nX9\nM99 P5") == ["X9", "N5 X2", "M30"]


@pytest.mark.parametrize(
    ("program", "wanted"),
    [
        ("M98", ("m98_target", 1, 1)),
        ("X1 M98 P5", ("m98_target", 1, 4)),
        ("M98 P5 L0\nM30\nO5\nM99", ("m98_target", 1, 1)),
        ("G65 P5 G1\nM30\nO5\nM99", ("macro_arguments", 1, 8)),
        ("G66 P5", ("unsupported", 1, 1)),
        ("X1\nM99", ("endless", 2, 1)),
        ("M98 P5\nM30\nO5\nX1", ("not_closed", 4, 1)),
        ("O1\nX1\nO5\nX1\nM99", ("not_closed", 3, 1)),
        ("O1\nM30\nO1\nM99", ("label_twice", 3, 1)),
        ("GOTO 7", ("goto_target", 1, 1)),
        ("GOTO 7\nN7 X1\nN7 X2", ("goto_target", 1, 1)),
        ("GOTO 7\nWHILE[1]DO1\nN7 X1\nEND1", ("goto_target", 1, 1)),
        ("WHILE[1]DO1", ("not_closed", 1, 1)),
        ("X1\n END1", ("not_nested", 2, 2)),
        ("WHILE[1]DO1\nDO2\nEND1\nEND2", ("not_nested", 3, 1)),
        ("IF[#1 EQ 1 AND #2 EQ 2]GOTO1", ("ambiguous_condition", 1, 12)),
        ("IF[1]X5", ("bad_statement", 1, 6)),
        ("WHILE[1]DO4", ("bad_statement", 1, 11)),
        ("X[1/0]", ("division_by_zero", 1, 4)),
        ("X#50", ("bad_parameter", 1, 2)),
        ("#0=1", ("bad_parameter", 1, 1)),
        ("X#5001", ("machine_parameter", 1, 2)),
        ("#5001=1", ("machine_parameter", 1, 1)),
        ("#3000=1 (NO TOOL)", ("alarm", 1, 1)),
        ("o100 if [1]\no100 endif", ("other_dialect", 1, 1)),
    ],
)
def test_refusals(program: str, wanted: tuple[str, int, int]) -> None:
    assert refusal(program) == wanted


def test_loops_and_calls_end() -> None:
    small = Limits(max_iterations=50, max_depth=5, max_steps=500, max_lines_out=20)
    assert refusal("DO1\n#1=#1+1\nEND1", limits=small)[0] == "too_many_iterations"
    assert refusal("N1 GOTO 1", limits=small)[0] == "endless"
    assert refusal("N1 #1=#1+1\nGOTO 1", limits=small)[0] == "too_many_iterations"
    assert refusal("M98 P7\nM30\nO7\nM98 P7\nM99", limits=small)[0] == "too_deep"
    assert refusal("M98 P7 L30\nM30\nO7\nX1\nM99", limits=small)[0] == "too_many_lines"
    assert refusal("DO1\n" + "#1=1\n" * 30 + "END1", limits=small)[0] == "too_many_steps"
