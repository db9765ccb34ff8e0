"""Every row of the sheet's order of events (tests/harness/changerrows.py) on the bare block."""

from dataclasses import replace
from typing import Any

import pytest

from protocol.iocontrol.config import AbortReason, IoConfig
from protocol.iocontrol.events import AnswerIgnored, ChangeFailed, ChangeStarted, Event, PrepareFailed
from protocol.iocontrol.tooltable import parse
from tests.harness.changerrows import ROWS, Row
from tests.protocol.iocontrol.scene import Scene, notation

TIMES = {"prepare_timeout": "prepare_timeout_s", "change_timeout": "change_timeout_s"}
COOLANT = {"M8": {"flood": True}, "M9": {"flood": False, "mist": False}}


class Bare:
    """Does the steps of a row; the words of a program come as it gets to them."""

    def __init__(self, row: Row) -> None:
        settings = {TIMES.get(key, key): value for key, value in row.settings.items() if key != "random"}
        config = replace(IoConfig(kind="external", start_in_estop=False, ack_timeout_s=30.0), **settings)
        table = None if row.table is None else parse(row.table, random=bool(row.settings.get("random")))[0]
        self.scene = Scene(config, table, tool=row.spindle)
        self.io = self.scene.io
        self.io.connect({"emc-enable-in": True}, self.scene.tick())
        for level in (True, False):
            self.io.set_inputs({"emc-abort-ack": level}, self.scene.tick())
        self.scene.sequence()
        self.words: list[str] = []
        self.arriving = False
        self.events: list[Event] = []

    def do(self, verb: str, what: Any) -> None:
        now = self.scene.tick()
        match verb:
            case "job":
                self.words = what.split()
            case "drive":
                self.io.set_inputs(what, now)
            case "rises" | "falls":
                while bool(self.scene.value(what)) != (verb == "rises"):
                    self.go_on()
            case "stays":
                self.wait(what)
            case "ends":
                while self.going_on:
                    self.go_on()
            case _:
                self.people(verb, now)
        self.drain()

    def people(self, verb: str, now: float) -> None:
        self.words, self.arriving = [], False
        match verb:
            case "cancel":
                self.io.abort(AbortReason.USER, now)
            case "estop":
                self.io.estop("user", now)
            case "reset":
                self.io.estop_reset(now)
            case _:
                raise AssertionError(verb)

    @property
    def going_on(self) -> bool:
        """The program has something left to do."""
        return bool(self.words) or self.arriving

    def go_on(self) -> None:
        """The machine arrives where tools are changed, or the next word of the program; else time passes."""
        now = self.scene.tick()
        if self.arriving:
            self.arriving = False
            self.io.change(now)
        elif not self.words:
            assert self.io.next_timer() is not None, "nothing more will happen"
            self.scene.now = max(now, self.io.next_timer() or 0.0)
            self.io.handle_timer(self.scene.now)
        elif (word := self.words.pop(0)).startswith("T"):
            self.io.prepare(int(word[1:]), now)
        elif word == "M6":
            self.io.start_change(now)
        else:
            self.io.coolant(now, **COOLANT[word])
        self.drain()

    def wait(self, seconds: float) -> None:
        until = self.scene.now + seconds
        while (at := self.io.next_timer()) is not None and at <= until:
            self.io.handle_timer(at)
        self.scene.now = until

    def drain(self) -> None:
        self.scene.sequence()
        self.events += self.scene.taken
        for event in self.scene.taken:
            match event:
                case ChangeStarted():
                    self.arriving = True
                case PrepareFailed(goes_on=False) | ChangeFailed(goes_on=False):
                    self.words, self.arriving = [], False
                case _:
                    pass


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.name)
def test_row(row: Row) -> None:
    bare = Bare(row)
    for verb, what in row.steps:
        bare.do(verb, what)
    while bare.going_on:
        bare.go_on()
    io = bare.io
    assert notation(bare.events) == row.sequence
    assert (io.tool, io.prepared, io.start_refusal) == (row.tool, row.prepared, row.refusal)
    assert tuple(io.parameters.values()) == row.parameters
    assert io.waiting_for.what == row.waits_for
    assert tuple(event.pin for event in bare.events if isinstance(event, AnswerIgnored)) == row.ignored


def test_every_row_of_the_sheet_has_a_name_of_its_own() -> None:
    assert len({row.name for row in ROWS}) == len(ROWS)
