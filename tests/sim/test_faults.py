"""Wires: what they promise about order, time and repeatability, and that each fault does its harm."""

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.faults import LINES, Drop, FaultRates, HostileWire, PacedWire

TEXT = b"CRC16,VALUE<#1;OK,ID<#1;" * 200


def carried(rates: FaultRates, seed: int = 1, data: bytes = TEXT) -> bytes:
    wire = HostileWire(seed, rates)
    wire.send(data, 0.0)
    return wire.receive(1e6)


def test_a_wire_without_faults_carries_what_was_sent() -> None:
    wire = HostileWire(1)
    wire.send(b"abc", 1.0)
    wire.send(b"", 1.0)
    wire.send(b"def", 2.0)
    assert wire.receive(1.5) == b"abc"
    assert wire.next_timer() == 2.0
    assert wire.receive(2.0) == b"def"
    assert wire.next_timer() is None
    assert wire.carried_bytes == 6


def test_the_same_seed_does_the_same_harm() -> None:
    rates = FaultRates(loss=0.01, flip=0.01, duplicate=0.01, noise=0.5)
    assert carried(rates) == carried(rates)
    assert carried(rates) != carried(rates, seed=2)


def test_loss_flips_and_duplicates_come_as_often_as_said() -> None:
    data = bytes(100_000)
    assert len(carried(FaultRates(loss=0.02), data=data)) == pytest.approx(98_000, abs=500)
    assert len(carried(FaultRates(duplicate=0.02), data=data)) == pytest.approx(102_000, abs=500)
    flipped = carried(FaultRates(flip=0.02), data=data)
    assert len(flipped) == len(data)
    hit = [byte for byte in flipped if byte]
    assert len(hit) == pytest.approx(2000, abs=300)
    assert all(byte.bit_count() == 1 for byte in hit)


def test_every_byte_can_be_lost() -> None:
    assert carried(FaultRates(loss=1.0)) == b""


@given(st.lists(st.integers(0, 300), max_size=10))
def test_faults_do_not_depend_on_how_the_bytes_are_cut(cuts: list[int]) -> None:
    rates = FaultRates(loss=0.02, flip=0.05, duplicate=0.02)
    data = TEXT[:300]
    wire = HostileWire(3, rates)
    edges = sorted({0, len(data), *cuts})
    for start, end in pairwise(edges):
        wire.send(data[start:end], 0.0)
    assert wire.receive(1.0) == carried(rates, seed=3, data=data)


def test_noise_is_put_in_and_takes_nothing_away() -> None:
    noisy = carried(FaultRates(noise=1.0, noise_bytes=5), data=b"OK;")
    assert 4 <= len(noisy) <= 8
    assert HostileWire(1, FaultRates(noise=1.0)).receive(9.0) == b""


def test_no_noise_without_bytes() -> None:
    wire = HostileWire(1, FaultRates(noise=1.0))
    wire.send(b"", 0.0)
    assert wire.receive(9.0) == b""


def test_delays_keep_the_order() -> None:
    wire = HostileWire(5, FaultRates(delay=0.5, delay_s=10.0))
    for index in range(50):
        wire.send(bytes([index]), index / 10)
    assert wire.receive(2.0) != bytes(range(21))
    assert len(wire.receive(1e6)) > 0
    again = HostileWire(5, FaultRates(delay=0.5, delay_s=10.0))
    for index in range(50):
        again.send(bytes([index]), index / 10)
    assert again.receive(1e6) == bytes(range(50))


def test_silence_swallows_what_is_sent_in_it() -> None:
    wire = HostileWire(1, FaultRates(silences=((1.0, 2.0),)))
    for at in (0.5, 1.0, 1.9, 2.0):
        wire.send(f"{at};".encode(), at)
    assert wire.receive(9.0) == b"0.5;2.0;"
    assert wire.lost_bytes == 8


def test_a_cut_wire_carries_nothing_and_loses_what_was_on_its_way() -> None:
    wire = HostileWire(1, baud=10)
    wire.send(b"abc", 0.0)
    wire.cut()
    wire.send(b"def", 0.5)
    assert wire.next_timer() is None
    wire.mend()
    wire.send(b"ghi", 10.0)
    assert wire.receive(13.0) == b"ghi"


def test_a_cut_ends_delays_too() -> None:
    wire = HostileWire(1, FaultRates(delay=1.0, delay_s=1.0))
    wire.send(b"old", 5000.0)
    wire.cut()
    wire.mend()
    wire.send(b"new", 0.0)
    assert wire.receive(1.0) == b"new"


def replies(*ids: int) -> list[bytes]:
    return [f"CRC16,VALUE<#{wire_id};OK,ID<#{wire_id};".encode() for wire_id in ids]


