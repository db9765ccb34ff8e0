"""The fast reader gives what the careful one gives, line by line, whatever the bytes."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcode.clean import clean
from gcode.columns import BITE_BYTES, Columns, messages_of, read_columns
from gcode.lines import MAX_LINE_BYTES
from gcode.words import decode_line, parse_block, parse_carefully
from tests.harness.effort import more
from tests.harness.programs import corpus_files, program_lines, thorough

# Pieces of lines that meet every branch of the grammar, often enough in lines that are nearly right.
FRAGMENTS = (
    *("G1", "g01.50", "X12.345", "Y-67.890", "z-.5", "X+0", "X-0", "Y-0.0", "X5.", "X.", "X-", "X-.", "X--5", "Z+-1"),
    *("1e5", "X1.2e-15", "X1.2.3", "X.5.", "F", "F1500", "N10", "O1234", ":77", "o100 sub", "o<name> call", "N"),
    *("X123456789", "X1234567890", "X0000000001.5", "X123456789.123456789012345", "X1.1234567890123456", "X.1234567"),
    *("X12345678", "X-1234567.8", "X9007199254740993", "X0.30000000000000004", "X1.005", "X99999.99999999999"),
    *("A1.0000000000000001", "Y.000000000000001", "X 1 2 . 3", "X- 5", "\tY\t7", " ", "/", "/3", "%", "//", "#1=5"),
    *("# text", "X#3", "X[1+2]", "$H", "!", "~", "?", "=", ",", "\x00", "\x0b", "\x85", "é", "Фреза", "\ufeff", "ſ5"),
    *("(a)", "(", ")", "(a (b) c)", "; to the end", "(MSG, change tool)", "( m s g ,x)", "(MSG,", "(фреза)", "X(b)5"),
    *("IF", "GOTO", "WHILE [1]", "DO1", "END1", "THEN", "\r", "(;)", ";(", "5", "1.5", "٣"),
)
MAX_BYTES = more(100_000)
"""Of each file of the corpus: seven are longer, with lines of the same few shapes to their end."""

LINE_ENDS = ("\n", "\n", "\n", "\r\n", "\r", "\n\n")
fragment_lines = st.lists(st.sampled_from(FRAGMENTS), max_size=5).map("".join)
lines = st.one_of(fragment_lines, program_lines, st.text(max_size=12))
texts = st.lists(st.tuples(lines, st.sampled_from(LINE_ENDS)).map("".join), max_size=8).map("".join)


def assert_as_read_carefully(piece: bytes, encoding: str = "utf-8") -> Columns:
    columns = read_columns(piece, 1, encoding)
    raws = piece.splitlines()
    assert columns.lines == len(raws)
    words, faults, deleted, messages, sent = [], [], [], [], []
    for row, raw in enumerate(raws):
        text = decode_line(raw, encoding)
        block = parse_carefully(text)
        words += [(row, word.letter, word.value, math.copysign(1, word.value), word.text) for word in block.words]
        faults += [(row, fault) for fault in block.faults]
        deleted += [row] * block.deleted
        messages += [(row, message) for message in messages_of(text)]
        sent.append(len(clean(block)))
        assert columns.raw_line(row) == raw
    assert words_in(columns) == words
    assert columns.faults == faults
    assert columns.deleted.tolist() == deleted
    assert columns.messages == messages
    assert columns.sent_bytes().tolist() == sent
    return columns


def words_in(columns: Columns) -> list[tuple[int, str, float, float, str]]:
    starts, ends = columns.start.tolist(), columns.end.tolist()
    texts = [columns.text[start:end].decode() for start, end in zip(starts, ends, strict=True)]
    values = columns.value.tolist()
    signs = [math.copysign(1, value) for value in values]
    return list(zip(columns.row.tolist(), map(chr, columns.letter.tolist()), values, signs, texts, strict=True))


def shown(text: str) -> list[str]:
    """Words of a text as strings: letter and number as written."""
    return [letter + number for _, letter, _, _, number in words_in(read_columns(text.encode()))]


@given(st.binary(max_size=60))
@thorough
def test_any_bytes(piece: bytes) -> None:
    assert_as_read_carefully(piece)


@given(st.text(alphabet="GXNOo/ \t0123456789.+-();\n\r%#:é", max_size=60))
@thorough
def test_any_characters_of_lines(text: str) -> None:
    assert_as_read_carefully(text.encode())


@given(texts, st.sampled_from(("utf-8", "cp1251", "latin-1", "utf-16-le", "johab", "cp037")))
@thorough
def test_lines_nearly_right_in_any_encoding(text: str, encoding: str) -> None:
    assert_as_read_carefully(text.encode("utf-8"), encoding)
    assert_as_read_carefully(text.encode(encoding, "replace"), encoding)


@given(
    st.lists(
        st.tuples(
            st.sampled_from(("", "-", "+")), st.text("0123456789", max_size=11), st.text("0123456789.", max_size=18)
        ).map("".join),
        max_size=6,
    )
)
@thorough
def test_numbers_are_those_of_float(numbers: list[str]) -> None:
    assert_as_read_carefully("".join(f"X{number}\nY1 Z{number}F2\n" for number in numbers).encode())


@given(texts)
@thorough
def test_lines_do_not_depend_on_their_neighbours(text: str) -> None:
    raws = text.encode().splitlines()
    whole = read_columns(b"\n".join(raws))
    single = [[word[1:] for word in words_in(read_columns(raw))] for raw in raws]
    all_words = words_in(whole)
    for row in range(whole.lines):
        assert [word[1:] for word in all_words[whole.words_of(row)]] == single[row]


def test_more_than_a_bite() -> None:
    usual = "".join(
        f"X{n / 1000:.3f} Y-{n}.5\r\n" if n % 1000 else "O5 IF (MSG, now)\r\n/X1 X\r\n" for n in range(25_000)
    )
    piece = usual.encode()
    assert len(piece) > 2 * BITE_BYTES
    assert_as_read_carefully(piece)


def test_a_line_longer_than_a_bite() -> None:
    assert_as_read_carefully(b"X1\n" + b"Y2" * BITE_BYTES + b"\nZ3\n" + b"Z4 " * 10)


@pytest.mark.parametrize(
    "hostile", [b"(", b"(;", b"((;)", b"(MSG,", b"(MSG,)", b";(", b")", b"-", b".", b"1", b"X", b"#"]
)
def test_the_time_for_a_line_grows_with_its_length_only(hostile: bytes) -> None:
    columns = read_columns(b"X1\n" + hostile * (MAX_LINE_BYTES // len(hostile)) + b"\nX2\n")
    assert columns.lines == 3
    assert columns.value.tolist()[0 :: len(columns.value) - 1] == [1, 2]


def test_lines_are_numbered_from_the_first() -> None:
    columns = read_columns(b"G0\n\nG1 X5\n", 100)
    assert (columns.first_line, columns.lines) == (100, 3)
    assert columns.row.tolist() == [0, 2, 2]
    assert columns.words_of(1) == slice(1, 1)
    assert columns.words_of(2) == slice(1, 3)


def test_the_block_of_a_line_has_columns() -> None:
    columns = read_columns(b"G0 X1\r\n(a) g1  x--5\n")
    assert columns.block(1) == parse_carefully("(a) g1  x--5")
    with pytest.raises(IndexError):
        columns.raw_line(2)


def test_nothing_has_no_lines() -> None:
    assert read_columns(b"").lines == 0
    assert read_columns(b"\n").lines == 1
    assert read_columns(b"  ").lines == 1


def test_an_unknown_encoding_is_an_error() -> None:
    with pytest.raises(LookupError):
        read_columns(b"G0\n", 1, "no such thing")


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        # The rows of rs274 §1, one by one.
        pytest.param("G0 X1" + " " * 300 + "Y2", ["G0", "X1", "Y2"], id="line length"),
        pytest.param("G0\rX1\nY2\r\nZ3", ["G0", "X1", "Y2", "Z3"], id="end of line"),
        pytest.param("g0x1", ["G0", "X1"], id="case"),
        pytest.param("G0X +0. 12 34Y\t7", ["G0", "X+0.1234", "Y7"], id="blanks"),
        pytest.param("/G0 X1\n/3 G1", ["G0", "X1", "G1"], id="block delete"),
        pytest.param("N100 G0\nG1 N7", ["N100", "G0", "G1", "N7"], id="N word"),
        pytest.param("%\n % vfd enable\nG0\n%%", ["G0"], id="program marker"),
        pytest.param("O1234 (PART)\n:77", ["O1234", "O77"], id="program number"),
        pytest.param("G1 (a) X(b)5 (G0", ["G1", "X5"], id="comment in brackets"),
        pytest.param("G1 X5 ; G0 (x\nY1", ["G1", "X5", "Y1"], id="comment to the end of the line"),
        pytest.param("// G0\n# G0\nG1", ["G1"], id="other comments"),
        pytest.param("X1 Y#1", ["X1"], id="word"),
        pytest.param("A5 B5. C.5 X+.5 Y-0 Z007", ["A5", "B5.", "C.5", "X+.5", "Y-0", "Z007"], id="number"),
        pytest.param("X1.2e-15", ["X1.2", "E-15"], id="no exponent"),
        pytest.param("G1.0 M3.", ["G1.0", "M3."], id="integers"),
        pytest.param("X1 G0 (a) F5", ["X1", "G0", "F5"], id="order on a line"),
        pytest.param("X1 X2 G0 G1", ["X1", "X2", "G0", "G1"], id="duplicates"),
        pytest.param("\n(x)\n \n;\n", [], id="blank and comment-only lines"),
        pytest.param("(фреза) X1 ; \u0445", ["X1"], id="characters beyond ASCII"),
    ],
)
def test_lexical_rules(text: str, expected: list[str]) -> None:
    assert shown(text) == expected
    assert_as_read_carefully(text.encode())


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("(MSG, change tool)", ["change tool"]),
        ("G0 (a) ( m s g , x ) M0 (MSG,y)", ["x", "y"]),
        ("/ M0 (MSG, deleted too)", ["deleted too"]),
        ("O100 IF (MSG,unusual)", ["unusual"]),
        ("(see (MSG, not this)", []),
        ("; (MSG, not this)", []),
        ("(MSG, not this", []),
        ("% (MSG, not this)", []),
        ("// (MSG, not this)", []),
        ("# (MSG, not this)", []),
        ("#1=5 (MSG,this)", ["this"]),
        ("(MSGX, not this)", []),
        ("(MSG)", []),
        ("(MSG, Фреза)", ["Фреза"]),
    ],
)
def test_messages(text: str, expected: list[str]) -> None:
    assert messages_of(text) == expected
    assert read_columns(f"X1\n{text}\n".encode()).messages == [(1, message) for message in expected]


def test_a_message_is_read_in_the_encoding_of_the_file() -> None:
    assert read_columns("(MSG, Фреза)".encode("cp1251"), 1, "cp1251").messages == [(0, "Фреза")]
    assert read_columns("(MSG, Фреза)".encode("cp866"), 1, "cp866").messages == [(0, "Фреза")]


@pytest.mark.slow
def test_the_corpus_is_read_as_line_by_line() -> None:
    for path in corpus_files():
        piece = path.read_bytes()[:MAX_BYTES]
        columns = read_columns(piece)
        # parse_block, for its speed: test_corpus.py compares it with the careful reader.
        blocks = [parse_block(decode_line(raw)) for raw in piece.splitlines()]
        words = [(row, word) for row, block in enumerate(blocks) for word in block.words]
        assert columns.lines == len(blocks), path.name
        assert columns.row.tolist() == [row for row, _ in words], path.name
        assert columns.letter.tobytes().decode() == "".join(word.letter for _, word in words), path.name
        assert columns.value.tobytes() == np.array([word.value for _, word in words], np.float64).tobytes(), path.name
        ranges = zip(columns.start.tolist(), columns.end.tolist(), strict=True)
        assert [columns.text[start:end].decode() for start, end in ranges] == [word.text for _, word in words]
        assert columns.faults == [(row, fault) for row, block in enumerate(blocks) for fault in block.faults]
        assert columns.deleted.tolist() == [row for row, block in enumerate(blocks) if block.deleted]
