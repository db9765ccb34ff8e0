"""server/machine/framehand.py: what people type and press for a machine behind NC frames."""

from typing import Any

import pytest

from gcode.ncframe.rules import FrameRules
from gcode.profile import load_profile
from protocol.commands import RunBlock, SetPosition
from server.config.model import MachineConfig
from server.machine.framehand import FrameHand, hand_of
from server.problems import ProblemError

HERE = {"x": 0.0, "z": 0.0}
ANYWHERE: dict[str, float] = {}


def hand(**rules: Any) -> FrameHand:
    return FrameHand(load_profile("ncframe-lathe"), FrameRules(**rules))


def made(of: FrameHand, line: str, position: dict[str, float] | None = None) -> list[object]:
    return [make(7) for make in of.commands(line, HERE if position is None else position)]


def test_only_machines_without_gcode_have_one() -> None:
    assert hand_of(MachineConfig(name="a", port="sim:", protocol="ncframe")) is not None
    assert hand_of(MachineConfig(name="a", port="sim:", protocol="grbl")) is None


def test_a_block_becomes_frames_that_say_everything() -> None:
    ours = hand()
    assert made(ours, "G1 X1 Z-2 F100 M8") == [RunBlock(7, ("G1 M8 X1000 Z-2000 F100",))]
    assert made(ours, "X2", {"x": 1.0, "z": -2.0}) == [RunBlock(7, ("G1 X1000 F100",))]
    two = made(ours, "M3; G0 Z0", {"x": 1.0, "z": -1.0})
    assert two == [RunBlock(7, ("M3 F100",)), RunBlock(7, ("G0 Z1000",))]


def test_modes_stay_until_a_job_begins() -> None:
    ours = hand()
    assert made(ours, "G91") == []
    assert made(ours, "G1 X1 F100", {"x": 5.0, "z": 0.0}) == [RunBlock(7, ("G1 X1000 F100",))]
    ours.forget()
    assert made(ours, "G1 X1 F100", {"x": 5.0, "z": 0.0}) == [RunBlock(7, ("G1 X-4000 F100",))]


def test_what_is_refused_changes_nothing() -> None:
    ours = hand()
    with pytest.raises(ProblemError, match="Q"):
        ours.commands("G91 G1 X1 Q3", HERE)
    assert made(ours, "G1 X1 F100", {"x": 5.0, "z": 0.0}) == [RunBlock(7, ("G1 X-4000 F100",))]


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("G1 Z-9000 F100", "does not fit"),
        ("G1 Z-1 F900", "F"),
        ("G42 D1 G1 X3 F100", "radius|compensation"),
        ("G92 X1 F3", "X and Z and nothing else"),
        ("G92", "X and Z and nothing else"),
        ("G92 X0; G1 X1 F100", "two commands"),
    ],
)
def test_what_cannot_be_sent(line: str, said: str) -> None:
    with pytest.raises(ProblemError, match=said) as refused:
        hand().commands(line, HERE)
    assert refused.value.code == "invalid_request"


def test_compensation_is_for_programs() -> None:
    with pytest.raises(ProblemError, match="compensation"):
        hand(tool_radius_mm=0.4).commands("G42 D1 G1 X3 F100", HERE)


def test_from_an_unknown_place_only_steps() -> None:
    with pytest.raises(ProblemError, match="not known"):
        hand().commands("G1 X1 F100", ANYWHERE)
    assert made(hand(), "G91 G1 X1 F100", ANYWHERE) == [RunBlock(7, ("G1 X1000 F100",))]


@pytest.mark.parametrize("code", ["G92", "G50"])
def test_g92_says_where_the_machine_stands(code: str) -> None:
    assert made(hand(), f"{code} X10 Z-2.5", ANYWHERE) == [SetPosition(7, {"x": 10.0, "z": -2.5})]
    inches = hand()
    made(inches, "G20")
    assert made(inches, f"{code} X1", ANYWHERE) == [SetPosition(7, {"x": 25.4})]


def test_g92_by_hand_is_for_the_hosts_own_zero() -> None:
    ours = hand(systems={2: {"z": -40.0}})
    made(ours, "G55")
    with pytest.raises(ProblemError, match="G54"):
        ours.commands("G92 X0", HERE)


def test_diameters() -> None:
    ours = hand(diameter_programming=True)
    assert made(ours, "G1 X10 F100", {"x": 4.0, "z": 0.0}) == [RunBlock(7, ("G1 X3000 F100",))]
    assert ours.jog({"x": 2.0}, 100, HERE)(7) == RunBlock(7, ("G1 X1000 F100",))


def test_a_jog_is_no_faster_than_the_machine_and_leaves_the_modes() -> None:
    ours = hand()
    assert ours.jog({"z": -0.5, "x": 1.0}, 3000, ANYWHERE)(7) == RunBlock(7, ("G1 X1000 Z-500 F255",))
    assert made(ours, "G1 X1 F100", {"x": 5.0, "z": 0.0}) == [RunBlock(7, ("G1 X-4000 F100",))]


@pytest.mark.parametrize(
    ("axes", "feed", "said"),
    [({"y": 1.0}, 100, "x and z"), ({"x": 0.0002}, 100, "less than a count"), ({"x": 1.0}, 0.2, "nothing in steps")],
)
def test_jogs_that_cannot_be(axes: dict[str, float], feed: float, said: str) -> None:
    with pytest.raises(ProblemError, match=said):
        hand().jog(axes, feed, HERE)
