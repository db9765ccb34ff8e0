"""The tool side of a job under way: what is asked of the tool changer, and what its answers mean for the job.

Not the table of the dialogue (toolchange.py) and not the rest of a job (runner.py). The one rule: no block of an M6
is handed over before the changer has begun, and none behind it before the changer has ended.
"""

from dataclasses import dataclass
from typing import Literal

from jobs import outcome
from jobs.batch import PlannedBatch
from jobs.effects import Effect, SetHold, ToolAsk
from jobs.runstate import RunState
from jobs.toolchange import Phase, Step

COOLANTS = (7, 8)
COOLANT_OFF = 9
"""M7 and M8, and M9."""


@dataclass(slots=True)
class ToolSide(RunState):
    """See the head of this file. Every verb gives what follows from it."""

    def tool_started(self) -> list[Effect]:
        """The changer is ready: the machine may go to where tools are changed."""
        if self.tools.go(Step.STARTED):
            self._wishes.waiting, self._wishes.tool = False, None
        return self._drain()

    def tool_changed(self, *, by_person: bool) -> list[Effect]:
        """The tool is in. `by_person`: somebody has just said so. Where a daemon before us had asked for it, nobody may
        know any more that the machine is about to move: then somebody has to say so."""
        if self.tools.phase is Phase.CHANGING and self.tools.go(Step.ENDED):
            self._wishes.waiting, self._wishes.tool = False, None
            if self.tools.taken_up and not by_person and not self._wishes.hold:
                self._wishes.hold = True
                self._emit(SetHold(hold=True))
            self.tools.taken_up = False
        return self._drain()

    def tool_failed(self, message: str, *, goes_on: bool) -> list[Effect]:
        """The tool is not in, and will not be. `goes_on`: with the old one."""
        before = self.tools.phase
        self.tools.asked = None
        if not goes_on:
            self._stop(outcome.tool_change_failed(message))
        if self.tools.go(Step.ENDED):
            self._wishes.waiting, self._wishes.tool = False, None
            if goes_on and before is Phase.STARTING:
                self._leave_out()
        return self._drain()

    def tool_late(self) -> list[Effect]:
        """Whoever was asked to begin does not answer in time."""
        ahead = self.feed.ahead
        if self.tools.phase is Phase.STARTING:
            self._wishes.waiting, self._wishes.tool = True, None if ahead is None else ahead.batch.tool
        return self._drain()

    def tool_free(self, *, motion_allowed: bool) -> list[Effect]:
        """Whether the changer keeps the machine from moving has changed."""
        self.tools.motion_allowed = motion_allowed
        return self._drain()

    # --- inside -----------------------------------------------------------------------------------------------

    def _take_up_change(self) -> None:
        """The daemon before us died while a tool was waited for."""
        self.tools.go(Step.FOUND)
        self.tools.taken_up = True
        self._emit(ToolAsk("again", self._wishes.tool))

    def _may_go(self, batch: PlannedBatch) -> bool:
        """Whether the changer lets this batch go now; an M6 is begun with it."""
        if not self.has_changer:
            return True
        return self._may_change(batch) if batch.tool_change else self.tools.motion_allowed

    def _may_change(self, batch: PlannedBatch) -> bool:
        """What was before it is executed, the changer has begun."""
        tools, line = self.tools, batch.first_line
        if self.ledger.open or tools.phase is not Phase.NONE:
            return not self.ledger.open and tools.phase is Phase.READY
        if not tools.motion_allowed:
            return False
        if batch.tool is None:
            self._stop(outcome.no_tool_word(line))
        elif tools.go(Step.ASKED):
            if tools.asked != batch.tool:
                self._emit(ToolAsk("prepare", batch.tool, line))
            tools.asked = batch.tool
            self._emit(ToolAsk("start", batch.tool, line))
        return False

    def _handed_over(self, batch: PlannedBatch) -> None:
        """Its words for the changer: T is prepared while the machine goes on, and coolant is on before it is needed."""
        if not self.has_changer:
            return
        for letter, number in batch.io:
            if letter == "M" and number in COOLANTS:
                self._emit(ToolAsk("coolant", number, batch.first_line))
            elif letter == "M":
                pass  # it is needed until this is executed
            elif not batch.tool_change:
                self.tools.asked = number
                self._emit(ToolAsk("prepare", number, batch.first_line))

    def _arrived(self, batch: PlannedBatch) -> None:
        """A batch is executed: the machine stands where tools are changed, or an M61 has its turn."""
        if batch.tool_change:
            self._wishes.waiting, self._wishes.tool = True, batch.tool
            before = self.tools.phase
            if self.has_changer and self.tools.go(Step.ARRIVED):
                self.tools.taken_up = before is Phase.NONE
                asked: Literal["again", "change"] = "again" if before is Phase.NONE else "change"
                self._emit(ToolAsk(asked, batch.tool, batch.first_line))
        if self.has_changer:
            self._coolant_off(batch)
        if batch.set_tool is not None and self.has_changer:
            self._emit(ToolAsk("set", batch.set_tool, batch.first_line))

    def _coolant_off(self, batch: PlannedBatch) -> None:
        """An M9 is executed, or the end of the program, which is one too (RS-274): what is switched on behind it, here
        or in what was handed over since, stays on."""
        if not batch.io and not batch.ends_program:
            return
        said = [number for letter, number in batch.io if letter == "M"]
        if batch.ends_program:
            said.append(COOLANT_OFF)
        if COOLANT_OFF not in said:
            return
        behind = set(said[len(said) - said[::-1].index(COOLANT_OFF) :])
        for flight in self.ledger.open:
            behind |= {number for letter, number in flight.entry.batch.io if letter == "M"}
        off = [code for code in COOLANTS if code not in behind]
        for code in [COOLANT_OFF] if off == list(COOLANTS) else [-code for code in off]:
            self._emit(ToolAsk("coolant", code, batch.last_line))

    def _leave_out(self) -> None:
        """The M6 ahead did not begin: its block is not sent, and its line is done."""
        ahead, self.feed.ahead = self.feed.ahead, None
        if ahead is None or ahead.entry is None or not ahead.batch.tool_change:
            return
        self._emit(self.ledger.left_out(ahead.entry))
        self.feed.forget()
        if ahead.batch.locate_after:
            self.feed.relocate(self.ledger.position)
