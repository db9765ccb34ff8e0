"""Inches as millimetres: the columns say what the converter of blocks says, value by value and byte by byte."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcode.check.millimetres import Converter
from gcode.clean import clean
from gcode.columns import read_columns
from gcode.inches import InchConverter
from tests.harness.checks import checked, found, level_of
from tests.harness.programs import quick

words = st.builds(
    lambda letter, number: letter + number,
    st.sampled_from("XYZIJKRQFASN"),
    st.sampled_from(("0", "-0", "1", "+1.", "-.5", "3.937", "3.93701", "39.37007", "0.0393701", "1000", "-399.999")),
)
units = st.sampled_from(("G20", "G21", "g20.", "G020", "G20 G21"))
lines = st.lists(words | units, max_size=5).map(" ".join)


@given(st.lists(st.lists(lines, max_size=5), max_size=4))
@quick
def test_columns_are_the_converted_blocks(pieces: list[list[str]]) -> None:
    converter, reference = Converter(), InchConverter()
    for piece in pieces:
        plain = read_columns("".join(line + "\n" for line in piece).encode())
        columns = converter.convert(plain)
        sent = columns.sent_bytes()
        for row in range(plain.lines):
            block = reference.convert(plain.block(row))
            assert columns.block(row) == block
            assert sent[row] == len(clean(block))
            place = columns.words_of(row)
            assert [chr(letter) for letter in columns.letter[place]] == [word.letter for word in block.words]
            np.testing.assert_allclose(columns.value[place], [word.value for word in block.words], rtol=1e-15)


def test_a_program_in_mm_stays_as_it_is() -> None:
    columns = read_columns(b"G21\nG1 X5\n")
    assert Converter().convert(columns) is columns


def test_g20_is_an_info_where_it_is_converted() -> None:
    program = "G90 G20|M3 S1|G0 X1 Y1 Z1|G1 X2 F10|M30"
    report = checked(program, "elvinto", convert_inches=True)
    assert level_of(report, "converted") == "info"
    assert [(finding.line, finding.column) for finding in found(report, "converted")] == [(1, 5)]
    assert found(report, "unknown_code") == found(report, "units_not_set") == []
    assert report.bounds["x"] == pytest.approx((25.4, 50.8))
    assert report.feeds == (254.0,)


def test_findings_keep_the_columns_of_the_file() -> None:
    report = checked("G90 G20|G0 X1 Y1 Z1|G1 X2.123  E5 F10|M30", "elvinto", convert_inches=True)
    assert [(finding.line, finding.column) for finding in found(report, "unknown_word")] == [(3, 12)]
