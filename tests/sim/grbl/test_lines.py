"""Bytes to lines (grbl II.1)."""

import pytest

from sim.grbl.lines import LineReader
from tests.harness.grblconsole import Console


def read(data: bytes, limit: int = 79) -> list[tuple[str, bool, int]]:
    reader = LineReader(limit)
    found = (reader.feed(byte) for byte in data)
    return [(line.text, line.overflow, line.raw_bytes) for line in found if line is not None]


@pytest.mark.parametrize(
    ("data", "texts"),
    [
        (b"g1 x1\tY2\n", ["G1X1Y2"]),
        (b"G1(feed ; here)X1\n", ["G1X1"]),
        (b"G1(a(b)X1)\n", ["G1X1)"]),
        (b"G1;(X2\nG2\n", ["G1", "G2"]),
        (b"(never closed\nG1\n", ["", "G1"]),
        (b"/G1X1\n", ["G1X1"]),
        (b"%\n", ["%"]),
        (b"\x00G\x021\x1f\n", ["G1"]),
        (b"G1\rG2\n", ["G1", "G2"]),
    ],
)
def test_ii_1_what_is_dropped(data: bytes, texts: list[str]) -> None:
    assert [text for text, _, _ in read(data)] == texts


def test_ii_1_cr_lf_is_two_lines_the_second_empty() -> None:
    assert [text for text, _, _ in read(b"G1\r\n")] == ["G1", ""]
    assert Console().tell("G21\r\n") == ["ok", "ok"]


def test_ii_1_79_characters_after_stripping() -> None:
    text = b"G1X" + b"1" * 76
    assert read(text + b" (and a comment)\n") == [(text.decode(), False, 79 + 17)]
    assert read(text + b"1\n")[0][1]
    assert read(b"(" + b"x" * 200 + b")G1\n") == [("G1", False, 205)]


def test_ii_1_a_longer_line_is_error_11_and_nothing_is_executed() -> None:
    console = Console()
    assert console.tell("G1F100X" + "0" * 70 + "1Y1\nG21\n") == ["error:11", "ok"]
    assert [line.text for line in console.machine.executed] == ["G21"]


def test_an_overflow_ends_with_its_line() -> None:
    assert [text for text, over, _ in read(b"A" * 90 + b"(\nG1\n") if not over] == ["G1"]


def test_ii_1_percent_is_error_1_and_block_delete_is_none() -> None:
    console = Console()
    assert console.tell("%\n/G21\n") == ["error:1", "ok"]
    assert [line.text for line in console.machine.executed] == ["G21"]


def test_clear_forgets_half_a_line() -> None:
    reader = LineReader(79)
    reader.feed(ord("("))
    reader.clear()
    assert [line.text for byte in b"G1\n" if (line := reader.feed(byte))] == ["G1"]
