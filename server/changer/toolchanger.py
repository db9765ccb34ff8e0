"""The tool changer of one machine: what people and the changer itself say to it, and how it is shown.

What the job wants and what happens then is in changer/shell.py. The one rule: what the block does not take now is
refused with the reason, and nothing has changed.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import timedelta
from types import MappingProxyType
from typing import Any

from gcode.words import parse_block
from jobs import history
from jobs.effects import ToolAsk
from jobs.toolblocks import set_by
from jobs.toolside import COOLANT_OFF, COOLANTS
from protocol.errors import LocalError
from protocol.iocontrol.pins import PINS, Pin, PinError
from server.changer.shell import ChangerShell
from server.changer.views import io_view, table_of, table_view
from server.clock import rfc3339
from server.problems import ProblemError

MIST, FLOOD = COOLANTS
PROGRAM_ENDS = frozenset({"M2", "M30"})
EVENTS_LISTED = 10_000
"""Most events of one answer."""


class ToolChanger(ChangerShell):
    """See the head of this file."""

    # --- people -----------------------------------------------------------------------------------------------

    def confirm(self) -> None:
        """The tool is in. Raises ProblemError."""
        if not self.io.may_confirm:
            raise ProblemError("wrong_state", f"{self.machine} does not wait for a tool.")
        self._job.note("tool_confirmed", tool=self.io.waiting_for.tool)
        self._by_person = True
        try:
            with self._verb() as now:
                self.io.confirm(now)
        finally:
            self._by_person = False

    def fail(self) -> None:
        """The tool cannot be changed. Raises ProblemError."""
        again, self._again = self._again, None
        if not self.io.may_fail and again is None:
            raise ProblemError("wrong_state", f"No tool is being changed on {self.machine}.")
        with self._verb() as now:
            if self.io.may_fail:
                self.io.fail(now)
        if again is not None:
            self._fail_job("the operator says that it has failed", goes_on=False)

    def clear_fault(self) -> None:
        """Forget the fault. Raises ProblemError."""
        if not self.io.may_clear_fault:
            still = "the changer still has it" if self.io.faulted else "there is none"
            raise ProblemError("wrong_state", f"The fault of {self.machine}'s tool changer cannot be cleared: {still}.")
        with self._verb() as now:
            self.io.clear_fault(now)

    def set_tool(self, number: int) -> None:
        """This is the tool in the spindle. Raises ProblemError."""
        if self.io.tool_table is not None and self.io.tool_table.place(number) is None:
            raise ProblemError("invalid_request", f"Tool {number} is not in the tool table of {self.machine}.")
        if self.io.change_pending:
            raise ProblemError("wrong_state", f"A tool change is pending on {self.machine}: confirm it, or fail it.")
        with self._verb() as now:
            self.io.set_tool(number, now)

    def typed(self, block: str, *, turret: bool) -> None:
        """A block that somebody has typed is executed: coolant follows it, and it may have brought another tool.
        `turret`: a T turns it at once. Where the machine asks for the tool of an M6, that dialogue is open already."""
        parsed = parse_block(block)
        for word in parsed.words:
            if word.letter == "M" and word.value in self.coolant_codes:
                self.ask(ToolAsk("coolant", int(word.value)))
            elif word.code in PROGRAM_ENDS:
                self.ask(ToolAsk("coolant", COOLANT_OFF))
        codes, number = {word.code for word in parsed.words}, set_by(parsed)
        if "M61" in codes and number is not None and not self.io.change_pending:
            with self._verb() as now:
                self.io.set_tool(number, now)
        elif ("M6" in codes or (turret and "T" in {word.letter for word in parsed.words})) and not self._asked():
            self.io.doubt_tool()
            self._job.note("tool_by_hand", block=block)

    def coolant_switched(self, coolant: str, *, on: bool) -> None:
        """Somebody has switched it at the controller, which shows it. `coolant`: flood or mist."""
        code = MIST if coolant == "mist" else FLOOD
        self.ask(ToolAsk("coolant", code if on else -code))

    # --- the changer ------------------------------------------------------------------------------------------

    def drive(self, levels: Mapping[str, object], by: object = None) -> None:
        """Levels of inputs. `by`: the connection over which an external changer says them: its first words are all its
        levels. Raises ProblemError."""
        with self._verb() as now, refusing(levels):
            if by is None or by is self._connection or self.config.kind != "external":
                self.io.set_inputs(levels, now)
            else:
                self.io.connect(levels, now)
                self._connection = by

    def leave(self, by: object) -> None:
        """A connection has ended: if it was the changer's, the changer is gone."""
        if by is self._connection:
            self._connection = None
            if self._farewell:
                return
            with self._verb() as now:
                self.io.disconnect(now)

    def say_farewell(self) -> None:
        """The daemon is going to end its connections: none of those is lost, and no fault is latched for it (§2)."""
        self._farewell = True

    async def events(self, after: int = 0) -> list[dict[str, Any]]:
        """What happened here, with a job or without: those with an `id` above `after`, oldest first."""
        found: list[dict[str, Any]] = await self._db.read(
            history.of_tools, self.machine, limit=EVENTS_LISTED, after=after
        )
        return found

    # --- the tool table ---------------------------------------------------------------------------------------

    def io_view(self) -> dict[str, Any]:
        """The pins and what stands behind them."""
        now_s, now = self._loop.time(), self._clock.now()
        return io_view(self.io, lambda since_at: rfc3339(now - timedelta(seconds=now_s - since_at)))

    def tools_view(self) -> dict[str, Any]:
        """The tool table."""
        return table_view(self.io)

    @property
    def known_tools(self) -> frozenset[int] | None:
        """The numbers that a T finds; None: every number is a tool."""
        table = self.io.tool_table
        return None if table is None else table.numbers

    def replace_table(self, text: str | None, tools: Sequence[dict[str, Any]] | None) -> dict[str, Any]:
        """Another tool table. Raises ProblemError."""
        table, warnings = table_of(text, tools, random=self.config.random)
        with self._verb() as now, refusing():
            self.io.set_table(table, now)
        self._keep()
        self._job.note("tool_table", tools=0 if table is None else len(table.tools))
        return table_view(self.io, warnings)


@contextmanager
def refusing(levels: Mapping[str, object] = MappingProxyType({})) -> Iterator[None]:
    """What the block does not take is a refusal. A pin or a level that does not exist is a wrong request."""
    try:
        yield
    except LocalError as error:
        unknown = isinstance(error, PinError) and any(not _is_level(*item) for item in levels.items())
        raise ProblemError("invalid_request" if unknown else "wrong_state", f"{error}.") from error


def _is_level(pin: str, value: object) -> bool:
    """Whether there is such a pin that has such levels."""
    spec = PINS.get(Pin(pin)) if pin in list(Pin) else None
    return spec is not None and isinstance(value, bool) == (spec.type == "bit")
