"""T and M6 as a handshake with the changer: what is asked, what is waited for, and how it ends.

It sees no inputs (control.py tells it that an answer came) and knows of e-stop and connection only that it is told to
abort. The orders of the pins within a step are those of the sheet, §2.
The one rule: every request that was taken ends in exactly one event, and the tool number changes with the commit of a
change, with M61, or to "not known", and never else.
"""

from protocol.errors import LocalError
from protocol.iocontrol.board import Board
from protocol.iocontrol.config import CONNECTION_LOST, AbortReason, IoConfig
from protocol.iocontrol.events import (
    AbortAcknowledged,
    AbortSignalled,
    Cause,
    ChangeFailed,
    ChangeStarted,
    OperatorMessage,
    PrepareFailed,
    TableChanged,
    ToolChanged,
    ToolPrepared,
    WaitingFor,
    What,
)
from protocol.iocontrol.latch import FaultLatch
from protocol.iocontrol.pins import Pin
from protocol.iocontrol.requests import Change, Failure, Prepare, Requests
from protocol.iocontrol.spindle import Spindle
from protocol.iocontrol.tables import HANDSHAKE, OPEN_STATES, STATE_PIN, Region, State, Trigger
from protocol.iocontrol.texts import at
from protocol.iocontrol.tooltable import NUMBER_MAX, Place, ToolTable
from protocol.iocontrol.waiting import Wait


