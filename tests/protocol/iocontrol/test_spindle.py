"""What is known of the tool in the spindle: a changer knows, a person is asked where hands may have been in between."""

from collections.abc import Callable
from typing import Literal

import pytest

from protocol.iocontrol.board import Board
from protocol.iocontrol.config import AbortReason, IoConfig
from protocol.iocontrol.events import ToolChanged
from protocol.iocontrol.pins import Pin
from protocol.iocontrol.spindle import UNKNOWN, Spindle
from tests.protocol.iocontrol.scene import Scene, changing, external

MANUAL = IoConfig(kind="manual")


def asked(scene: Scene, number: int) -> bool:
    """T and M6 for a tool; whether anybody is asked for it."""
    scene.io.prepare(number, scene.tick())
    scene.io.change(scene.tick())
    scene.sequence()
    return bool(scene.value("tool-change"))


def with_tool_5(config: IoConfig = MANUAL) -> Scene:
    scene = Scene(config)
    assert asked(scene, 5)
    scene.io.confirm(scene.tick())
    return scene


@pytest.mark.parametrize("kind", ["manual", "external", "loopback", "none"])
def test_only_hands_are_unseen(kind: Literal["manual", "external", "loopback", "none"]) -> None:
    spindle = Spindle(Board(2, 0.0), IoConfig(kind=kind), 5)
    assert spindle.certain == (kind != "manual")
    spindle.take(7)
    assert spindle.certain
    assert (spindle.needs(7), spindle.needs(5)) == (False, True)
    spindle.doubt()
    assert (spindle.certain, spindle.needs(7)) == ((False, True) if kind == "manual" else (True, False))


def test_a_tool_that_nobody_knows_is_needed_whichever_it_is() -> None:
    board = Board(2, 0.0)
    spindle = Spindle(board, IoConfig(kind="external"), None)
    assert (spindle.tool, spindle.certain, board[Pin.TOOL_NUMBER]) == (None, False, UNKNOWN)
    spindle.take(3)
    spindle.lose()
    assert (spindle.tool, spindle.needs(3), board[Pin.TOOL_NUMBER]) == (None, True, UNKNOWN)


def test_who_has_confirmed_a_tool_is_not_asked_for_it_again() -> None:
    scene = with_tool_5()
    assert scene.io.tool_certain
    assert not asked(scene, 5)
    assert scene.ends[-1] == ToolChanged(5, None, skipped=True)


def test_behind_a_start_a_person_is_asked_for_the_tool_that_was_in() -> None:
    scene = Scene(MANUAL, tool=5)
    assert not scene.io.tool_certain
    assert asked(scene, 5)
    assert scene.messages == ["See that tool 5 (six mm) is in the spindle, then confirm."]
    scene.io.confirm(scene.tick())
    assert scene.io.tool_certain


def test_no_tool_is_a_tool_to_be_asked_for_as_well() -> None:
    scene = Scene(MANUAL, tool=0)
    assert asked(scene, 0)
    assert scene.messages == ["See that no tool is in the spindle, then confirm."]


@pytest.mark.parametrize(
    "happens",
    [
        lambda io, now: io.abort(AbortReason.USER, now),
        lambda io, now: io.estop("user", now),
        lambda io, now: io.estop("external", now),
        lambda io, _now: io.doubt_tool(),
    ],
    ids=["abort", "e-stop", "external e-stop", "by hand"],
)
def test_where_hands_may_have_been_in_the_machine_a_person_is_asked(happens: Callable[..., None]) -> None:
    scene = with_tool_5()
    happens(scene.io, scene.tick())
    if not scene.io.motion_allowed:
        scene.io.estop_reset(scene.tick())
    assert not scene.io.tool_certain
    assert asked(scene, 5)


def test_a_person_who_says_which_tool_is_in_is_believed() -> None:
    scene = Scene(MANUAL, tool=5)
    scene.io.set_tool(5, scene.tick())
    assert scene.io.tool_certain
    assert not asked(scene, 5)


def test_always_ask() -> None:
    scene = with_tool_5(IoConfig(kind="manual", always_ask=True))
    assert scene.io.tool_certain
    assert asked(scene, 5)
    assert scene.messages == ["See that tool 5 (six mm) is in the spindle, then confirm."]


def test_a_changer_that_was_aborted_still_knows_its_tool() -> None:
    scene = changing(external())
    scene.inputs(tool_changed=True)
    scene.inputs(tool_changed=False)
    scene.io.abort(AbortReason.USER, scene.tick())
    scene.inputs(emc_abort_ack=True)
    scene.inputs(emc_abort_ack=False)
    scene.io.prepare(5, scene.tick())
    scene.inputs(tool_prepared=True)
    scene.io.change(scene.tick())
    assert "tool-change^" not in scene.sequence()
