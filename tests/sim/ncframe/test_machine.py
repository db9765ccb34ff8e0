"""The virtual lathe by itself, fed with bytes written by hand."""

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.ncframe.events import Aborted, BytesLost, BytesRefused, Executed
from sim.ncframe.machine import VirtualLathe
from sim.ncframe.settings import SimSettings

ENQ, ACK, XON, XOFF, NAK, CAN = (bytes([code]) for code in (0x05, 0x06, 0x11, 0x13, 0x15, 0x18))
G1_X1000_F60 = bytes.fromhex("A4 01 00 03 E8 3C")
"""A second."""
X2 = bytes.fromhex("20 00 00 02")


class Lathe:
    """The machine and its time."""

    def __init__(self, **settings: Any) -> None:
        given = {"check": "none", "frame_s": 0.0, **settings}
        self.records: list[Executed] = []
        self.machine = VirtualLathe(SimSettings(**given), on_block=self.records.append)
        self.now = 0.0

    def say(self, data: bytes) -> bytes:
        self.machine.receive_data(data, self.now)
        return self.machine.data_to_send(self.now)

    def wait(self, seconds: float) -> bytes:
        end, out = self.now + seconds, b""
        while (due := self.machine.next_timer()) is not None and due <= end:
            self.now = max(self.now, due)
            self.machine.handle_timer(self.now)
            out += self.machine.data_to_send(self.now)
        self.now = end
        return out

    @property
    def texts(self) -> list[str]:
        return [run.text for run in self.machine.executed]


def count(number: int) -> bytes:
    return ACK + number.to_bytes(4, "big")


def test_ack_comes_when_the_frame_is_executed() -> None:
    lathe = Lathe()
    assert lathe.say(G1_X1000_F60) == b""
    assert lathe.wait(0.99) == b""
    assert lathe.wait(0.02) == ACK
    assert lathe.machine.position == (1000, 0)
    assert [(run.id, run.text, run.finished) for run in lathe.records] == [(1, "G1 X1000 F60", True)]
    assert lathe.say(ENQ) == count(1)


def test_a_speed_factor_and_no_time_at_all() -> None:
    fast = Lathe(speed_factor=10)
    fast.say(G1_X1000_F60)
    assert fast.wait(0.11) == ACK
    assert Lathe(instant=True).say(G1_X1000_F60) == ACK


def test_without_a_counter_enq_is_answered_by_ack_alone() -> None:
    assert Lathe(counter=False).say(ENQ) == ACK


@pytest.mark.parametrize("framing", ["length", "gap"])
def test_while_a_frame_runs_everything_waits(framing: str) -> None:
    lathe = Lathe(framing=framing)
    lathe.say(G1_X1000_F60)
    lathe.wait(0.1)
    assert lathe.say(ENQ) == b""
    lathe.wait(0.5)
    assert lathe.say(ENQ) == b""
    assert lathe.wait(1.0) == ACK + count(1) * 2


@pytest.mark.parametrize("framing", ["length", "gap"])
def test_a_frame_that_came_while_one_ran_is_executed_behind_it(framing: str) -> None:
    lathe = Lathe(framing=framing)
    lathe.say(G1_X1000_F60)
    lathe.wait(0.1)
    lathe.say(X2)
    assert lathe.wait(2) == ACK * 2
    assert lathe.machine.position == (1002, 0)


def test_a_buffer_that_overflows_loses_bytes() -> None:
    lathe = Lathe(rx_bytes=16)
    lathe.say(G1_X1000_F60 + bytes(20))
    assert sum(event.count for event in lathe.machine.events if isinstance(event, BytesLost)) == 4


def test_a_frame_that_is_not_whole_is_dropped_behind_a_silence() -> None:
    lathe = Lathe()
    lathe.say(X2[:3])
    assert lathe.wait(0.015) == b""
    assert lathe.wait(0.01) == NAK
    assert lathe.say(X2) == b""
    assert lathe.wait(0.01) == ACK
    refused = lathe.machine.events[0]
    assert isinstance(refused, BytesRefused)
    assert (refused.raw, refused.why) == (X2[:3], "gap")


def test_a_bad_frame_is_refused_once_with_all_that_follows() -> None:
    lathe = Lathe(check="xor")
    assert lathe.say(X2 + b"\x00" + X2 + b"\x22") == b""
    assert lathe.wait(1) == NAK
    assert lathe.texts == []


def test_a_break_on_the_line_is_no_frame() -> None:
    lathe = Lathe()
    assert lathe.say(b"\x00") + lathe.wait(1) == NAK
    assert lathe.say(ENQ) == count(0)


