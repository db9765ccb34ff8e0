"""The reader: every character of a line is a word, a comment, a blank or a fault."""

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcode.words import MAX_FAULTS, Word, code_name, decode_line, parse_block, parse_carefully, shortest
from tests.harness.programs import program_lines, thorough

hostile = st.text(alphabet="GgXxNOo/ \t0123456789.+-()%;#[]=!$~?:é\x00\n", max_size=40) | st.text(max_size=30)


def words(text: str) -> list[tuple[str, float]]:
    return [(word.letter, word.value) for word in parse_block(text).words]


def faults(text: str) -> list[tuple[int, str]]:
    return [(fault.column, fault.code) for fault in parse_block(text).faults]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("G1 X10.5", [("G", 1), ("X", 10.5)]),
        ("g0x1y-2", [("G", 0), ("X", 1), ("Y", -2)]),
        # rs274 §1: blanks mean nothing, not even inside a number.
        ("G0X +0. 12 34Y 7", [("G", 0), ("X", 0.1234), ("Y", 7)]),
        ("X 24.9", [("X", 24.9)]),
        ("X- 5", [("X", -5)]),
        ("X5. Y.5 Z+.5 A-0 B007", [("X", 5), ("Y", 0.5), ("Z", 0.5), ("A", 0), ("B", 7)]),
        ("N100 G1 (fast) X1 ; slow Y2", [("N", 100), ("G", 1), ("X", 1)]),
        ("G1 (a) X(b)5", [("G", 1), ("X", 5)]),
        ("O1234 (PART)", [("O", 1234)]),
        (":77", [("O", 77)]),
        ("X1.2e-15", [("X", 1.2), ("E", -15)]),
        ("W90", [("W", 90)]),
    ],
)
def test_words(text: str, expected: list[tuple[str, float]]) -> None:
    assert words(text) == expected
    assert faults(text) == []


@pytest.mark.parametrize(
    "text", ["", "   ", "%", " % vfd enable", "%%", "(x)", "; G0 X5", "// G0 X5", "# 4mm square", "## title"]
)
def test_lines_without_words(text: str) -> None:
    block = parse_block(text)
    assert (block.words, block.faults, block.deleted) == ((), (), False)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("G1 X", [(4, "no_number")]),
        ("G1 X--5", [(4, "bad_number"), (6, "stray_number")]),
        ("X1.2.3", [(1, "bad_number")]),
        ("X.", [(1, "bad_number")]),
        ("X1000000000", [(1, "bad_number")]),
        ("5 X1", [(1, "stray_number")]),
        ("G1 (open", [(4, "unclosed_comment")]),
        ("G1 (a (b) c)", [(11, "no_number"), (12, "stray_bracket")]),
        ("G1 X1!", [(6, "realtime_character")]),
        ("~", [(1, "realtime_character")]),
        ("?", [(1, "realtime_character")]),
        ("$H", [(1, "system_command")]),
        ("G1 Xф5", [(4, "no_number"), (5, "not_ascii"), (6, "stray_number")]),
        ("X٣", [(1, "no_number"), (2, "not_ascii")]),
        ("ſ5", [(1, "not_ascii"), (2, "stray_number")]),
        ("G1 / X5", [(4, "stray_slash")]),
        ("#1=5", [(1, "expression")]),
        ("#<depth> = 5", [(1, "expression")]),
        ("G1 X[1+2]", [(5, "expression")]),
        ("G1 X#3 Y5", [(5, "expression")]),
        ("o100 sub", [(1, "flow")]),
        ("o<name> call [1]", [(1, "flow")]),
        ("WHILE [#1 LT 5] DO1", [(1, "macro")]),
        ("G1 X5\x00", [(6, "bad_character")]),
        ("X5,Y3", [(3, "bad_character")]),
    ],
)
def test_faults(text: str, expected: list[tuple[int, str]]) -> None:
    assert faults(text) == expected


