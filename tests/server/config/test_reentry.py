"""`[machine.reentry]`: what it hands on to the core, and what it refuses."""

import pytest
from pydantic import ValidationError

from gcode.reentry import Way
from server.config.model import MachineConfig
from server.config.reentry import ReentryConfig, ReentryWish


def test_nothing_is_guessed_about_where_the_machine_may_move_freely() -> None:
    assert ReentryConfig().way(laser=False) is None


def test_every_key_is_handed_on() -> None:
    config = ReentryConfig(clearance=-5.0, clearance_is_machine=True, plunge_feed=80.0, spindle_wait=0.0)
    assert config.way(laser=True) == Way(-5.0, 80.0, 0.0, clearance_is_machine=True, laser=True)
    assert ReentryConfig(clearance=20.0).way(laser=False) == Way(20.0, 100.0, 3.0)


def test_a_request_says_it_anew() -> None:
    config = ReentryConfig(clearance=-5.0, clearance_is_machine=True, plunge_feed=80.0, spindle_wait=1.0)
    slower = ReentryWish(plunge_feed=10.0, spindle_wait=0.0)
    assert config.way(slower, laser=False) == Way(-5.0, 10.0, 0.0, clearance_is_machine=True)
    # 30 mm of the machine's own coordinates may be outside of it: a clearance of its own is one of the program.
    assert config.way(ReentryWish(clearance=30.0), laser=False) == Way(30.0, 80.0, 1.0)
    machine = ReentryWish(clearance=-1.0, clearance_is_machine=True)
    assert ReentryConfig().way(machine, laser=False) == Way(-1.0, 100.0, 3.0, clearance_is_machine=True)


@pytest.mark.parametrize("key", [{"clearance": 1e9}, {"plunge_feed": 0.0}, {"spindle_wait": -1.0}, {"lift": 3.0}])
def test_what_no_machine_has_is_refused(key: dict[str, float]) -> None:
    with pytest.raises(ValidationError):
        ReentryConfig.model_validate(key)


@pytest.mark.parametrize("protocol", ["elvinto", "grbl"])
def test_it_may_stand_for_every_protocol(protocol: str) -> None:
    machine = {"name": "m", "port": "sim:", "protocol": protocol, "reentry": {"clearance": 10.0}}
    assert MachineConfig.model_validate(machine).reentry.clearance == 10.0
