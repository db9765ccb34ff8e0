"""`[machine.toolchanger]`: what it hands on to the core, and what it refuses."""

from typing import Any

import pytest
from pydantic import ValidationError

from protocol.iocontrol.config import IoConfig
from server.config.model import MachineConfig
from server.config.toolchanger import ToolchangerConfig


def test_without_a_word_a_person_changes_the_tools() -> None:
    assert ToolchangerConfig().io() == IoConfig(kind="manual")


def test_every_key_is_handed_on() -> None:
    config = ToolchangerConfig(
        kind="external",
        protocol_version=2,
        support_start_change=True,
        prepare_timeout=1.0,
        change_timeout=2.0,
        ack_timeout=3.0,
        pulse=0.1,
        io_error="changer: %d",
        jumpers=("tool-prepared",),
        start_in_estop=False,
    )
    assert config.io() == IoConfig(
        "external", 2, True, 1.0, 2.0, 3.0, 0.1, "changer: %d", frozenset({"tool-prepared"}), False
    )


def test_a_person_can_be_asked_always() -> None:
    assert ToolchangerConfig(always_ask=True).io() == IoConfig(kind="manual", always_ask=True)


@pytest.mark.parametrize(
    "wrong",
    [
        {"kind": "robot"},
        {"protocol_version": 1, "support_start_change": True},
        {"io_error": "no number"},
        {"jumpers": ["tool-change"]},
        {"kind": "external", "always_ask": True},
        {"change_position": ["$H"]},
        {"change_position": ["G0 X("]},
        {"change_position": [""]},
        {"change_position": ["G4 P0"] * 21},
    ],
)
def test_what_would_not_work_is_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(ValidationError):
        ToolchangerConfig.model_validate(wrong)


def test_grblhal_keeps_its_own_tool_change_where_a_person_changes() -> None:
    def machine(firmware: str, kind: str) -> MachineConfig:
        return MachineConfig.model_validate(
            {
                "name": "mill",
                "port": "/dev/null",
                "protocol": "grbl",
                "grbl": {"firmware": firmware},
                "toolchanger": {"kind": kind},
            }
        )

    assert not machine("grblhal", "manual").has_changer
    assert machine("grblhal", "external").has_changer
    assert machine("grbl-1.1", "manual").has_changer