def test_columns_are_those_of_the_line() -> None:
    assert [(w.letter, w.column) for w in parse_block("  (c) g1  x 5 (d) y6").words] == [("G", 7), ("X", 11), ("Y", 19)]
    assert [(w.letter, w.column) for w in parse_block("G1  X5 Y6").words] == [("G", 1), ("X", 5), ("Y", 8)]


@pytest.mark.parametrize("text", ["/G0 X1", " /G0 X1", "/3 G0 X1", "/"])
def test_block_delete(text: str) -> None:
    block = parse_block(text)
    assert block.deleted
    assert block.faults == ()
    assert [word.letter for word in block.words] == (["G", "X"] if "G" in text else [])


def test_faults_of_a_line_are_bounded() -> None:
    assert len(parse_block("!" * 5000).faults) == MAX_FAULTS


@given(hostile | program_lines)
@thorough
def test_any_text_is_read_and_nothing_is_lost(text: str) -> None:
    block = parse_block(text)
    for word in block.words:
        assert text[word.column - 1].upper() == word.letter or text[word.column - 1] == ":"
        assert float(word.text) == word.value
    if not block.faults and not text.lstrip(" \t\r\n").startswith(("%", "//", "#")):
        plain = re.sub(r"\([^)]*\)|;.*", "", text, flags=re.DOTALL)
        plain = re.sub(r"[ \t\r\n]", "", plain).upper().replace(":", "O")
        plain = re.sub(r"^/[1-9]?", "", plain)
        assert "".join(word.letter + word.text for word in block.words) == plain


@given(st.text(alphabet="GXYZFNO0123456789.+- ", max_size=30) | program_lines | hostile)
@thorough
def test_both_readers_read_the_same(text: str) -> None:
    assert parse_block(text) == parse_carefully(text)


@given(st.binary(max_size=60), st.sampled_from(("utf-8", "cp1251", "ascii")))
@thorough
def test_any_bytes_decode(raw: bytes, encoding: str) -> None:
    text = decode_line(raw, encoding)
    parse_block(text)
    assert not text.endswith(("\r", "\n"))


def test_decoding() -> None:
    assert decode_line("(\u0444)\r\n".encode()) == "(\u0444)"
    assert decode_line("(\u0444)".encode("cp1251")) == "(\u0444)"
    assert decode_line(b"\xef\xbb\xbfG21") == "G21"
    assert decode_line(b"(\x98\xff)") == "(\x98\xff)"


@pytest.mark.parametrize(
    ("text", "expected"),
    [("10.000", "10"), ("+5.", "5"), ("-0.0", "0"), (".50", ".5"), ("0.5", "0.5"), ("007.10", "7.1"), ("-.0", "0")],
)
def test_shortest_number(text: str, expected: str) -> None:
    assert shortest(text) == expected
    assert float(shortest(text)) == float(text)


@given(st.from_regex(r"[+-]?([0-9]{1,12}(\.[0-9]{0,12})?|\.[0-9]{1,12})", fullmatch=True))
@thorough
def test_shortest_number_is_the_same_number(text: str) -> None:
    short = shortest(text)
    assert float(short) == float(text)
    assert len(short) <= len(text)
    assert shortest(short) == short


def test_code_names() -> None:
    assert [code_name("G", text) for text in ("01", "1.0", "1", "81.99", "0", "-0")] == [
        "G1",
        "G1",
        "G1",
        "G81.99",
        "G0",
        "G0",
    ]
    assert Word("M", 6.0, "06", 1).code == "M6"


@pytest.mark.parametrize(
    "text", ["X" + "1" * 200_000 + "..", "#[" + " " * 100_000, "G1X1" * 20_000 + "!", "(" * 50_000]
)
def test_long_hostile_lines_take_no_time(text: str) -> None:
    """Patterns that backtrack would not come to an end here."""
    assert parse_block(text).faults or text.startswith("#")
