"""The host's side of NC frames for one connection epoch: one frame at a time, none twice (ncframe §4). No I/O.

`phases.py` is the table of what is exchanged; the layers below (`settling`, `flights`, `exchange`) move between the
phases; here stand the five verbs and the commands. The one rule: nothing that people press waits behind a frame that
has not gone out yet.
"""

from typing import Final

from protocol.commands import (
    ClearAlarm,
    Command,
    CycleStart,
    EmergencyStop,
    FeedHold,
    Locate,
    Position,
    RealtimeCommand,
    RunBlock,
    SendBatch,
    SetPosition,
    Stop,
)
from protocol.engine import Frame as Recorded
from protocol.engine import OpenWork
from protocol.errors import LocalError
from protocol.events import CommandDone, CommandFailed, Event, MessageSeen
from protocol.ncframe.answers import console, read
from protocol.ncframe.codec import CAN, COUNT_MODULUS, Frame, FrameError
from protocol.ncframe.dialect import Dialect
from protocol.ncframe.phases import Inquiry, Phase
from protocol.ncframe.settling import Settling

EMERGENCY_TRIES: Final = 30
ABORT_INTERVAL_S: Final = 0.3
"""Between two CANs. Longer than the machine's gap: what is left of half a frame in it must not swallow each of them."""


