"""Bytes to lines: every kind of line end, every way of cutting the bytes, bounded memory."""

import re
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcode.lines import MAX_LINE_BYTES, pieces, split_lines
from tests.harness.programs import quick, thorough


@pytest.mark.parametrize(
    ("data", "expected"),
    [
        (b"", []),
        (b"a", [b"a"]),
        (b"a\nb", [b"a", b"b"]),
        (b"a\r\nb\r\n", [b"a", b"b"]),
        (b"a\rb\r", [b"a", b"b"]),
        (b"a\n\r\nb\r\r\n", [b"a", b"", b"b", b""]),
        (b"\xef\xbb\xbfG21\n", [b"G21"]),
        (b"\xef\xbb", [b"\xef\xbb"]),
        (b"a\x0bb\x85c\n", [b"a\x0bb\x85c"]),
    ],
)
def test_line_ends(data: bytes, expected: list[bytes]) -> None:
    assert list(split_lines([data])) == expected


@given(st.lists(st.binary(max_size=6) | st.sampled_from((b"\r", b"\n", b"\r\n", b"\xef\xbb\xbf", b"G1")), max_size=12))
@thorough
def test_where_the_bytes_are_cut_does_not_matter(chunks: list[bytes]) -> None:
    whole = b"".join(chunks).removeprefix(b"\xef\xbb\xbf")
    expected = re.split(rb"\r\n|\r|\n", whole)
    if not expected[-1]:
        expected.pop()
    assert list(split_lines(chunks)) == expected
    assert list(split_lines([bytes([byte]) for byte in b"".join(chunks)])) == expected


def test_a_line_without_end_does_not_grow_for_ever() -> None:
    lines = list(split_lines(b"x" * 10_000 for _ in range(100)))
    assert sum(map(len, lines)) == 1_000_000
    assert [len(line) for line in lines] == [MAX_LINE_BYTES + 1] * 3 + [1_000_000 - 3 * (MAX_LINE_BYTES + 1)]


LONGEST = b"x" * (MAX_LINE_BYTES + 1)
long_lines = st.sampled_from((LONGEST[1:], LONGEST, LONGEST + b"y", LONGEST * 2, LONGEST * 2 + b"y"))
short_lines = st.sampled_from((b"", b"G1", b"a" * 10_000))
ends = st.sampled_from((b"\n", b"\r\n", b"\r", b"\n\r"))


@given(
    st.lists(st.tuples(short_lines | long_lines, ends).map(b"".join), max_size=5),
    st.booleans(),
    st.sampled_from((1, 7, 1_000, 70_000, 1 << 20)),
    st.sampled_from((1 << 10, 1 << 16, MAX_LINE_BYTES, MAX_LINE_BYTES + 1, 1 << 22)),
)
@quick
def test_pieces_are_whole_lines_however_the_bytes_were_cut(
    texts: list[bytes], ended: bool, size: int, chunk_bytes: int
) -> None:
    data = b"".join(texts)
    data = data if ended else data.rstrip(b"\r\n")
    found = list(pieces([data], size))
    assert b"".join(found) == data
    assert list(pieces(chunks_of(data, chunk_bytes), size)) == found
    assert [line for piece in found for line in piece.splitlines()] == in_parts(data)
    assert list(split_lines(chunks_of(data, chunk_bytes))) == in_parts(data)
    for piece, following in pairwise(found):
        assert piece.endswith((b"\n", b"\r")) or piece == LONGEST
        assert not (piece.endswith(b"\r") and following.startswith(b"\n"))
        # The last line end begins within the size; where it is two bytes, the second may lie behind.
        assert len(piece) <= size + piece.endswith(b"\r\n") or len(piece.splitlines()) == 1


def chunks_of(data: bytes, size: int) -> list[bytes]:
    return [data[at : at + size] for at in range(0, len(data), size)]


def in_parts(data: bytes) -> list[bytes]:
    """Lines, those that are too long in parts."""
    return [part for line in data.splitlines() for part in chunks_of(line, len(LONGEST)) or [b""]]


@given(st.lists(st.binary(max_size=6) | st.sampled_from((b"\r", b"\n", b"\r\n", b"\xef\xbb\xbf", b"G1")), max_size=12))
@thorough
def test_small_pieces(chunks: list[bytes]) -> None:
    for size in (1, 2, 3, 8):
        found = list(pieces(chunks, size))
        assert b"".join(found) == b"".join(chunks).removeprefix(b"\xef\xbb\xbf")
        assert [line for piece in found for line in piece.splitlines()] == list(split_lines(chunks))
        assert all(found)
        # A byte more where the end is \r\n, which is never torn.
        assert all(len(piece) <= size + 1 or len(piece.splitlines()) == 1 for piece in found)


def test_pieces_are_nearly_as_long_as_asked_for() -> None:
    data = b"G1 X1.5\r\n" * 100_000
    assert [len(piece) for piece in pieces([data], 100_000)] == [99_999] * 9 + [9]
    assert [len(piece) for piece in pieces([b"\xef\xbb\xbf" + data])] == [900_000]
