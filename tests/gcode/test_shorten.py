"""The bytes of many lines are those that the writers of single blocks give."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcode.clean import DROPPED_LETTERS, clean
from gcode.columns import read_columns
from gcode.lines import split_lines
from gcode.shorten import texts
from gcode.words import decode_line, parse_block, shortest
from tests.harness.effort import more
from tests.harness.programs import corpus_files, program_lines, thorough

numbers = st.tuples(
    st.sampled_from(("", "-", "+")),
    st.text("0012", max_size=5),
    st.sampled_from(("", ".")),
    st.text("0012", max_size=5),
).map("".join)
words = st.tuples(st.sampled_from("XYZNG"), numbers).map("".join)
odd = st.sampled_from(("/X01.50", "O0012", "X1 Y", ":05", "%", "", "(a)", "X0." + "0" * 400 + "1", "X0000000000001.50"))
lines = st.one_of(st.lists(words, max_size=5).map("".join), program_lines, odd)


def expected(piece: bytes, kept: list[bool], *, shorten: bool) -> list[str]:
    rows, at = [], 0
    for raw in split_lines([piece]):
        block = parse_block(decode_line(raw))
        chosen = [word for word, keep in zip(block.words, kept[at:], strict=False) if keep]
        rows.append("".join(word.letter + (shortest(word.text) if shorten else word.text) for word in chosen))
        at += len(block.words)
    return rows


@given(st.lists(lines, max_size=8), st.booleans(), st.randoms(use_true_random=False))
@thorough
def test_rows_are_written_as_word_by_word(program: list[str], shorten: bool, random: object) -> None:
    piece = "\n".join(program).encode()
    columns = read_columns(piece)
    kept = [random.random() < 0.8 for _ in columns.row]  # type: ignore[attr-defined]
    written, sizes = texts(columns, np.array(kept, np.bool_), shorten=shorten)
    assert written == expected(piece, kept, shorten=shorten)
    assert sizes.tolist() == [len(text) for text in written]


@pytest.mark.parametrize(
    "number",
    [
        *("0", "00", "-0", "+0", ".0", "-.0", ".000", "0.", "-0.0", "000.000", "007", "-007.", "100", "1000.", "10.0"),
        *("+5", "+.5", "-.5", "0.5", "00.5", "-00.50", "5.", "5.050", "0.001", "100.100", "123456789.000000000000000"),
    ],
)
def test_a_number_is_as_short_as_that_of_a_word(number: str) -> None:
    columns = read_columns(f"G1X{number}Y2.50\n".encode())
    assert texts(columns, np.ones(3, np.bool_))[0] == [f"G1X{shortest(number)}Y2.5"]


@pytest.mark.slow
def test_the_corpus_is_cleaned_as_block_by_block() -> None:
    for path in corpus_files():
        raw = path.read_bytes()[: more(20_000)]
        columns = read_columns(raw)
        kept = ~np.isin(columns.letter, [ord(letter) for letter in DROPPED_LETTERS])
        blocks = [parse_block(decode_line(line)) for line in raw.splitlines()]
        assert texts(columns, kept, shorten=False)[0] == [clean(block) for block in blocks], path.name