class NcFrameEngine(Settling):
    """See protocol.engine.Engine. `baud` 0: bytes take no time. `now`: the shell's clock at the connection.

    With a counter `first_id` is of no use: the ID of a batch is the number of its first frame since the machine's
    start, so IDs rise by the number of frames.
    """

    def __init__(
        self, dialect: Dialect, *, first_id: int, baud: int, now: float, open_work: OpenWork | None = None
    ) -> None:
        super().__init__(dialect, first_id, baud, open_work)
        self._verdicts = {
            Phase.GREET: self._on_greeted,
            Phase.POLL: self._on_polled,
            Phase.PROVE: self._on_proven,
            Phase.CONFIRM: self._on_count,
            Phase.ASK: self._on_count,
            Phase.LISTEN: self._on_listened,
        }
        self._enquire(Phase.GREET, now)

    # --- the five verbs -----------------------------------------------------------------------------------------

    def receive_data(self, data: bytes, now: float) -> None:
        """Any bytes, in any pieces; never raises."""
        if self._phase is Phase.CLOSED or not data:
            return
        self._wire.heard(data, now)
        at = 0
        while at < len(data) and self._inquiry is None:
            at += 1
            self._hear(data[at - 1], now)
        if at < len(data) and self._inquiry is not None:
            self._collect(data[at:], now)

    def data_to_send(self, now: float) -> bytes:
        """What is to go out now."""
        return self._wire.data_to_send(now)

    def next_event(self) -> Event | None:
        """What happened, oldest first."""
        return self._events.popleft() if self._events else None

    def next_timer(self) -> float | None:
        """The earliest deadline."""
        return self._deadline

    def handle_timer(self, now: float) -> None:
        """The deadline has come; calling early does nothing."""
        if self._deadline is None or now < self._deadline:
            return
        self._deadline = None
        if self._phase is Phase.ABORT:
            self._on_abort_timer(now)
        elif self._inquiry is not None:
            self._on_inquiry_timer(now)
        elif self._phase is Phase.SENT:
            self._on_silence(now)
        else:
            self._on_rest(now)

    # --- the domain's verbs -------------------------------------------------------------------------------------

    @property
    def next_id(self) -> int:
        """The ID that the next SendBatch must carry: with a counter the number of its first frame, from 1."""
        if self._counted is None:
            return self._next
        flight = self._flight
        ahead = 0 if flight is None else len(flight.frames) - flight.done
        return (self._counted + ahead) % COUNT_MODULUS + 1

    @property
    def news(self) -> bool:
        """Whether anybody has to be told: every burst of a machine says something."""
        return True

    def free(self) -> int:
        """1 while a command can be taken, else 0. In alarm only ClearAlarm and Locate make sense."""
        return int(self._phase is Phase.IDLE)

    def recent_frames(self) -> tuple[Recorded, ...]:
        """What the recorder holds, oldest first."""
        return self._wire.recent_frames()

    def submit(self, command: Command, now: float) -> None:
        """Take a command. Raises LocalError when not free, when a batch's ID is not `next_id` or its blocks are no
        frames."""
        if not self.free():
            raise LocalError(f"the engine takes no command now: it {self._phase.value}")
        match command:
            case SendBatch():
                self._submit_batch(command, now)
            case RunBlock():
                self._submit_by_hand(command, now)
            case SetPosition(token, position):
                self._set_position(token, position, now)
            case Locate(token):
                self._locate_token = token
                self._poll(now)
            case ClearAlarm(token):
                self._clear_token = token
                self._poll(now)
            case _:
                self._emit(CommandFailed(command.token, None, "a machine behind NC frames does not know this command"))

    def _submit_batch(self, batch: SendBatch, now: float) -> None:
        if self._alarm is not None:
            raise LocalError("a batch was submitted while the machine is in alarm")
        if batch.id != self.next_id:
            raise LocalError(f"batch {batch.id} is out of turn: the next ID is {self.next_id}")
        try:
            frames = tuple(Frame.from_text(block) for block in batch.blocks)
        except FrameError as error:
            raise LocalError(f"batch {batch.id}: {error}") from error
        if not frames:
            raise LocalError(f"batch {batch.id} has no frames")
        self._take_off(batch, frames, now)

    def _submit_by_hand(self, command: RunBlock, now: float) -> None:
        try:
            frames = tuple(Frame.from_text(block) for block in command.blocks)
        except FrameError as error:
            self._emit(CommandFailed(command.token, None, str(error)))
            return
        if self._alarm is not None:
            self._emit(CommandFailed(command.token, None, "the machine is in alarm; clear it first"))
        elif not frames:
            self._emit(CommandDone(command.token))
        else:
            batch = SendBatch(self.next_id, command.blocks, command.expected_s)
            self._take_off(batch, frames, now, token=command.token)

    def _set_position(self, token: int, position: Position, now: float) -> None:
        """The machine never says where it stands: somebody has looked."""
        if self._alarm is not None:
            self._emit(CommandFailed(token, None, "the machine is in alarm; clear it first"))
            return
        self._standing = {**self._standing, **position}
        self._tell(self._resting_status, now)
        self._arm_rest(now)
        self._emit(CommandDone(token))

    # --- the realtime lane --------------------------------------------------------------------------------------

    def realtime(self, command: RealtimeCommand, now: float) -> None:
        """The emergency stop is CAN, at once. Hold and stop act behind the frame that the machine executes."""
        if self._phase is Phase.CLOSED:
            self._emit(CommandFailed(command.token, None, "the link is down: use the machine's own emergency button"))
            return
        match command:
            case EmergencyStop(token):
                self._press_emergency(token, now)
            case FeedHold(token):
                self._hold = True
                self._hold_tokens.append(token)
                self._stand(now)
            case Stop(token):
                self._hold = False
                self._stop_tokens.append(token)
                self._stand(now)
            case CycleStart(token):
                self._cycle_start(token, now)
            case _:
                why = "a machine behind NC frames knows no real-time command but emergency stop, stop, hold and start"
                self._emit(CommandFailed(command.token, None, why))

    def _stand(self, now: float) -> None:
        """Hold or stop: at once where nothing runs, else behind the frame."""
        if self._phase is Phase.HELD and self._stop_tokens:
            self._send_next(now)  # which ends the batch
        elif self._flight is None or self._phase is Phase.HELD:
            self._answer_stops()
            if self._phase is Phase.IDLE:
                self._tell(self._resting_status, now)
                self._arm_rest(now)

    def _cycle_start(self, token: int, now: float) -> None:
        """Go on. It overrides an XOFF too: its XON may have been lost."""
        self._hold = False
        if self._xoff:
            self._flow(False, now)
        elif self._phase is Phase.HELD:
            self._send_next(now)
        elif self._phase is Phase.IDLE:
            self._tell(self._resting_status, now)
        self._emit(CommandDone(token))

    def _flow(self, held: bool, now: float) -> None:
        """XOFF: the machine stands within its frame, or takes no further one. Nobody knows how long."""
        if held == self._xoff:
            return
        self._xoff = held
        if self._alarm is not None or self._phase is Phase.ABORT:
            return
        if held:
            self._tell("hold", now)
        if self._phase is Phase.SENT:
            flight = self._flight
            assert flight is not None
            if not held:
                self._tell("run", now)
            self._deadline = None if held else now + flight.run_s + self._dialect.ack_timeout_s
        elif not held and self._phase is Phase.HELD:
            self._send_next(now)
        elif not held and self._flight is None:
            self._tell(self._resting_status, now)

    def _press_emergency(self, token: int, now: float) -> None:
        self._abort_tokens.append(token)
        if self._phase is Phase.ABORT:
            return
        self._break_off("estop", "the emergency stop was pressed")
        self._phase = Phase.ABORT
        self._inquiry = Inquiry(now, now, None)
        self._abort(now)

    def _abort(self, now: float) -> None:
        assert self._inquiry is not None
        self._inquiry.tries += 1
        self._wire.send_alone(bytes([CAN]))
        self._emit(MessageSeen(">", "CAN"))
        self._deadline = now + ABORT_INTERVAL_S

    def _on_abort_timer(self, now: float) -> None:
        """CAN is heard when what came can be read, for a count may hold its byte."""
        inquiry = self._inquiry
        assert inquiry is not None
        burst = bytes(inquiry.burst)
        inquiry.burst.clear()
        if burst:
            self._emit(MessageSeen("<", console(burst, counter=self._dialect.counter)))
        reading = read(burst, counter=self._dialect.counter)
        if reading is not None and reading.cancelled:
            self._abort_heard(now)
        elif inquiry.tries >= EMERGENCY_TRIES:
            self._close("the machine does not answer the emergency stop")
        else:
            self._abort(now)


__all__ = ["NcFrameEngine"]
