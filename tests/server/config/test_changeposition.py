"""Blocks of `change_position` that a machine cannot take, found when the daemon starts and not when a tool is due."""

import pytest
from pydantic import ValidationError

from gcode.motion import Motion
from gcode.profile import load_profile
from server.config.changeposition import fault_of
from server.config.model import MachineConfig

GRBL = load_profile("grbl-1.1")
MOTION = Motion(travel={"x": (-300.0, 0.0), "y": (-200.0, 0.0), "z": (-80.0, 0.0)})


@pytest.mark.parametrize(
    "blocks",
    [
        ("G53 G0 Z-5", "G53 G0 X-10 Y-10"),
        ("G28",),
        ("G30 Z0", "G91 G28 Z0", "G90"),
        ("G53 G1 Z-5 F600", "M5", "M9", "G4 P1"),
        ("G59 G0 X1000",),  # where that is in the machine, nobody knows yet
        ("G20", "G53 G0 X-1"),
    ],
)
def test_a_way_that_the_machine_can_go(blocks: tuple[str, ...]) -> None:
    assert fault_of(blocks, GRBL, MOTION) is None


@pytest.mark.parametrize(
    ("blocks", "at", "message"),
    [
        (("G53 G0 Z-5", "G53 G0 X10"), 1, "X"),
        (("G53 G0 Z-81",), 0, "Z"),
        (("G20", "G53 G0 X-12"), 1, "X"),  # 304.8 mm
        (("G53 G0 Z-5", "G53 X-5 Q3"), 1, "Q"),
        (("G53 G0 A5",), 0, "A"),
        (("G53 G1 Z-5",), 0, "feed"),
        (("G92 X0",), 0, "without G92"),
        (("G0 Z0", "T1 M6"), 1, "without M6"),
        (("M0",), 0, "without M0"),
        (("M30",), 0, "without M30"),
        (("G38.2 Z-5 F10",), 0, "without G38.2"),
        (("G10 L20 P1 X0",), 0, "without G10"),
    ],
)
def test_a_way_that_it_cannot_go_names_the_block(blocks: tuple[str, ...], at: int, message: str) -> None:
    found = fault_of(blocks, GRBL, MOTION)
    assert found is not None
    assert found[0] == blocks[at]
    assert message in found[1]


def machine(protocol: str = "grbl", *, position: list[str], **other: object) -> MachineConfig:
    values = {"name": "mill", "port": "/dev/null", "protocol": protocol, "motion": {"travel": {"z": [-80.0, 0.0]}}}
    changer = {"kind": "manual", "change_position": position}
    return MachineConfig.model_validate({**values, "toolchanger": changer, **other})


def test_the_error_names_the_key() -> None:
    assert machine(position=["G53 G0 Z-5"]).toolchanger.change_position == ("G53 G0 Z-5",)
    with pytest.raises(ValidationError) as refused:
        machine(position=["G53 G0 Z5"])
    (error,) = refused.value.errors()
    assert error["ctx"]["key"] == "toolchanger.change_position"
    assert error["ctx"]["value"] == "G53 G0 Z5"


@pytest.mark.parametrize(
    ("protocol", "other"), [("elvinto", {}), ("ncframe", {}), ("grbl", {"grbl": {"firmware": "grblhal"}})]
)
def test_a_controller_that_is_sent_m6_has_no_such_blocks(protocol: str, other: dict[str, object]) -> None:
    with pytest.raises(ValidationError, match="sent M6"):
        machine(protocol, position=["G53 G0 Z-5"], **other)
