"""The tables: complete, every state reached and left, and the page in docs/ made from them."""

import runpy
import sys
from enum import Enum
from pathlib import Path

import pytest

from protocol.errors import LocalError
from protocol.iocontrol.tables import (
    CONNECTION,
    ESTOP,
    HANDSHAKE,
    LATCH,
    PATIENCE,
    STATE_PIN,
    TABLES,
    Connection,
    EStop,
    Latch,
    Patience,
    Region,
    State,
    Trigger,
    page,
)

PAGE = Path(__file__).parents[3] / "docs" / "toolchanger-states.md"


def test_the_page_is_made_from_the_tables() -> None:
    hint = "run: python -m protocol.iocontrol.tables > docs/toolchanger-states.md"
    assert PAGE.read_text(encoding="utf-8") == page(), hint


def test_run_as_a_program_it_prints_the_page(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delitem(sys.modules, "protocol.iocontrol.tables")  # runpy warns about a module that is imported already
    runpy.run_module("protocol.iocontrol.tables", run_name="__main__")
    assert capsys.readouterr().out == page()


@pytest.mark.parametrize(
    ("table", "states", "first"),
    [
        (HANDSHAKE, State, State.IDLE),
        (ESTOP, EStop, EStop.USER),
        (LATCH, Latch, Latch.CLEAR),
        (CONNECTION, Connection, Connection.ABSENT),
        (PATIENCE, Patience, Patience.ON_TIME),
    ],
)
def test_every_state_can_be_reached_and_left(
    table: dict[tuple[Enum, Enum], Enum], states: type[Enum], first: Enum
) -> None:
    reached = {first}
    while more := {after for (before, _), after in table.items() if before in reached} - reached:
        reached |= more
    assert reached == set(states)
    assert {before for before, _ in table} == set(states)


def test_every_trigger_leads_somewhere() -> None:
    for _, table, _ in TABLES:
        triggers = {trigger for _, trigger in table}
        assert triggers == set(type(next(iter(triggers))))


def test_an_abort_leads_to_its_signal_from_everywhere() -> None:
    assert all(HANDSHAKE[state, Trigger.ABORT] is State.ABORTING for state in State)


def test_tool_change_rises_only_from_the_change_position() -> None:
    assert [before for (before, _), after in HANDSHAKE.items() if after is State.CHANGING] == [State.MOVING]


def test_every_state_has_its_pin() -> None:
    assert set(STATE_PIN) == set(State)
    assert {STATE_PIN[state] for state in (State.PREPARING, State.STARTING, State.CHANGING, State.ABORTING)} == {
        1,
        2,
        3,
        4,
    }


def test_a_way_that_is_not_in_the_table_is_a_bug() -> None:
    region = Region("handshake", HANDSHAKE, State.IDLE)
    with pytest.raises(LocalError, match="no way from IDLE by LOADED"):
        region.move(Trigger.LOADED)
    assert region.state is State.IDLE
