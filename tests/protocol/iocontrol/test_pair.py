"""A block against the virtual changer over a network: both know the same tool, or it is said that nobody does."""

from random import Random

import pytest

from protocol.iocontrol.config import AbortReason, IoConfig
from protocol.iocontrol.control import IoControl
from protocol.iocontrol.events import ChangeFailed, PrepareFailed, TableChanged, ToolChanged
from protocol.iocontrol.tables import State
from protocol.iocontrol.tooltable import parse
from sim.changer.changer import VirtualChanger
from sim.changer.settings import EMPTY_POCKET, ChangerSettings
from tests.protocol.iocontrol.changerpair import Pair

TABLE, _ = parse("".join(f"T{n} P{n}\n" for n in range(1, 9)))
RANDOM, _ = parse("T9 P0\n" + "".join(f"T{n} P{n}\n" for n in range(1, 5)) + "T0 P5\n", random=True)


def pair(
    settings: ChangerSettings | None = None, *, seed: int = 0, latency_s: float = 0.03, start: bool = True
) -> Pair:
    config = IoConfig(kind="external", support_start_change=start)
    made = Pair(
        IoControl(config, TABLE, 0.0), VirtualChanger(settings or ChangerSettings()), seed=seed, latency_s=latency_s
    )
    made.run(1.0)
    made.io.estop_reset(made.now)
    made.pump()
    made.run(1.0)
    assert made.io.start_refusal is None
    return made


def test_a_program_of_changes() -> None:
    scene = pair()
    for tool in (5, 3, 3, 0, 8):
        scene.prepare(tool)
        scene.change()
        scene.run(20.0)
        assert scene.io.tool == scene.changer.magazine.spindle == tool
        assert scene.io.motion_allowed
    assert [event.number for event in scene.of(ToolChanged)] == [5, 3, 3, 0, 8]  # type: ignore[attr-defined]
    assert scene.messages == []


def test_a_random_changer_and_its_table_stay_together() -> None:
    magazine = {tool.pocket: tool.number for tool in RANDOM.tools if tool.pocket}
    changer = VirtualChanger(ChangerSettings(magazine=magazine, spindle=9, random=True))
    scene = Pair(IoControl(IoConfig(kind="external", start_in_estop=False), RANDOM, 0.0), changer, latency_s=0.03)
    scene.run(1.0)
    for tool in (2, 4, 0, 9, 2):
        scene.prepare(tool)
        scene.run(5.0)
        scene.io.change(scene.now)
        scene.pump()
        scene.run(10.0)
        assert scene.io.tool == changer.magazine.spindle == tool
        table = scene.io.tool_table
        assert table is not None
        assert {entry.pocket: entry.number for entry in table.tools if entry.pocket} == changer.magazine.pockets
    assert len(scene.of(TableChanged)) == 5


def test_an_abort_in_the_middle_leaves_both_with_the_old_tool() -> None:
    scene = pair()
    scene.prepare(5)
    scene.run(5.0)
    scene.change()
    scene.run(1.0)
    assert scene.io.state is State.CHANGING
    scene.io.abort(AbortReason.USER, scene.now)
    scene.pump()
    scene.run(10.0)
    assert scene.io.tool == scene.changer.magazine.spindle == 0
    assert scene.io.start_refusal is None
    assert scene.messages == []


def test_an_empty_pocket_is_found_while_preparing_and_the_m6_aborts() -> None:
    scene = pair(ChangerSettings(magazine={1: 1}))
    scene.prepare(5)
    scene.run(5.0)
    assert scene.io.faulted
    scene.change()
    scene.run(5.0)
    assert [(end.cause, end.reason) for end in scene.of(ChangeFailed)] == [("fault", EMPTY_POCKET)]  # type: ignore[attr-defined]
    assert scene.messages == [f"toolchanger error {EMPTY_POCKET}"]
    assert not scene.io.may_fail
    scene.changer.press_clear(scene.now)
    scene.pump()
    scene.run(1.0)
    assert not scene.io.faulted


def test_a_button_stops_everything_and_a_reset_goes_on() -> None:
    scene = pair()
    scene.prepare(5)
    scene.run(5.0)
    scene.change()
    scene.changer.press_estop(scene.now)
    scene.pump()
    scene.run(5.0)
    assert scene.io.estop_state.name == "EXTERNAL"
    assert scene.changer.magazine.spindle == 0
    scene.changer.release_estop(scene.now)
    scene.io.estop_reset(scene.now)
    scene.pump()
    scene.run(5.0)
    assert scene.io.start_refusal is None
    scene.prepare(5)
    scene.run(5.0)
    scene.change()
    scene.run(10.0)
    assert scene.io.tool == scene.changer.magazine.spindle == 5


def test_a_changer_that_is_silent_is_given_up_by_a_person() -> None:
    scene = pair(ChangerSettings(silence=1.0))
    scene.prepare(5)
    scene.run(100.0)
    assert scene.io.waiting_for.overdue
    scene.io.fail(scene.now)
    scene.pump()
    scene.run(5.0)
    assert [end.cause for end in scene.of(PrepareFailed)] == ["operator"]  # type: ignore[attr-defined]
    assert scene.io.state is State.IDLE


@pytest.mark.parametrize("seed", range(60))
def test_both_know_the_same_tool_or_it_is_said(seed: int) -> None:
    """Programs of changes with aborts, faults, breaks of the network and silence, each seed another one."""
    random = Random(seed)
    settings = ChangerSettings(
        seed=seed,
        jitter=0.3,
        prepare_fault=0.1,
        change_fault=0.15,
        both=0.1,
        silence=0.05,
        reasons=(-5, 0, 4),
        on_abort="finish" if seed % 4 == 3 else "restore",
    )
    scene = pair(settings, seed=seed, latency_s=0.05, start=bool(seed % 2))
    for _ in range(12):
        told = len(scene.messages)
        scene.prepare(random.randrange(9))
        scene.run(random.choice((0.0, 1.0, 5.0)))
        scene.change()
        scene.run(random.uniform(0.0, 4.0))
        if random.random() < 0.3:
            scene.io.abort(AbortReason.USER, scene.now)
        elif random.random() < 0.2:
            scene.cut()
            scene.run(random.uniform(0.0, 3.0))
            scene.mend()
        scene.pump()
        scene.run(20.0)
        if scene.io.may_fail and not scene.io.change_pending and scene.io.state is State.PREPARING:
            scene.io.fail(scene.now)
        elif scene.io.may_fail:
            scene.run(400.0)
            if scene.io.may_fail:
                scene.io.fail(scene.now)
        scene.pump()
        scene.run(20.0)
        assert scene.io.state is State.IDLE
        truth = scene.changer.magazine.spindle
        looked_for = any("spindle" in message for message in scene.messages[told:])
        assert scene.io.tool in (truth, None) or looked_for, scene.changer.log
        scene.changer.press_clear(scene.now)
        scene.pump()
        scene.run(2.0)
        scene.changer.press_clear(scene.now, down=False)
        scene.pump()
        scene.run(2.0)
        scene.io.set_tool(truth, scene.now)
        scene.pump()
        assert scene.io.start_refusal is None
