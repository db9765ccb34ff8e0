"""The I/O control block of one machine: levels and requests in, events and one deadline out. No I/O, no clock.

The shell calls a verb, drains `next_event`, drives the pins of `PinChanged`, and re-arms its timer from `next_timer`.
What is asked of the changer and in which order is in handshake.py, the e-stop in estop.py, the states in tables.py.
The one rule: inputs are levels. After every verb the block goes on until no level moves it any further, so an answer
that is TRUE before it is asked for completes its request at once (sheet §1).
"""

from collections.abc import Mapping
from typing import Literal

from protocol.errors import LocalError
from protocol.iocontrol.board import Board
from protocol.iocontrol.changerlink import ChangerLink
from protocol.iocontrol.config import CONNECTION_LOST, AbortReason, IoConfig
from protocol.iocontrol.estop import EStopChain
from protocol.iocontrol.events import (
    AnswerIgnored,
    ChangeFailed,
    Event,
    OperatorMessage,
    PrepareFailed,
    RequestIgnored,
    SetToolFailed,
    Snapshot,
    ToolSet,
    WaitingFor,
)
from protocol.iocontrol.handshake import Handshake
from protocol.iocontrol.latch import FaultLatch
from protocol.iocontrol.pins import JUMPERS, PINS, Pin, PinError, checked_input, pins_of
from protocol.iocontrol.requests import Failure
from protocol.iocontrol.tables import EStop, State
from protocol.iocontrol.texts import at, late, wanted
from protocol.iocontrol.tooltable import ToolTable
from protocol.iocontrol.view import ANSWERS, IoView


