"""Where lines begin, against the regular expression that a person would write; what is no text."""

import re
import struct
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcode.lines import MAX_LINE_BYTES
from jobs.linecount import LINES_PER_ENTRY, LineCounter, NotAProgramError

LINE_END = re.compile(rb"\r\n|\r|\n")


def counted(pieces: list[bytes]) -> tuple[int, list[int]]:
    """Lines, and where every LINES_PER_ENTRYth begins."""
    counter = LineCounter()
    entries = b"".join([*map(counter.feed, pieces), counter.finish()])
    return counter.lines, [offset for (offset,) in struct.iter_unpack("<Q", entries)]


def cut(data: bytes, size: int) -> list[bytes]:
    return [data[at : at + size] for at in range(0, len(data), size)]


ends = st.lists(st.sampled_from((b"\r", b"\n", b"\r\n", b"G1 X1", b"\t", b"\x1a\x1b\x0b\x0c", b"\xff")), max_size=40)


@given(ends, st.integers(1, 9))
def test_lines_are_counted_however_the_bytes_were_cut(parts: list[bytes], size: int) -> None:
    data = b"".join(parts)
    lines = len(LINE_END.findall(data)) + (re.search(rb"[^\r\n]\Z", data) is not None)
    assert counted(cut(data, size)) == counted([data]) == (lines, [])


@pytest.mark.parametrize("seed", range(10))
def test_the_entries_are_the_starts_of_lines(seed: int) -> None:
    data = b"".join(Random(seed).choices((b"\r", b"\n", b"\r\n", b"1\r\n", b"\r\r\n\n"), k=4 * LINES_PER_ENTRY))
    starts = [match.end() for match in LINE_END.finditer(data)]
    expected = starts[LINES_PER_ENTRY - 1 :: LINES_PER_ENTRY]
    for size in (len(data), 61, 1000):
        assert counted(cut(data, size))[1] == expected


@pytest.mark.parametrize("ends", [b"\n", b"\r\n", b"\r", b"\r\n\n", b"\n\r"])
@pytest.mark.parametrize("size", [1 << 20, 1000, 7])
def test_where_all_lines_end_alike_the_short_way_finds_the_same(ends: bytes, size: int) -> None:
    data = (b"G1 X1" + ends) * 2500 + b"M30"
    starts = [match.end() for match in LINE_END.finditer(data)]
    lines, entries = counted(cut(data, size))
    assert lines == len(starts) + 1
    assert entries == starts[LINES_PER_ENTRY - 1 :: LINES_PER_ENTRY]


@pytest.mark.parametrize("end", [b"\n", b"\r\n"])
def test_among_lines_that_end_alike_the_one_that_is_too_long_is_named(end: bytes) -> None:
    counter = LineCounter()
    counter.feed((b"G1" + end) * 3)
    with pytest.raises(NotAProgramError, match="line 6 is longer"):
        counter.feed((b"G1" + end) * 2 + b"x" * (MAX_LINE_BYTES + 1) + end + b"G1" + end)


@pytest.mark.parametrize("code", range(0x20))
def test_every_control_character_is_text_or_says_where_it_stands(code: int) -> None:
    counter = LineCounter()
    counter.feed(b"G0 X1\r")
    if code in b"\t\n\x0b\x0c\r\x1a\x1b":
        counter.feed(b"G1" + bytes((code,)))
        return
    with pytest.raises(NotAProgramError, match=f"byte 8 is 0x{code:02x}"):
        counter.feed(b"G1" + bytes((code,)))


@pytest.mark.parametrize("end", [b"\n", b"\r\n", b"\r", b""])
@pytest.mark.parametrize("size", [1 << 20, 50_001])
def test_a_line_has_a_limit_without_its_end(end: bytes, size: int) -> None:
    whole = b"G1\r\n" + b"x" * MAX_LINE_BYTES + end
    assert counted(cut(whole, size))[0] == 2
    with pytest.raises(NotAProgramError, match="line 2 is longer"):
        counted(cut(b"G1\r\ny" + whole[4:], size))
