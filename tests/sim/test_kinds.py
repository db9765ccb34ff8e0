"""Settings of a kind make a machine of that kind."""

import pytest

from sim.elvinto.machine import VirtualElvinto
from sim.elvinto.settings import SimSettings as ElvintoSettings
from sim.grbl.machine import VirtualGrbl
from sim.grbl.simsettings import SimSettings as GrblSettings
from sim.kinds import Recorded, build
from sim.ncframe.machine import VirtualLathe
from sim.ncframe.settings import SimSettings as LatheSettings


def test_each_kind() -> None:
    assert isinstance(build(ElvintoSettings(), now=0.0), VirtualElvinto)
    assert isinstance(build(GrblSettings(), now=0.0), VirtualGrbl)
    assert isinstance(build(LatheSettings(), now=0.0), VirtualLathe)


def test_what_it_executes_is_handed_over() -> None:
    seen: list[Recorded] = []
    machine = build(GrblSettings(instant=True), now=0.0, on_block=seen.append)
    machine.receive_data(b"\nG1X1F100\n", 0.0)
    assert [(block.id, block.text) for block in seen] == [(2, "G1X1F100")]


def test_frames_are_handed_over_as_text() -> None:
    seen: list[Recorded] = []
    machine = build(LatheSettings(instant=True, check="none"), now=0.0, on_block=seen.append)
    machine.receive_data(bytes.fromhex("A0 01 FF FF FF"), 0.0)
    assert [(block.id, block.text) for block in seen] == [(1, "G1 X-1")]


def test_a_setting_that_is_none_is_refused() -> None:
    with pytest.raises(ValueError, match=r"\$999"):
        build(GrblSettings(dollar={999: 1.0}), now=0.0)
