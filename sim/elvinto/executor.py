"""Runs the blocks of one command, one after the other, in simulated time.

It knows neither IDs' rules nor the wire: it says what happened, `machine.py` answers. The one rule: a block is taken
from the command only when the block before it has ended, so an error or an alarm leaves the rest untouched.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import accumulate

from sim.elvinto.commands import Command
from sim.elvinto.events import AlarmRaised, BlockFinished, BlockStarted, CommandEnded, Executed, SimEvent, ToolWanted
from sim.elvinto.gcode import BlockError
from sim.elvinto.mill import ALARM_EMERGENCY, Mill, Plan
from sim.elvinto.settings import SimSettings
from sim.motion import Point


@dataclass(frozen=True, slots=True)
class Asked:
    """A query block (W95, W96, W97) wants its answer now."""

    code: str


@dataclass(frozen=True, slots=True)
class ProgramEnded:
    """M30 or M99 was executed: the memory of IDs is reset (§6)."""


class Executor:
    """`ends_at` is the end of the present block in the caller's clock, None when idle or when a person has to act."""

    def __init__(self, settings: SimSettings, mill: Mill) -> None:
        self._settings = settings
        self._mill = mill
        self.command: Command | None = None
        self.ends_at: float | None = None
        self.has_moved = False
        self._plan: Plan | None = None
        self._block: Executed | None = None
        self._leg_ends_s: list[float] = []
        """Of the present plan, if it has legs and they take time."""
        self._tool_said = False

    def start(self, command: Command, at: float) -> Iterator[SimEvent | Asked | ProgramEnded]:
        self.command = command
        self.has_moved = False
        return self.advance(at)

    def advance(self, at: float) -> Iterator[SimEvent | Asked | ProgramEnded]:
        """The present block has ended at `at` (or there is none yet): what follows, until time has to pass again."""
        while (command := self.command) is not None:
            plan = self._plan
            if plan is None:
                text = next(command.blocks, None)
                yield self._end_command(None) if text is None else self._begin_block(text, command, at)
            elif plan.only_moves:
                self._mill.stop(plan, 0, None)
                yield self._finish_block(at)
                continue
            else:
                yield from self._end_block(plan, at)
            if self._plan is not None and (self.ends_at is None or self.ends_at > at):
                return

    def abort(self, at: float) -> None:
        """The carriage stops where it is; the rest of the command is forgotten."""
        if self._plan is not None and self._plan.legs:
            index, elapsed_s = self._leg_at(at)
            self._mill.stop(self._plan, index, elapsed_s)
        self._clear()

    @property
    def homing(self) -> bool:
        """The limit switches are watched now (§7)."""
        return self._plan is not None and self._plan.homes

    @property
    def moving(self) -> bool:
        return self._plan is not None and bool(self._plan.legs)

    def shown(self, at: float) -> Point:
        """Coordinates as STATE prints them, in the middle of a block too."""
        if self._plan is None or not self._plan.legs or self._tool_said:
            return self._mill.shown
        index, elapsed_s = self._leg_at(at)
        return self._plan.legs[index].after(elapsed_s)

    def _leg_at(self, at: float) -> tuple[int, float]:
        assert self._plan is not None
        assert self._block is not None
        elapsed_s = (at - self._block.at) * self._settings.speed_factor
        before_s = 0.0
        for index, end_s in enumerate(self._leg_ends_s):
            if elapsed_s < end_s:
                return index, elapsed_s - before_s
            before_s = end_s
        last = len(self._plan.legs) - 1
        return last, self._plan.legs[last].seconds

    def _begin_block(self, text: str, command: Command, at: float) -> SimEvent:
        try:
            plan = self._plan = self._mill.begin(text)
        except BlockError as error:
            return self._end_command(error.num)
        block = self._block = Executed(text, command.id, at)
        self.ends_at = at
        if legs := plan.legs:
            self.has_moved = True
            if not self._settings.instant:
                self._leg_ends_s = list(accumulate(leg.seconds for leg in legs))
                self.ends_at = at + self._leg_ends_s[-1] / self._settings.speed_factor
        return BlockStarted(block)

    def _end_block(self, plan: Plan, at: float) -> Iterator[SimEvent | Asked | ProgramEnded]:
        assert self.command is not None
        if not self._tool_said:
            self._mill.stop(plan, 0, None)
        if plan.alarm is not None:
            yield self._alarm(*plan.alarm)
            return
        if plan.tool is not None and not self._tool_said:
            self._tool_said = True
            yield ToolWanted(plan.tool)
            if self._settings.tool_change == "wait":
                self.ends_at = None
                return
        if plan.query is not None:
            yield Asked(plan.query)
        if plan.ends_program:
            yield ProgramEnded()
        from_card = self.command.from_card
        yield self._finish_block(at)
        if plan.emergency:
            yield self._alarm(ALARM_EMERGENCY, None)
        elif plan.ends_program and from_card:
            yield self._end_command(None)

    def _finish_block(self, at: float) -> BlockFinished:
        block = self._block
        assert block is not None
        block.finished, block.ended_at = True, at
        self._forget_block()
        return BlockFinished(block)

    def _alarm(self, num: int, axis: int | None) -> AlarmRaised:
        self._clear()
        return AlarmRaised(num, axis)

    def _end_command(self, error: int | None) -> CommandEnded:
        assert self.command is not None
        ended = CommandEnded(self.command.id, error)
        self._clear()
        return ended

    def _forget_block(self) -> None:
        self._plan = self._block = self.ends_at = None
        self._tool_said = False

    def _clear(self) -> None:
        self._forget_block()
        self.command = None
