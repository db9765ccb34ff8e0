"""Where the time between batches went, on a wire whose times are known by hand."""

import pytest

from bench.tap import Messages, Tap, dead_time
from sim.elvinto.events import Executed

BAUD = 100_000  # a byte takes 100 microseconds


def command(wire_id: int) -> bytes:
    return b"CRC16,VALUE<#1,MD5<#0,ID<#%d;GCODE,DATA<#G1X1;" % wire_id


def answer(name: bytes, wire_id: int) -> bytes:
    return b"CRC16,VALUE<#1,MD5<#0;%s,ID<#%d;" % (name, wire_id)


def test_messages_come_whole_with_their_header_whatever_the_pieces() -> None:
    data = command(7) + b"READY;" + answer(b"OK", 7)
    messages = Messages()
    found = [pair for at in range(len(data)) for pair in messages.feed(data[at : at + 1])]
    assert found == list(Messages().feed(data))
    assert [message for _, message in found] == [b"GCODE,DATA<#G1X1;", b"READY;", b"OK,ID<#7;"]
    assert [header[:5] for header, _ in found] == [b"CRC16", b"", b"CRC16"]


def story() -> tuple[Tap, list[Executed]]:
    """Two batches. Between them: OK 1 ms late, the daemon takes 4 ms, the command is 2 ms slower than its bytes."""
    tap = Tap()
    sent, received, ok = len(command(1)) / 1e4, answer(b"RECEIVED", 1), answer(b"OK", 1)
    tap.down(command(1), 0.0)
    tap.up(received, sent + len(received) / 1e4)
    ends_at = sent + 1.0
    ok_at = ends_at + len(ok) / 1e4 + 0.001
    tap.up(ok, ok_at)
    tap.down(command(2), ok_at + 0.004)
    tap.down(command(2), ok_at + 0.3)  # a repeat changes nothing
    begins_at = ok_at + 0.004 + sent + 0.002
    tap.up(answer(b"RECEIVED", 2), begins_at + len(received) / 1e4)
    blocks = [Executed("G1X1", 1, sent, True, sent + 0.5), Executed("G1X2", 1, sent + 0.5, True, ends_at)]
    return tap, [*blocks, Executed("G1X1", 2, begins_at, True, begins_at + 1.0)]


def test_the_parts_of_the_dead_time_are_told_apart() -> None:
    found = dead_time(*story(), BAUD)
    assert (found.batches, found.blocks) == (2, 3)
    assert found.executing_s == pytest.approx(2.0)
    assert found.answer_wait_s == pytest.approx(0.001)
    assert found.turnaround_s == pytest.approx(0.004)
    assert found.median_turnaround_s == pytest.approx(0.004)
    assert found.command_wait_s == pytest.approx(0.002)
    assert found.unhidden_s == pytest.approx((len(command(2)) + len(answer(b"OK", 1))) / 1e4)
    assert found.bound_s == pytest.approx(found.unhidden_s + len(answer(b"RECEIVED", 2)) / 1e4)
    assert found.dead_s == pytest.approx(found.unhidden_s + 0.007)
    assert found.ratio == pytest.approx((found.dead_s / found.total_s) / (found.bound_s / (2.0 + found.bound_s)))


def test_a_block_that_has_not_ended_is_not_measured() -> None:
    tap, blocks = story()
    blocks[-1].ended_at = None
    with pytest.raises(AssertionError, match="has not ended"):
        dead_time(tap, blocks, BAUD)
