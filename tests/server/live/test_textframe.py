"""Frames against the examples of RFC 6455 §5.7, and read back by a decoder of the tests' own."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from server.live.textframe import text_frame
from tests.harness.textframes import texts


def test_the_example_of_the_standard() -> None:
    assert text_frame("Hello") == bytes.fromhex("81 05 48 65 6c 6c 6f")


@pytest.mark.parametrize(
    ("length", "header"),
    [
        (125, "81 7d"),
        (126, "81 7e 00 7e"),
        (256, "81 7e 01 00"),
        (65_535, "81 7e ff ff"),
        (65_536, "81 7f 00 00 00 00 00 01 00 00"),
    ],
)
def test_the_length_stands_in_as_few_bytes_as_it_needs(length: int, header: str) -> None:
    frame = text_frame("x" * length)
    assert frame == bytes.fromhex(header) + b"x" * length


@given(st.lists(st.text(max_size=200), max_size=5))
def test_frames_in_a_row_are_read_back(said: list[str]) -> None:
    said = [text.encode("utf-8", "replace").decode() for text in said]
    assert [*texts(b"".join(map(text_frame, said)))] == said