class Handshake:
    """`prepared` is what an M6 loads."""

    def __init__(
        self, board: Board, config: IoConfig, latch: FaultLatch, table: ToolTable | None, tool: int | None
    ) -> None:
        self._board = board
        self._config = config
        self._latch = latch
        self._region = Region("handshake", HANDSHAKE, State.IDLE)
        self.wait = Wait(board)
        self.table = table
        self.spindle = Spindle(board, config, tool)
        self.prepared: Place | None = None
        self.interrupted: int | None = None
        """The tool of the last change, where an abort came into it: a late `tool-changed` speaks of this one."""
        self._requests = Requests()
        self._repeat: int | None = None
        """The tool of the last M6: a second M6 without a T between finds it in the spindle."""
        self._in_doubt = False

    # --- what is known --------------------------------------------------------------------------------------------

    @property
    def state(self) -> State:
        return self._region.state

    @property
    def tool(self) -> int | None:
        """The tool in the spindle: 0 none, None not known."""
        return self.spindle.tool

    @property
    def change_pending(self) -> bool:
        return self._requests.change_open

    @property
    def in_doubt(self) -> bool:
        """A change is open of which only a person can say how it ended."""
        return self._in_doubt

    @property
    def starting_up(self) -> bool:
        """The abort that is not acknowledged yet is that of a start-up or of a new connection."""
        return self.state is State.ABORTING and self._board[Pin.EMC_REASON] == AbortReason.NOT_ON

    @property
    def busy(self) -> bool:
        """A request is open: under way, or waiting its turn."""
        return bool(self._requests)

    @property
    def wanted(self) -> int | None:
        """The tool that an M6 would put in."""
        return self.prepared.number if self.prepared is not None else self._repeat

    def place(self, number: int) -> Place | None:
        """Where a tool is; without a table every number is a tool, in the pocket of its number."""
        if self.table is not None:
            return self.table.place(number)
        return Place(number, number, number) if 0 <= number <= NUMBER_MAX else None

    def waiting(self) -> WaitingFor:
        what, tool = self._awaited()
        return WaitingFor(None) if what is None else self.wait.describe(what, tool)

    def _awaited(self) -> tuple[What | None, int | None]:
        match self.state:
            case State.PREPARING:
                preparing = self._requests.preparing
                return "tool-prepared", None if preparing is None else preparing.place.number
            case State.STARTING:
                return "start-change-ack", self.wanted
            case State.MOVING:
                return "position", self.wanted
            case State.CHANGING:
                return ("operator" if self._config.kind == "manual" else "tool-changed"), self.wanted
            case State.ABORTING:
                return "emc-abort-ack", None
            case State.DOUBTING:
                return "verdict", self.wanted
            case State.IDLE:
                return None, None

    # --- requests -------------------------------------------------------------------------------------------------

    def request_prepare(self, place: Place, line: int | None) -> None:
        """T. It waits its turn; a T before it that has not been begun is not asked of the changer any more."""
        earlier = self._requests.add(Prepare(place, line))
        if earlier is not None:
            message = f"T{place.number} came before T{earlier.place.number} was begun"
            self._fail(earlier, Failure("superseded", message, goes_on=True))

    def request_change(self, line: int | None, *, at_position: bool) -> None:
        """M6, or the second half of one. Raises LocalError where an M6 is open that this cannot belong to."""
        requests = self._requests
        if not requests.change_open:
            if self._latch.faulted:
                requests.change = Change(line, at_position)
                self._board.next_step()
                self.abort_by_fault(self._latch.reason)
            else:
                requests.add(Change(line, at_position))
        elif not at_position or (requests.change is not None and requests.change.at_position):
            raise LocalError("a tool change is pending already")
        elif requests.change is None:
            requests.arrive()
        else:
            requests.change = Change(requests.change.line, True)
            if self.state is State.MOVING:
                self._load()

    def begin_next(self) -> bool:
        """Ask the next thing of the changer. False: nothing is to be asked, or something is under way."""
        request = self._requests.take() if self.state is State.IDLE else None
        if isinstance(request, Prepare):
            self._begin_prepare(request)
        elif isinstance(request, Change):
            self._begin_change(request)
        return request is not None

    def _begin_prepare(self, request: Prepare) -> None:
        self.prepared = self._repeat = None
        self._requests.preparing = request
        self._board.next_step()
        self._prep_pins(request.place)
        self._board.put(Pin.TOOL_PREPARE, True)
        self._go(Trigger.PREPARE)
        self.wait.begin(self._config.prepare_timeout_s)

    def _begin_change(self, request: Change) -> None:
        self._requests.change = request
        if self.prepared is None and (self._repeat is None or self._repeat != self.tool):
            message = f"{at(request.line)}M6 without a prepared tool: no T word came before it, or it came to nothing"
            self.abort(AbortReason.TASK_EXEC_ERROR, Failure("not_prepared", message))
        elif self._config.support_start_change:
            self._board.next_step()
            self._board.put(Pin.START_CHANGE, True)
            self._go(Trigger.START)
            self.wait.begin(self._config.ack_timeout_s)
        else:
            self._go(Trigger.OPEN)
            self._opened(request)

    def _opened(self, request: Change) -> None:
        """The changer is ready: the machine moves, or it has done so and the change itself is asked for."""
        self.wait.begin(0.0)
        if request.at_position:
            self._load()
        elif self.wanted is not None:
            self._board.emit(ChangeStarted(self.wanted, request.line))

    def _load(self) -> None:
        """tool-change rises only here: with a prepared tool that is not certainly in the spindle already."""
        self._board.next_step()
        if self.prepared is None or not self.spindle.needs(self.prepared.number):
            self._close(Trigger.SKIP, skipped=True)
            return
        self._board.put(Pin.TOOL_CHANGE, True)
        self._go(Trigger.LOAD)
        self.wait.begin(self._config.change_timeout_s)

    # --- answers --------------------------------------------------------------------------------------------------

    def answered(self) -> None:
        """The answer that the state waits for has come."""
        match self.state:
            case State.PREPARING:
                self._prepared_now()
            case State.STARTING:
                self._board.next_step()
                self._board.put(Pin.START_CHANGE, False)
                self._go(Trigger.STARTED)
                assert self._requests.change is not None
                self._opened(self._requests.change)
            case State.CHANGING:
                self._board.next_step()
                self._board.put(Pin.TOOL_CHANGE, False)
                self._close(Trigger.LOADED)
            case State.ABORTING:
                self._acknowledged()
            case _:
                raise LocalError(f"no answer is waited for in {self.state.name}")

    def settle(self) -> None:
        """The person says that the tool in doubt is in the spindle."""
        assert self._in_doubt
        self._board.next_step()
        # While the acknowledgement is still to come, the state waits for that; the change is over all the same.
        self._close(Trigger.SETTLED if self.state is State.DOUBTING else None)

    def set_tool(self, number: int) -> None:
        """M61, or a person who says which tool it is."""
        self._board.next_step()
        self._in_spindle(number)

    def _prepared_now(self) -> None:
        request = self._requests.preparing
        assert request is not None
        self._board.next_step()
        self._board.put(Pin.TOOL_PREPARE, False)
        self._go(Trigger.PREPARED)
        self._requests.preparing = None
        self.prepared = request.place
        place = request.place
        self._board.emit(ToolPrepared(place.number, place.pocket, place.index, request.line))

    def _close(self, trigger: Trigger | None, *, skipped: bool = False) -> None:
        """The M6 is done. The step has begun; the request's own pin is down already."""
        number, change = self.wanted, self._requests.change
        assert number is not None
        assert change is not None
        if not skipped:
            self._in_spindle(number)
        self._prep_pins(Place(0, 0, 0))
        self._in_doubt = False
        if trigger is not None:
            self._go(trigger)
        self.prepared = self._requests.change = None
        self._repeat = number
        self._board.emit(ToolChanged(number, change.line, skipped))

    def _in_spindle(self, number: int) -> None:
        self.interrupted = None
        self.spindle.take(number)
        if self.table is not None and (table := self.table.exchanged(number)) != self.table:
            self.table = table
            self._board.emit(TableChanged(table))

    def _acknowledged(self) -> None:
        reason = int(self._board[Pin.EMC_REASON])
        self._board.next_step()
        self._board.put(Pin.EMC_ABORT, False)
        self._go(Trigger.ACKNOWLEDGED_IN_DOUBT if self._in_doubt else Trigger.ACKNOWLEDGED)
        if self._in_doubt:
            self.wait.begin(0.0)
        self._board.emit(AbortAcknowledged(reason))

    # --- aborts ---------------------------------------------------------------------------------------------------

    def abort(self, code: AbortReason, failure: Failure, *, same_step: bool = False) -> None:
        """In one step: coolant off, reason, emc-abort^, then what was asked falls (§2). Everything open ends."""
        if not same_step:
            self._board.next_step()
        self.coolant_off()
        self._signal(code)
        self._drop()
        self._aborting()
        self._end_open(failure)

    def signal_start(self) -> None:
        """The abort of a start-up or of a new connection: nothing is under way, so no request and no job ends with it,
        and a job that cuts keeps its coolant. What waits its turn waits for the acknowledgement too."""
        self._board.next_step()
        self._signal(AbortReason.NOT_ON)
        self._aborting()

    def abort_by_fault(self, reason: int, *, in_doubt: bool = False, tool_lost: bool = False) -> None:
        """What a fault does to an M6, and to a T that cannot end (§2, §3). The step has begun, perhaps with the fault.

        `in_doubt`: the changer says "changed" and "fault" at once; the M6 stays open until a person says what is true.
        `tool_lost`: its connection broke in the middle of the change.
        """
        failure = self._fault_failure(reason, in_doubt=in_doubt)
        self._drop()
        if not failure.goes_on:  # a program that goes on wants its coolant
            self.coolant_off()
        if in_doubt or tool_lost:
            self.spindle.lose()
        self._signal(AbortReason.TOOLCHANGER_FAULT)
        self._aborting()
        if failure.reason and not in_doubt:
            self._board.emit(OperatorMessage(failure.message, "notice" if failure.goes_on else "error"))
        self._end_open(failure, keep_change=in_doubt)
        if tool_lost:
            self.prepared = self._repeat = None
        self._in_doubt = in_doubt
        if in_doubt:
            text = f"{failure.message}, and at once it says that tool {self.wanted} is in: look into the spindle"
            self._board.emit(OperatorMessage(text, "error"))

    def forget_prepared(self) -> None:
        """E-stop: no tool is prepared any more."""
        self.prepared = self._repeat = None
        self._prep_pins(Place(0, 0, 0))

    def drop_outputs(self) -> None:
        """E-stop by a user: every output of a request is 0, before the abort is signalled."""
        self.coolant_off()
        self._drop()
        self._prep_pins(Place(0, 0, 0))

    def coolant_off(self) -> None:
        self._board.put(Pin.COOLANT_FLOOD, False)
        self._board.put(Pin.COOLANT_MIST, False)

    def fault_text(self, reason: int) -> str:
        """The template of §3, and what is behind our own code."""
        text = self._config.io_error % reason
        return f"{text}: its connection is lost" if reason == CONNECTION_LOST else text

    def _fault_failure(self, reason: int, *, in_doubt: bool) -> Failure:
        cause: Cause = "lost" if reason == CONNECTION_LOST else "fault"
        goes_on = reason > 0 and not in_doubt
        message = self.fault_text(reason)
        if goes_on:
            message = f"{message}: the tool was not changed, the program goes on with tool {self.tool}"
        return Failure(cause, message, reason, goes_on)

    def _signal(self, code: AbortReason) -> None:
        """The reason is set before emc-abort rises; 101 stays until it is acknowledged (sheet §3)."""
        self.spindle.doubt()
        standing = self._board[Pin.EMC_ABORT] and self._board[Pin.EMC_REASON] == AbortReason.TOOLCHANGER_FAULT
        if not standing:
            self._board.put(Pin.EMC_REASON, int(code))
        self._board.put(Pin.EMC_ABORT, True)
        self._board.emit(AbortSignalled(int(code)))

    def _drop(self) -> None:
        for pin in (Pin.TOOL_PREPARE, Pin.TOOL_CHANGE, Pin.START_CHANGE):
            self._board.put(pin, False)

    def _aborting(self) -> None:
        before = self.state
        if Pin.EMC_ABORT not in self._board:
            if before in OPEN_STATES:
                self._go(Trigger.DROP)
            return
        if before is State.CHANGING:
            self.interrupted = self.wanted
        if before is State.ABORTING:
            self._board.go(self._region, Trigger.ABORT)  # the wait for the acknowledgement has begun already
        else:
            self._go(Trigger.ABORT)
            self.wait.begin(self._config.ack_timeout_s)

    def _end_open(self, failure: Failure, *, keep_change: bool = False) -> None:
        for request in self._requests.end(goes_on=failure.goes_on, keep_change=keep_change):
            self._fail(request, failure)
        if self._in_doubt:  # the prepared tool may be in the spindle
            self.prepared = self._repeat = None
        self._in_doubt = False

    def _fail(self, request: Prepare | Change, failure: Failure) -> None:
        end = (failure.cause, failure.message, request.line, failure.reason, failure.goes_on)
        if isinstance(request, Prepare):
            self._board.emit(PrepareFailed(request.place.number, *end))
        else:
            self._board.emit(ChangeFailed(self.wanted, *end))

    def _go(self, trigger: Trigger) -> None:
        self.wait.over()
        self._board.go(self._region, trigger)
        self._board.put(Pin.STATE, STATE_PIN[self.state])

    def _prep_pins(self, place: Place) -> None:
        self._board.put(Pin.TOOL_PREP_NUMBER, place.number)
        self._board.put(Pin.TOOL_PREP_POCKET, place.pocket)
        self._board.put(Pin.TOOL_PREP_INDEX, place.index)
