"""Lines to pieces, and what bytes say of themselves: chunks of any size say the same."""

import hashlib
from itertools import chain

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcode.check.source import PIECE_BYTES, Fingerprint, gather, gather_numbered
from gcode.lines import MAX_LINE_BYTES
from tests.harness.programs import thorough


def fingerprint(chunks: list[bytes], encoding: str = "utf-8") -> Fingerprint:
    found = Fingerprint(encoding)
    assert b"".join(found.through(chunks)) == b"".join(chunks)
    return found


@pytest.mark.parametrize(
    ("text", "encoding", "line_ends"),
    [
        (b"", "ascii", "none"),
        (b"G1", "ascii", "none"),
        (b"G1\nG2\n", "ascii", "lf"),
        (b"G1\r\nG2\r\n", "ascii", "crlf"),
        (b"G1\rG2\r", "ascii", "cr"),
        (b"G1\r\nG2\n", "ascii", "mixed"),
        (b"G1\n\rG2", "ascii", "mixed"),
        (b"\xef\xbb\xbfG1\n", "utf-8 with BOM", "lf"),
        ("(фреза)\n".encode(), "utf-8", "lf"),
        ("(фреза)\n".encode("cp1251"), "cp1251", "lf"),
        ("(ф".encode()[:-1], "cp1251", "none"),
    ],
)
def test_what_bytes_say(text: bytes, encoding: str, line_ends: str) -> None:
    for size in (1, 2, 3, 100):
        found = fingerprint([text[at : at + size] for at in range(0, len(text), size)])
        assert (found.encoding, found.line_ends) == (encoding, line_ends)
        assert (found.bytes, found.sha256) == (len(text), hashlib.sha256(text).hexdigest())


def test_the_encoding_that_was_told_is_the_one_that_is_read_instead() -> None:
    assert fingerprint(["(фреза)".encode("koi8-r")], "koi8-r").encoding == "koi8-r"


@given(st.lists(st.binary(max_size=20), max_size=20))
@thorough
def test_every_line_is_a_line_again(lines: list[bytes]) -> None:
    text = b"".join(piece.text for piece in gather(lines))
    assert text.count(b"\n") == len(lines)
    assert b"\r" not in text
    assert [piece.numbers for piece in gather(lines)] == [None] * bool(lines)
    numbered = list(gather_numbered([(number * 3, line) for number, line in enumerate(lines)]))
    assert b"".join(piece.text for piece in numbered) == text
    assert [int(number) for piece in numbered for number in (piece.numbers if piece.numbers is not None else ())] == [
        3 * number for number in range(len(lines))
    ]


def test_pieces_are_bounded() -> None:
    pieces = list(gather([b"x" * 99] * 40_000))
    assert [len(piece.text) // PIECE_BYTES for piece in pieces[:-1]] == [1] * (len(pieces) - 1)
    assert sum(len(piece.text) for piece in pieces) == 4_000_000
    numbered = list(gather_numbered((line, b"x" * 99) for line in range(40_000)))
    numbers = chain.from_iterable(piece.numbers for piece in numbered if piece.numbers is not None)
    assert np.array_equal(list(numbers), np.arange(40_000))


def test_a_line_that_is_too_long_stands_empty() -> None:
    (piece,) = gather([b"G1", b"(" * (MAX_LINE_BYTES + 1), b"G2"])
    assert (piece.text, piece.too_long) == (b"G1\n\nG2\n", (1,))