def test_by_silences_a_frame_must_be_all_that_came() -> None:
    lathe = Lathe(framing="gap")
    lathe.say(X2)
    assert lathe.wait(0.1) == ACK
    lathe.say(X2 + b"\x01")
    assert lathe.wait(0.1) == NAK
    lathe.say(ENQ)
    assert lathe.wait(0.1) == count(1)
    lathe.say(ENQ + b"\x01\x02")  # F and T: never sent so, and yet a frame
    assert lathe.wait(1) == ACK
    assert lathe.texts == ["X2", "F1 T2"]


def test_can_stops_within_a_frame() -> None:
    lathe = Lathe()
    lathe.say(X2)
    lathe.wait(0.01)
    lathe.say(G1_X1000_F60)
    lathe.wait(0.5)
    assert lathe.say(CAN) == CAN
    assert lathe.machine.position == (502, 0)
    assert not lathe.machine.executed[-1].finished
    assert lathe.wait(5) == b""
    assert lathe.say(ENQ) == count(0)
    assert lathe.say(CAN) == CAN  # as often as it is said


@pytest.mark.parametrize(
    ("frame", "why"), [("A0 01 00 07 D0", "limit"), ("A8 02 00 07 D0 00 00 01", "arc"), ("20 FF F8 30", "limit")]
)
def test_what_it_stops_by_itself(frame: str, why: str) -> None:
    lathe = Lathe(travel_x_mm=1.0)
    assert lathe.say(bytes.fromhex(frame)) == CAN
    event = lathe.machine.events[-1]
    assert isinstance(event, Aborted)
    assert event.why == why


def test_the_stop_button() -> None:
    lathe = Lathe()
    lathe.say(G1_X1000_F60)
    lathe.machine.panic(lathe.now)
    assert lathe.machine.data_to_send(lathe.now) == CAN
    assert lathe.wait(2) == b""


def test_the_hold_key() -> None:
    lathe = Lathe()
    lathe.say(G1_X1000_F60)
    lathe.wait(0.5)
    lathe.machine.hold(lathe.now)
    lathe.machine.hold(lathe.now)
    assert lathe.wait(100) == b""
    assert lathe.machine.data_to_send(lathe.now) == XOFF
    lathe.machine.release(lathe.now)
    lathe.machine.release(lathe.now)
    assert lathe.machine.data_to_send(lathe.now) == XON
    assert lathe.wait(0.49) == b""
    assert lathe.wait(0.02) == ACK


def test_while_it_holds_and_stands_it_answers_and_begins_nothing() -> None:
    lathe = Lathe()
    lathe.machine.hold(lathe.now)
    assert lathe.say(ENQ) == XOFF + count(0)
    lathe.say(X2)
    assert lathe.wait(10) == b""
    lathe.machine.release(lathe.now)
    lathe.machine.data_to_send(lathe.now)
    assert lathe.wait(1) == ACK


def test_a_power_cut() -> None:
    lathe = Lathe(start_count=41)
    assert lathe.say(ENQ) == count(41)
    lathe.say(G1_X1000_F60)
    lathe.wait(0.25)
    lathe.machine.restart(lathe.now)
    assert lathe.say(ENQ) == b""
    assert lathe.wait(0.6) == b""
    assert lathe.say(ENQ) == count(0)
    assert lathe.machine.position == (250, 0)
    assert [event.why for event in lathe.machine.events if isinstance(event, BytesLost)] == ["off"]


def test_the_count_wraps() -> None:
    lathe = Lathe(start_count=2**32 - 1)
    lathe.say(X2)
    lathe.wait(1)
    assert lathe.say(ENQ) == count(0)


def test_it_forgets_what_was_long_ago() -> None:
    lathe = Lathe(instant=True, executed_limit=5)
    for _ in range(100):
        lathe.say(X2)
    assert 5 <= len(lathe.machine.executed) <= 10
    assert lathe.machine.position == (200, 0)


@given(
    st.lists(st.tuples(st.binary(max_size=20), st.floats(0, 0.05)), max_size=20),
    st.sampled_from(("none", "xor", "crc8")),
    st.sampled_from(("length", "gap")),
)
def test_any_bytes_at_any_time_raise_nothing(bursts: list[tuple[bytes, float]], check: str, framing: str) -> None:
    lathe = Lathe(check=check, framing=framing, speed_factor=100)
    for data, seconds in bursts:
        lathe.say(data)
        lathe.wait(seconds)


@given(st.lists(st.integers(1, 7), max_size=6))
def test_in_how_many_pieces_it_comes_does_not_matter(sizes: list[int]) -> None:
    lathe = Lathe(instant=True)
    data = G1_X1000_F60 + X2 + ENQ
    answers, at = b"", 0
    for size in [*sizes, len(data)]:
        answers += lathe.say(data[at : at + size])
        at += size
    assert answers == ACK + ACK + count(2)
