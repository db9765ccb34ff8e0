"""Blocks one after the other in time, without a wire."""

import pytest

from sim.elvinto.commands import Command
from sim.elvinto.events import AlarmRaised, BlockFinished, BlockStarted, CommandEnded, ToolWanted
from sim.elvinto.executor import Asked, Executor, ProgramEnded
from sim.elvinto.mill import Mill
from sim.elvinto.settings import SimSettings


def executor(settings: SimSettings) -> Executor:
    return Executor(settings, Mill(settings))


def kinds(happenings: object) -> list[type]:
    assert hasattr(happenings, "__iter__")
    return [type(happening) for happening in happenings]


def test_instant_blocks_all_happen_at_once() -> None:
    runs = executor(SimSettings(instant=True))
    happenings = list(runs.start(Command.batch(3, ["G0X1", "W95", "M30"]), 5.0))
    assert kinds(happenings) == [
        BlockStarted,
        BlockFinished,
        BlockStarted,
        Asked,
        BlockFinished,
        BlockStarted,
        ProgramEnded,
        BlockFinished,
        CommandEnded,
    ]
    assert runs.command is None
    assert runs.ends_at is None
    assert runs.has_moved


def test_blocks_take_their_time() -> None:
    runs = executor(SimSettings(rapid_mm_min=6000, acceleration=500, speed_factor=2))
    assert kinds(runs.start(Command.batch(3, ["G0X100", "G0X0"]), 10.0)) == [BlockStarted]
    assert runs.ends_at == pytest.approx(10.6)
    assert runs.shown(10.3)[0] == pytest.approx(50)
    assert runs.shown(99.0)[0] == 100
    assert kinds(runs.advance(10.6)) == [BlockFinished, BlockStarted]
    assert runs.ends_at == pytest.approx(11.2)
    assert kinds(runs.advance(11.2)) == [BlockFinished, CommandEnded]


def test_an_empty_batch_is_done_at_once() -> None:
    assert list(executor(SimSettings()).start(Command.batch(3, []), 0.0)) == [CommandEnded(3, None)]


def test_queries_alone_are_quiet() -> None:
    assert Command.batch(1, ["W95", "w90"]).quiet
    assert not Command.batch(1, ["W95", "G0X1"]).quiet


def test_abort_leaves_the_carriage_where_it_is() -> None:
    settings = SimSettings(rapid_mm_min=6000, acceleration=500)
    runs = executor(settings)
    list(runs.start(Command.batch(3, ["G0X100", "G0X0"]), 0.0))
    runs.abort(0.6)
    assert runs.command is None
    assert runs.shown(9.0)[0] == pytest.approx(50)
    runs.abort(0.7)
    assert runs.shown(9.0)[0] == pytest.approx(50)


def test_abort_during_the_second_leg_of_homing() -> None:
    settings = SimSettings(rapid_mm_min=6000, acceleration=500, safe_z=100, start_position=(0, 100, 0))
    runs = executor(settings)
    list(runs.start(Command.batch(3, ["G28"]), 0.0))
    assert runs.homing
    runs.abort(1.8)
    assert runs.shown(9.0)[:3] == (0, pytest.approx(-50), 100)


def test_a_tool_change_that_waits() -> None:
    runs = executor(SimSettings(instant=True, tool_change="wait", safe_z=5))
    assert kinds(runs.start(Command.batch(1, ["M6T2", "G0X1"]), 0.0)) == [BlockStarted, ToolWanted]
    assert runs.ends_at is None
    assert runs.command is not None
    assert runs.shown(0.0)[2] == 5
    assert kinds(runs.advance(7.0)) == [BlockFinished, BlockStarted, BlockFinished, CommandEnded]


def test_an_alarm_ends_the_command_without_ending_it() -> None:
    runs = executor(SimSettings(instant=True))
    happenings = list(runs.start(Command.batch(1, ["W72", "G0X-5", "G0X1"]), 0.0))
    assert happenings[-1] == AlarmRaised(5, 1)
    assert CommandEnded not in kinds(happenings)
    assert runs.command is None


def test_a_file_ends_at_m30_a_batch_does_not() -> None:
    settings = SimSettings(instant=True)
    from_card = Command(1, iter(["M30", "G0X1"]), from_card=True)
    assert kinds(executor(settings).start(from_card, 0.0)).count(BlockStarted) == 1
    assert kinds(executor(settings).start(Command.batch(1, ["M30", "G0X1"]), 0.0)).count(BlockStarted) == 2
