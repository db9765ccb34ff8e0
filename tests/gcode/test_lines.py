"""Bytes to lines: every kind of line end, every way of cutting the bytes, bounded memory."""

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcode.lines import MAX_LINE_BYTES, split_lines
from tests.harness.programs import thorough


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
    assert all(len(line) <= MAX_LINE_BYTES + 10_000 for line in lines)
    assert len(lines[0]) > MAX_LINE_BYTES
