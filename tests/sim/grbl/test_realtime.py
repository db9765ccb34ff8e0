"""Realtime bytes are picked out anywhere (grbl II.1, II.2)."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.grbl.realtime import BYTES, Realtime, meaning, pieces, swallowed
from tests.harness.grblconsole import Console


@given(st.binary(), st.booleans())
def test_nothing_is_lost_by_cutting(data: bytes, hal: bool) -> None:
    cut = pieces(data, hal=hal)
    assert b"".join(cut) == data
    for piece in cut:
        special = [byte for byte in piece if byte in BYTES or byte > 0x7F]
        assert len(piece) == 1 or not special


def test_every_byte_of_ii_2() -> None:
    assert {byte for byte in range(256) if meaning(bytes([byte]), hal=False)} == {
        0x18, 0x3F, 0x7E, 0x21, 0x84, 0x85, *range(0x90, 0x98), *range(0x99, 0x9F), 0xA0, 0xA1,
    }  # fmt: skip
    assert meaning(b"\x98", hal=False) is None
    assert meaning(b"\x87", hal=False) is None
    assert meaning(b"\x87", hal=True) is Realtime.FULL_STATUS
    assert meaning(b"??", hal=False) is None


def test_ii_1_every_byte_above_7f_is_swallowed() -> None:
    assert all(swallowed(bytes([byte])) for byte in range(0x80, 0x100))
    console = Console()
    assert console.tell(b"G2\xd0\xbf\xff1\n") == ["ok"]
    assert console.machine.executed[0].text == "G21"
    assert console.machine.most_ring_bytes == 2


@pytest.mark.parametrize("text", ["G1X50(what? no!)F600\n", "G1X50F600;wait!\n", "$G (x!)\n"])
def test_ii_1_trap_they_act_inside_a_comment(text: str) -> None:
    console = Console()
    console.tell("G1X40F600\n")
    console.wait(0.5)
    console.tell(text)
    console.wait(1.0)
    assert console.state() == "Hold:0"


def test_ii_1_trap_a_question_mark_in_a_comment_is_answered() -> None:
    assert Console().tell("(sure?)\n")[0].startswith("<Idle|")


def test_ii_1_trap_utf8_in_a_comment_presses_the_spindle_stop_key() -> None:
    console = Console()
    console.tell("M3S800\n!")
    assert console.field("FS") == "0,800"
    console.tell("(„)\n".encode())  # E2 80 9E
    assert console.field("FS") == "0,0"
    assert console.field("MPos") is not None


def test_ii_1_realtime_bytes_never_occupy_the_ring() -> None:
    console = Console()
    console.tell(b"?~" * 300)
    assert console.machine.most_ring_bytes == 0
    assert console.machine.dropped_bytes == 0


def test_ii_2_question_marks_before_the_first_is_printed_collapse_into_one() -> None:
    console = Console(dollar={22: 1})
    console.tell("$H\n")
    assert console.tell("???") == []
    said = console.rest()
    assert sum(line.startswith("<") for line in said) == 1
