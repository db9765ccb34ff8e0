"""The receive ring, and what its overflow does to lines (grbl II.1)."""

import pytest

from sim.grbl.events import BytesLost
from sim.grbl.ring import RxRing
from tests.harness.grblconsole import Console


def test_it_takes_what_fits_in_order() -> None:
    ring = RxRing(4)
    assert ring.put(b"abcdef") == 4
    assert (len(ring), ring.free) == (4, 0)
    ring.drop(2)
    ring.drop(1)
    assert ring.put(b"g") == 0
    assert [ring.read() for _ in range(5)] == [*b"abcd", None]
    assert (ring.dropped_bytes, ring.overflows, ring.most_bytes) == (3, 1, 4)
    assert ring.put(b"xy") == 2
    ring.drop(1)
    assert ring.overflows == 2
    ring.clear()
    assert len(ring) == 0


def block(console: Console) -> None:
    """The planner full and one line waiting for room: nothing is read any more."""
    for nth in range(16):
        console.tell(f"G1X{nth % 2 + 1}F60\n")


def test_ii_1_all_128_bytes_are_usable_and_no_more() -> None:
    console = Console()
    block(console)
    console.tell("G1Y1\n" * 25 + "G1Y")
    assert console.machine.dropped_bytes == 0
    assert console.machine.most_ring_bytes == 128
    console.tell("2")
    assert (console.machine.dropped_bytes, console.machine.overflows) == (1, 1)


def test_ii_1_with_15_lines_planned_bf_falls_to_0_0_and_the_rest_is_lost_without_a_word() -> None:
    console = Console(dollar={10: 3})
    said = console.tell("".join(f"G1X{nth % 2 + 1}F60\n" for nth in range(60)))
    assert said == ["ok"] * 15
    assert console.field("Bf") == "0,0"
    assert console.machine.dropped_bytes > 0
    assert console.rest().count("ok") < 60 - 15


def test_ii_1_an_overflow_glues_lines_together() -> None:
    console = Console()
    block(console)
    console.tell("G1Y1\n" * 25)  # 125 bytes: three more fit
    console.tell("G1X7\n")  # its tail is lost
    assert console.rest() == ["ok"] * 26
    assert console.tell("Y5\n") == ["error:2"], "G1X and Y5 have become one line"


def test_ii_1_what_is_lost_is_told_to_tests_by_events() -> None:
    console = Console(rx_bytes=16)
    block(console)
    console.tell("G1Y1\n" * 4)
    events = []
    while (event := console.machine.next_event()) is not None:
        events.append(event)
    assert BytesLost("ring", 4) in events


@pytest.mark.parametrize(("flavour", "size"), [("1.1h", 128), ("grblHAL", 1023)])
def test_sizes_of_the_flavours(flavour: str, size: int) -> None:
    console = Console(flavour=flavour)
    assert console.machine.core.ring.capacity == size


def test_the_window_of_a_sender_is_measured() -> None:
    console = Console()
    block(console)
    console.tell("G1Y1\n" * 10)
    assert console.machine.most_waiting_bytes == 50 + len("G1X1F60\n")
    assert console.rest() == ["ok"] * 11
    console.tell("G1Y1\n")
    assert console.machine.most_waiting_bytes == 50 + len("G1X1F60\n")