@pytest.mark.parametrize(
    ("drop", "left"),
    [
        (Drop("OK", first=3), [1, 2, 4, 5]),
        (Drop("OK", first=2, count=2), [1, 4, 5]),
        (Drop("OK", first=4, count=0), [1, 2, 3]),
        (Drop("O"), [1, 2, 3, 4, 5]),
        (Drop(match=lambda message: b"#4" in message), [1, 2, 3, 5]),
    ],
)
@pytest.mark.parametrize("chunk", [1, 7, 1000])
def test_chosen_messages_fall_with_their_headers(drop: Drop, left: list[int], chunk: int) -> None:
    wire = HostileWire(1, FaultRates(drops=(drop,)))
    stream = b"".join(replies(1, 2, 3, 4, 5))
    for start in range(0, len(stream), chunk):
        wire.send(stream[start : start + chunk], 0.0)
    assert wire.receive(0.0) == b"".join(replies(*left))


def test_several_drops() -> None:
    wire = HostileWire(1, FaultRates(drops=(Drop("OK"), Drop("READY"))))
    wire.send(b"H;READY;" + b"".join(replies(1, 2)), 0.0)
    assert wire.receive(0.0) == b"H;" + b"".join(replies(2))


@pytest.mark.parametrize("rates", [{"loss": -0.1}, {"flip": 1.5}, {"loss": 0.6, "flip": 0.6}])
def test_chances_that_are_none(rates: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=r"chance|together"):
        FaultRates(**rates)


# The line.


def test_bytes_arrive_at_the_rate_of_the_line() -> None:
    line = PacedWire(1000)  # 10 ms a byte
    line.send(b"0123456789", 5.0)
    assert line.receive(5.005) == b""
    assert line.receive(5.0101) == b"0"
    assert line.receive(5.05) == b"1234"
    assert line.next_timer() == pytest.approx(5.1)
    assert line.receive(5.1) == b"56789"
    assert line.next_timer() is None
    assert line.carried_bytes == 10


def test_sends_queue_behind_each_other() -> None:
    line = PacedWire(1000)
    line.send(b"aaaaa", 0.0)
    line.send(b"bbbbb", 0.01)
    assert line.free_at == pytest.approx(0.1)
    assert line.receive(0.075) == b"aaaaabb"
    line.send(b"c", 1.0)
    assert line.receive(1.005) == b"bbb"
    assert line.receive(1.01) == b"c"


def test_the_timer_is_for_whole_messages() -> None:
    line = PacedWire(1000)
    line.send(b"AB;CDE;F", 0.0)
    assert line.next_timer() == pytest.approx(0.03)
    assert line.receive(0.03) == b"AB;"
    assert line.next_timer() == pytest.approx(0.07)
    assert line.receive(0.07) == b"CDE;"
    assert line.next_timer() == pytest.approx(0.08)
    assert line.receive(0.08) == b"F"


@given(start=st.floats(0, 1e7), baud=st.sampled_from([300, 9600, 115200, 921600]), count=st.integers(1, 3000))
def test_a_timer_that_was_kept_brings_the_message(start: float, baud: int, count: int) -> None:
    line = PacedWire(baud)
    line.send(b"x" * count + b";", start)
    at = line.next_timer()
    assert at is not None
    assert line.receive(at).endswith(b";")


def test_faults_lie_before_the_line() -> None:
    wire = HostileWire(1, FaultRates(duplicate=1.0), baud=1000)
    wire.send(b"ab;", 0.0)
    assert wire.receive(0.03) == b"aab"
    assert wire.receive(0.06) == b"b;;"


def test_other_machines_end_their_messages_otherwise() -> None:
    wire = PacedWire(1000, framing=LINES)
    wire.send(b"G1\n?G2;X", 0.0)
    timers = []
    while (at := wire.next_timer()) is not None:
        timers.append((round(at, 6), wire.receive(at)))
    assert timers == [(0.03, b"G1\n"), (0.04, b"?"), (0.08, b"G2;X")]


def test_whole_lines_can_be_dropped_and_realtime_bytes_are_lines_of_their_own() -> None:
    wire = HostileWire(1, FaultRates(drops=(Drop("ok", first=2),)), framing=LINES)
    wire.send(b"ok\r\n<Idle>\r\nok\r\nok\r\n", 0.0)
    assert wire.receive(0.0) == b"ok\r\n<Idle>\r\nok\r\n"
    wire.send(b"G1?X", 0.0)
    assert wire.receive(0.0) == b"G1?"
    wire.send(b"1\n", 0.0)
    assert wire.receive(0.0) == b"X1\n"
