"""A reset in every state ends with the banner and with a controller that obeys (grbl II.2, II.3)."""

from collections.abc import Callable

import pytest

from tests.harness.grblconsole import Console


def _run(console: Console) -> None:
    console.tell("G1X100F600\n")
    console.wait(1.0)


def _full(console: Console) -> None:
    for nth in range(17):
        console.tell(f"G1X{nth % 2 * 9}F600\n")


def _braking(console: Console) -> None:
    console.tell("G1X100F6000\n")
    console.wait(0.5)
    console.tell("!")


def _held(console: Console) -> None:
    _braking(console)
    console.wait(2.0)


def _door(console: Console) -> None:
    _run(console)
    console.tell(b"\x84")
    console.wait(2.0)


def _sent(text: str) -> Callable[[Console], None]:
    def begin(console: Console) -> None:
        console.tell(text)
        console.wait(0.3)

    return begin


STATES = [
    ("Idle", _sent(""), []),
    ("Run", _run, ["ALARM:3"]),
    ("Run", _full, ["ALARM:3", "ok"]),
    ("Hold:1", _braking, ["ALARM:3"]),
    ("Hold:0", _held, []),
    ("Door:0", _door, []),
    ("Jog", _sent("$J=G91X50F600\n"), ["ALARM:3"]),
    ("Check", _sent("$C\n"), []),
    ("Sleep", _sent("$SLP\n"), []),
    ("Idle", _sent("G4P10\n"), ["ok"]),
    ("Hold:0", _sent("M0\n"), ["ok"]),
    ("Run", _sent("G1X50F600\nM3\n"), ["ALARM:3", "ok"]),
    ("Run", _sent("G38.2Z-50F600\n"), ["ALARM:3", "ok"]),
    ("Run", _sent("G2X0I5F600\n"), ["ALARM:3", "ok"]),
]


@pytest.mark.parametrize(("state", "begin", "before"), STATES)
def test_every_state(state: str, begin: Callable[[Console], None], before: list[str]) -> None:
    console = Console()
    begin(console)
    assert console.state() == state
    said = console.tell(b"\x18") + console.rest()
    locked = "ALARM:3" in before or state == "Sleep"
    assert said == [*before, "", "Grbl 1.1h ['$' for help]", *["[MSG:'$H'|'$X' to unlock]"] * locked]
    assert console.state() == ("Alarm" if locked else "Idle")
    assert console.tell("$X\nG21\n")[-1] == "ok"
    assert console.field("FS") == "0,0"
    taken = len(console.machine.executed)
    console.tell("G91G1X1F600\n")
    console.rest()
    assert console.machine.executed[taken].finished


def test_in_motion_what_was_planned_is_marked_unfinished() -> None:
    console = Console()
    _full(console)
    console.wait(0.2)
    console.tell(b"\x18")
    console.rest()
    assert not any(line.finished for line in console.machine.executed if line.moves)
