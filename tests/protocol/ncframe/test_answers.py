"""Bytes between two silences: read in one way, or not at all."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from protocol.ncframe.answers import BURST_BYTES_MOST, Reading, console, read


def burst(text: str) -> bytes:
    return bytes.fromhex(text)


@pytest.mark.parametrize(
    ("said", "reading"),
    [
        ("06 00000007", Reading(7)),
        ("06", Reading(acks=1)),
        ("15", Reading(naks=1)),
        ("18", Reading(cancelled=True)),
        ("13", Reading(held=True)),
        ("13 11", Reading(held=False)),
        ("06 06 00000007", Reading(7, acks=1)),  # a late ACK before the answer
        ("06 00000007 06 00000007", Reading(7)),  # the answers to two ENQs
        ("15 06 00000007", Reading(7, naks=1)),
        ("06 00000007 18", Reading(7, cancelled=True)),
        ("13 06 00000007", Reading(7, held=True)),
        ("06 0600000A", Reading(0x0600000A)),
        ("06 06060606", Reading(0x06060606)),
        ("06 06060606 06", Reading(0x06060606, acks=1)),  # whichever of the two stands first
    ],
)
def test_what_can_be_read_in_one_way(said: str, reading: Reading) -> None:
    assert read(burst(said), counter=True) == reading


@pytest.mark.parametrize(
    "said",
    [
        "00",
        "06 000007",  # a byte is missing
        "06 00000007 06 00000008",  # two answers that contradict each other
        "06 00000007 42",
        "06" * (BURST_BYTES_MOST + 1),
    ],
)
def test_what_cannot_be_read(said: str) -> None:
    assert read(burst(said), counter=True) is None


def test_two_counts_of_which_one_is_plausible() -> None:
    """A late ACK, then count 6; or the count 0x06000000 and behind it an ACK."""
    said = burst("06 06 00000006")
    assert read(said, counter=True) is None
    assert read(said, counter=True, plausible=frozenset({6})) == Reading(6, acks=1)
    assert read(said, counter=True, plausible=frozenset({0x06000000})) == Reading(0x06000000, acks=1)
    assert read(said, counter=True, plausible=frozenset({6, 0x06000000})) is None


def test_without_a_counter_every_byte_speaks_for_itself() -> None:
    assert read(burst("06 06 15"), counter=False) == Reading(acks=2, naks=1)
    assert read(burst("06 00"), counter=False) is None


SINGLES = st.lists(st.sampled_from(b"\x06\x15\x11\x13"), max_size=3).map(bytes)


@given(st.integers(0, 2**32 - 1), SINGLES, st.integers(1, 3))
def test_the_true_count_is_found_where_it_is_expected_or_nothing_is(count: int, before: bytes, times: int) -> None:
    answer = b"\x06" + count.to_bytes(4, "big")
    reading = read(before + answer * times, counter=True, plausible=frozenset({count}))
    assert reading is not None
    assert reading.count == count


@given(st.binary(max_size=80), st.booleans())
def test_any_bytes_raise_nothing(data: bytes, counter: bool) -> None:
    read(data, counter=counter)
    assert console(data, counter=counter).isprintable()


@given(st.lists(st.sampled_from(b"\x06\x15\x18\x11\x13\x00"), max_size=BURST_BYTES_MOST).map(bytes))
def test_the_worst_bursts_are_read_at_once(data: bytes) -> None:
    read(data, counter=True)


def test_for_people() -> None:
    assert console(burst("15 06 00000007"), counter=True) == "NAK ACK 7"
    assert console(burst("06 13 42"), counter=False) == "ACK XOFF 42"