class IoControl(IoView):
    """`tool`: what is in the spindle, 0 none, None not known; a random changer's table knows better. `fault`: latched
    before and not cleared. Starts with the abort of §1: a changer could be in the middle of something."""

    def __init__(
        self, config: IoConfig, table: ToolTable | None, now: float, *, tool: int | None = 0, fault: int | None = None
    ) -> None:
        self.config = config
        if table is not None and table.random and tool is not None:
            tool = table.in_spindle
        self._board = Board(config.protocol_version, now)
        self._latch = FaultLatch(self._board)
        self._handshake = Handshake(self._board, config, self._latch, table, tool)
        self._estop = EStopChain(
            self._board, self._handshake, self._latch, pulse_s=config.pulse_s, stopped=config.starts_in_estop
        )
        self._link = ChangerLink(self._board, external=config.kind == "external", timeout_s=config.ack_timeout_s)
        self._wired = frozenset(pin for pin in config.wired if pin in self._board)
        self._unwired = frozenset(
            pin for pin in pins_of(config.protocol_version) if PINS[pin].direction == "in" and pin not in self._wired
        )
        self._told = WaitingFor(None)
        if fault is not None:
            self._latch.set(fault)
        self._handshake.signal_start()
        self._settle()

    def next_event(self) -> Event | None:
        return self._board.next_event()

    def next_timer(self) -> float | None:
        """The earliest deadline, in the caller's seconds."""
        times = (self._handshake.wait.deadline_at, self._estop.reset_until, self._link.deadline_at)
        return min((at for at in times if at is not None), default=None)

    def handle_timer(self, now: float) -> None:
        """That deadline has come (calling early is harmless)."""
        self._board.now = now
        if self._estop.reset_until is not None and self._estop.reset_until <= now:
            self._estop.end_wait(self._level(Pin.EMC_ENABLE_IN))
        if self._link.deadline_at is not None and self._link.deadline_at <= now:
            self._link.time_out()
        if (deadline_at := self._handshake.wait.deadline_at) is not None and deadline_at <= now:
            self._overdue()
        self._settle()

    # --- the changer ----------------------------------------------------------------------------------------------

    def set_inputs(self, values: Mapping[str, object], now: float) -> None:
        """Levels that have changed, all in one step. Raises PinError, and then none of them counts.

        An external changer that has never connected is so from now on: over plain HTTP there is no other sign of it.
        One whose connection was lost has to `connect`, for a single level would leave the others FALSE.
        """
        levels = self._checked(values)
        if self._link.lost:
            raise PinError("the connection of the tool changer is lost: its levels count when it has connected again")
        self._board.now = now
        if not self._link.connected:
            self._connect(levels)
        else:
            self._put(levels)
        self._settle()

    def connect(self, values: Mapping[str, object], now: float) -> None:
        """An external changer has connected; `values` are all its levels, what is not in it is FALSE. Raises PinError,
        and LocalError for another kind."""
        levels = self._checked(values)
        if self.config.kind != "external":
            raise LocalError(f"a changer of kind {self.config.kind} does not connect")
        self._board.now = now
        if self._link.connected:  # another connection in its place: what it was asked is not known to the new one
            self._lose()
        self._connect(levels)
        self._settle()

    def disconnect(self, now: float) -> None:
        """The connection of an external changer is lost."""
        self._board.now = now
        if self.config.kind == "external" and self._link.connected:
            self._lose()
            self._settle()

    # --- the program ----------------------------------------------------------------------------------------------

    def prepare(self, tool: int, now: float, *, line: int | None = None) -> None:
        """T. Ends in `ToolPrepared` or `PrepareFailed`."""
        self._board.now = now
        place = self._handshake.place(tool)
        if not self._estop.enabled:
            self._board.emit(PrepareFailed(tool, "estop", "the e-stop is not reset", line))
        elif place is None:
            message = f"{at(line)}tool {tool} is not in the tool table"
            self._board.emit(PrepareFailed(tool, "unknown_tool", message, line))
            self._handshake.abort(AbortReason.TASK_EXEC_ERROR, Failure("aborted", message))
        else:
            self._handshake.request_prepare(place, line)
        self._settle()

    def start_change(self, now: float, *, line: int | None = None) -> None:
        """The first thing of an M6: `ChangeStarted` says when spindle and axes may go to the change position; then
        `change`. Raises LocalError where an M6 is open."""
        self._request_change(now, line, at_position=False)

    def change(self, now: float, *, line: int | None = None) -> None:
        """M6, the machine stands where tools are changed. Ends in `ToolChanged` or `ChangeFailed`. Raises LocalError
        where this was said already."""
        self._request_change(now, line, at_position=True)

    def set_tool(self, tool: int, now: float) -> None:
        """M61 Qn, and what a person says of a tool that is not known. Ends in `ToolSet` or `SetToolFailed`."""
        self._board.now = now
        if self._handshake.place(tool) is None:
            self._board.emit(SetToolFailed(tool, "unknown_tool", f"tool {tool} is not in the tool table"))
        elif self.change_pending:
            self._board.emit(SetToolFailed(tool, "change_pending", "a tool change is pending"))
        else:
            self._handshake.set_tool(tool)
            self._board.emit(ToolSet(tool))
        self._settle()

    def coolant(self, now: float, *, flood: bool | None = None, mist: bool | None = None) -> None:
        """M7, M8, M9; None leaves it as it is. No coolant comes on in an e-stop."""
        self._board.now = now
        if not self._estop.enabled and (flood or mist):
            self._board.emit(RequestIgnored("coolant", "the e-stop is not reset"))
            return
        self._board.next_step()
        if mist is not None:
            self._board.put(Pin.COOLANT_MIST, mist)
        if flood is not None:
            self._board.put(Pin.COOLANT_FLOOD, flood)

    def abort(self, reason: AbortReason, now: float, *, message: str = "the job was aborted") -> None:
        """The job, or what goes on without one, is aborted. A change that is committed stays committed."""
        self._board.now = now
        self._handshake.abort(reason, Failure("aborted", message))
        self._settle()

    # --- people ---------------------------------------------------------------------------------------------------

    def estop(self, kind: Literal["user", "external"], now: float) -> None:
        """E-stop; `external` where the machine itself reports one."""
        self._board.now = now
        if kind == "user":
            self._estop.press()
        else:
            self._estop.open()
        self._settle()

    def estop_reset(self, now: float) -> None:
        """Ask for the end of the e-stop: `EStopCleared` when the external chain is closed, else a message."""
        self._board.now = now
        self._estop.reset(self._level(Pin.TOOLCHANGER_FAULT))
        self._settle()

    def confirm(self, now: float) -> None:
        """A person answers in the changer's place. Raises LocalError unless `may_confirm`."""
        if not self.may_confirm:
            raise LocalError("nothing waits for a person to confirm it")
        self._board.now = now
        if self._handshake.in_doubt:
            self._handshake.settle()
        else:
            self._handshake.answered()
        self._settle()

    def fail(self, now: float, *, message: str = "the operator says that it has failed") -> None:
        """A person gives up what is under way: an abort with reason 100. Raises LocalError unless `may_fail`."""
        if not self.may_fail:
            raise LocalError("nothing is under way that could fail")
        self._board.now = now
        self._handshake.abort(AbortReason.USER, Failure("operator", message))
        self._settle()

    def doubt_tool(self) -> None:
        """Somebody may have changed the tool by hand: a person is asked for it the next time, whichever it is."""
        self._handshake.spindle.doubt()

    def clear_fault(self, now: float) -> None:
        """A person clears the latch. Raises LocalError unless `may_clear_fault`."""
        if not self.may_clear_fault:
            raise LocalError("no fault is latched, or the changer still has it")
        self._board.now = now
        self._board.next_step()
        self._latch.clear("operator")
        self._settle()

    def set_table(self, table: ToolTable | None, now: float) -> None:
        """Another tool table; pocket 0 of a random changer's is what is in the spindle. Raises LocalError while a tool
        is being prepared or changed, and where it has another place for one that is prepared."""
        prepared = self._handshake.prepared
        moved = prepared is not None and table is not None and table.place(prepared.number) != prepared
        if self._handshake.busy or moved:
            raise LocalError("the tool table cannot be changed while one of its tools is prepared or changed")
        self._board.now = now
        self._handshake.table = table
        if table is not None and table.random and table.in_spindle != self.tool:
            self._handshake.set_tool(table.in_spindle)
            self._board.emit(ToolSet(table.in_spindle))

    # --- inside ---------------------------------------------------------------------------------------------------

    def _request_change(self, now: float, line: int | None, *, at_position: bool) -> None:
        self._board.now = now
        number = self._handshake.wanted
        if not self._estop.enabled:
            self._board.emit(ChangeFailed(number, "estop", "the e-stop is not reset", line))
        elif self.config.kind == "none":
            message = f"{at(line)}this machine has no tool changer"
            self._board.emit(ChangeFailed(number, "no_changer", message, line))
            self._handshake.abort(AbortReason.TASK_EXEC_ERROR, Failure("aborted", message))
        else:
            self._handshake.request_change(line, at_position=at_position)
        self._settle()

    def _checked(self, values: Mapping[str, object]) -> dict[Pin, bool | int]:
        levels = dict(
            checked_input(name, value, version=self.config.protocol_version) for name, value in values.items()
        )
        for pin in levels:
            if pin in self._wired:
                raise PinError(f"{pin} is wired to {JUMPERS[pin]}: it is not driven from outside")
        return levels

    def _put(self, levels: Mapping[Pin, bool | int]) -> None:
        """Levels from outside, one step. An answer that rises while nothing asks for it is noted, and has no effect."""
        self._board.next_step()
        awaited = ANSWERS.get(self.state)
        risen = [pin for pin, value in levels.items() if value and not self._board[pin] and pin in ANSWERS.values()]
        for pin, value in levels.items():
            self._board.put(pin, value)
        for pin in risen:
            if pin is not awaited:
                self._board.emit(AnswerIgnored(str(pin), f"{self.state.name.lower()}: nothing waits for it"))
        if Pin.TOOL_CHANGED in risen and awaited is not Pin.TOOL_CHANGED and self._handshake.interrupted is not None:
            text = f"The changer says that tool {self._handshake.interrupted} is in, but the change was aborted before"
            self._board.emit(OperatorMessage(f"{text}: look which tool is in the spindle.", "error"))

    def _connect(self, levels: Mapping[Pin, bool | int]) -> None:
        """All levels anew, then the abort of a start-up: neither side knows what the other had in mind (§2)."""
        self._board.next_step()
        for pin in sorted(self._unwired):
            self._board.put(pin, levels.get(pin, False if PINS[pin].type == "bit" else 0))
        self._link.connect()
        if self.state is State.ABORTING:
            self._handshake.wait.resume()
        else:
            self._handshake.signal_start()
        self._board.emit(Snapshot(self._board.values()))

    def _lose(self) -> None:
        """Inputs do not count; a pending request is aborted, the fault is latched (§2)."""
        changing = self.state is State.CHANGING
        self._link.disconnect()
        self._board.next_step()
        if Pin.TOOLCHANGER_FAULTED in self._board:
            self._latch.set(CONNECTION_LOST)
        if self._handshake.busy and not self._handshake.in_doubt:
            self._handshake.abort_by_fault(CONNECTION_LOST, tool_lost=changing)
        else:
            self._board.emit(OperatorMessage(self._handshake.fault_text(CONNECTION_LOST), "error"))

    def _overdue(self) -> None:
        """A timeout has passed: people are told, and the request stays. Only a T that a fault has stopped is given up,
        for it cannot end any more (§2)."""
        waiting = self._handshake.waiting()
        self._handshake.wait.time_out()
        if self.state is State.PREPARING and self.faulted:
            self._board.next_step()
            self._handshake.abort_by_fault(self._latch.reason)
            return
        self._board.emit(OperatorMessage(late(waiting), "error"))

    # --- levels ---------------------------------------------------------------------------------------------------

    def _level(self, pin: Pin) -> bool | None:
        """A bit that comes in; None where its driver is not connected or the protocol version does not have it."""
        if pin not in self._board or (pin in self._unwired and not self._link.connected):
            return None
        return bool(self._board[pin])

    def _settle(self) -> None:
        """Go on until no level moves anything, then say what is waited for."""
        while self._follow_wires() or self._advance():
            pass
        if not self._link.connected:  # time does not count for one that cannot answer
            self._handshake.wait.suspend()
        waiting = self.waiting_for
        if (waiting.what, waiting.tool, waiting.overdue) != (self._told.what, self._told.tool, self._told.overdue):
            if waiting.what == "operator" and self._told.what != "operator":
                self._board.emit(OperatorMessage(wanted(waiting.tool, self.tool_table, self.tool), "wanted"))
            self._told = waiting
            self._board.emit(waiting)

    def _follow_wires(self) -> bool:
        """A jumper's input follows its output, one step behind."""
        behind = [pin for pin in self._wired if self._board[pin] != self._board[JUMPERS[pin]]]
        if behind:
            self._board.next_step()
            for pin in sorted(behind):
                self._board.put(pin, self._board[JUMPERS[pin]])
        return bool(behind)

    def _advance(self) -> bool:
        """One thing that the levels lead to. A fault comes first, for what the changer says with it is not to be
        believed; a tool that is in comes before an e-stop of the same step (§2)."""
        return (
            self._see_fault()
            or self._see_clear()
            or self._see_answer(State.CHANGING)
            or self._see_answer(State.PREPARING)
            or self._see_chain()
            or self._see_answer(State.ABORTING)
            or self._see_answer(State.STARTING)
            or (self._estop.enabled and self._link.connected and self._handshake.begin_next())
        )

    def _see_fault(self) -> bool:
        line, seen = self._level(Pin.TOOLCHANGER_FAULT), self._board[Pin.TOOLCHANGER_FAULT_ACK]
        if line is None or line == seen:
            return False
        self._board.next_step()
        self._board.put(Pin.TOOLCHANGER_FAULT_ACK, line)
        if line:
            reason = int(self._board[Pin.TOOLCHANGER_REASON])
            self._latch.set(reason)
            given_up = self.state is State.PREPARING and self._handshake.wait.overdue
            if (self.change_pending and not self._handshake.in_doubt) or given_up:
                both = self.state is State.CHANGING and self._level(Pin.TOOL_CHANGED) is True
                self._handshake.abort_by_fault(reason, in_doubt=both)
        return True

    def _see_clear(self) -> bool:
        """Only while the fault line is FALSE: a fault that is still there would be latched again at once (sheet §1)."""
        cleared = self._level(Pin.TOOLCHANGER_CLEAR_FAULT) and self._level(Pin.TOOLCHANGER_FAULT) is False
        if not cleared or not self.faulted:
            return False
        self._board.next_step()
        self._latch.clear("pin")
        return True

    def _see_answer(self, state: State) -> bool:
        pin = ANSWERS[state]
        if self.state is not state or not self._level(pin):
            return False
        if pin is Pin.TOOL_CHANGED and pin in self._unwired and self._board.older(pin, Pin.TOOL_CHANGE):
            text = "tool-changed was TRUE before it was asked for, so the change counts as done: look into the spindle"
            self._board.emit(OperatorMessage(text, "notice"))
        self._handshake.answered()
        return True

    def _see_chain(self) -> bool:
        chain = self._level(Pin.EMC_ENABLE_IN)
        if chain is True and self._estop.state is EStop.RESETTING:
            self._estop.close()
        elif chain is False and self._estop.enabled:
            self._estop.open()
        else:
            return False
        return True
