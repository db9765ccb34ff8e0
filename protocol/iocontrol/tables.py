"""The states of an I/O control block as tables: handshake, e-stop, fault latch, connection, waiting.

docs/toolchanger-states.md is made from these tables (`python -m protocol.iocontrol.tables`); a test keeps it true.
No pin is moved here. The one rule: a state changes only along an entry of a table; any other way is a bug and raises.
"""

import sys
from collections.abc import Mapping
from enum import Enum
from typing import Any, Final, Generic, TypeVar

from protocol.errors import LocalError


class State(Enum):
    """The handshake; exactly one request is under way at a time."""

    IDLE = "nothing is asked of the changer"
    PREPARING = "tool-prepare is TRUE"
    STARTING = "start-change is TRUE: nothing moves before start-change-ack"
    MOVING = "an M6 is open: the machine stops the spindle and goes to the change position"
    CHANGING = "tool-change is TRUE: nothing else moves"
    ABORTING = "emc-abort is TRUE: no request and no job before emc-abort-ack"
    DOUBTING = "a person is to say which tool is in the spindle"


class Trigger(Enum):
    """Why the handshake goes on, with the pins of that step (`^` rises, `_` falls)."""

    PREPARE = "T: prep pins, tool-prepare^"
    PREPARED = "tool-prepared^: tool-prepare_"
    START = "M6: start-change^"
    STARTED = "start-change-ack^: start-change_"
    OPEN = "M6 without start-change"
    LOAD = "at the change position: tool-change^"
    SKIP = "the tool is in the spindle already: prep pins 0"
    LOADED = "tool-changed^: tool-change_, tool-number, prep pins 0"

    ABORT = "abort, e-stop, fault: requests_, emc-reason, emc-abort^"
    DROP = "abort without abort pins (version 1): requests_"
    ACKNOWLEDGED = "emc-abort-ack^: emc-abort_"
    ACKNOWLEDGED_IN_DOUBT = "emc-abort-ack^ while the tool is in doubt: emc-abort_"
    SETTLED = "the person has said it: tool-number"


class EStop(Enum):
    """The e-stop."""

    ENABLED = "requests are taken"
    USER = "internal e-stop: user-enable-out is FALSE"
    EXTERNAL = "the external chain was opened; its return does not switch on"
    RESETTING = "reset is asked for; the external chain is still open"


class EStopTrigger(Enum):
    """Why the e-stop changes."""

    PRESSED = "e-stop by a user: user-enable-out_"
    OPENED = "emc-enable-in_"
    RESET = "e-stop reset: user-enable-out^, pulse of user-request-enable"
    CLOSED = "emc-enable-in is TRUE"
    GIVEN_UP = "the chain is still open a second after the reset"


class Latch(Enum):
    """The fault latch."""

    CLEAR = "an M6 may go"
    FAULTED = "toolchanger-faulted is TRUE: the next M6 aborts"


class LatchTrigger(Enum):
    """Why the latch changes."""

    FAULT = "toolchanger-fault^, or the connection is lost"
    CLEARED = "toolchanger-clear-fault or an operator, while the fault line is FALSE"
    ESTOP = "e-stop by a user"


class Connection(Enum):
    """The connection of an external changer."""

    ABSENT = "has not been there yet"
    CONNECTED = "its inputs count"
    LOST = "its inputs do not count"


class ConnectionTrigger(Enum):
    """Why the connection changes."""

    CONNECT = "a snapshot of its inputs came"
    DISCONNECT = "the connection is lost"


class Patience(Enum):
    """How long something is waited for."""

    ON_TIME = "nothing waits beyond its timeout"
    WAITING = "the timeout has passed, people have been told; the handshake stays open"


class PatienceTrigger(Enum):
    """Why patience ends."""

    TIMEOUT = "prepare_timeout, change_timeout, ack_timeout"
    OVER = "the answer came, or the request was dropped"


OPEN_STATES: Final = (State.PREPARING, State.STARTING, State.MOVING, State.CHANGING)

HANDSHAKE: Final[dict[tuple[State, Trigger], State]] = {
    (State.IDLE, Trigger.PREPARE): State.PREPARING,
    (State.PREPARING, Trigger.PREPARED): State.IDLE,
    (State.IDLE, Trigger.START): State.STARTING,
    (State.STARTING, Trigger.STARTED): State.MOVING,
    (State.IDLE, Trigger.OPEN): State.MOVING,
    (State.MOVING, Trigger.LOAD): State.CHANGING,
    (State.MOVING, Trigger.SKIP): State.IDLE,
    (State.CHANGING, Trigger.LOADED): State.IDLE,
    (State.ABORTING, Trigger.ACKNOWLEDGED): State.IDLE,
    (State.ABORTING, Trigger.ACKNOWLEDGED_IN_DOUBT): State.DOUBTING,
    (State.DOUBTING, Trigger.SETTLED): State.IDLE,
    **{(state, Trigger.ABORT): State.ABORTING for state in State},
    **{(state, Trigger.DROP): State.IDLE for state in OPEN_STATES},
}

ESTOP: Final[dict[tuple[EStop, EStopTrigger], EStop]] = {
    (EStop.ENABLED, EStopTrigger.PRESSED): EStop.USER,
    (EStop.EXTERNAL, EStopTrigger.PRESSED): EStop.USER,
    (EStop.RESETTING, EStopTrigger.PRESSED): EStop.USER,
    (EStop.ENABLED, EStopTrigger.OPENED): EStop.EXTERNAL,
    (EStop.USER, EStopTrigger.RESET): EStop.RESETTING,
    (EStop.EXTERNAL, EStopTrigger.RESET): EStop.RESETTING,
    (EStop.RESETTING, EStopTrigger.CLOSED): EStop.ENABLED,
    (EStop.RESETTING, EStopTrigger.GIVEN_UP): EStop.EXTERNAL,
}

LATCH: Final[dict[tuple[Latch, LatchTrigger], Latch]] = {
    (Latch.CLEAR, LatchTrigger.FAULT): Latch.FAULTED,
    (Latch.FAULTED, LatchTrigger.FAULT): Latch.FAULTED,
    (Latch.FAULTED, LatchTrigger.CLEARED): Latch.CLEAR,
    (Latch.FAULTED, LatchTrigger.ESTOP): Latch.CLEAR,
}

CONNECTION: Final[dict[tuple[Connection, ConnectionTrigger], Connection]] = {
    (Connection.ABSENT, ConnectionTrigger.CONNECT): Connection.CONNECTED,
    (Connection.LOST, ConnectionTrigger.CONNECT): Connection.CONNECTED,
    (Connection.CONNECTED, ConnectionTrigger.DISCONNECT): Connection.LOST,
}

PATIENCE: Final[dict[tuple[Patience, PatienceTrigger], Patience]] = {
    (Patience.ON_TIME, PatienceTrigger.TIMEOUT): Patience.WAITING,
    (Patience.WAITING, PatienceTrigger.OVER): Patience.ON_TIME,
}

STATE_PIN: Final[dict[State, int]] = {
    State.IDLE: 0,
    State.PREPARING: 1,
    State.STARTING: 2,
    State.MOVING: 0,
    State.CHANGING: 3,
    State.ABORTING: 4,
    State.DOUBTING: 3,
}
"""The `state` pin. While the machine moves no line to the changer is up; a change in doubt is not over."""

S = TypeVar("S", bound=Enum)
T = TypeVar("T", bound=Enum)


class Region(Generic[S, T]):
    """Where one of the tables stands."""

    def __init__(self, name: str, table: dict[tuple[S, T], S], state: S) -> None:
        self.name = name
        self._table = table
        self.state = state

    def move(self, trigger: T) -> tuple[S, S]:
        """Go on: the state before, and after. Raises LocalError where the table has no such way."""
        before = self.state
        after = self._table.get((before, trigger))
        if after is None:
            raise LocalError(f"{self.name}: no way from {before.name} by {trigger.name}")
        self.state = after
        return before, after


TABLES: Final[tuple[tuple[str, Mapping[Any, Enum], Enum], ...]] = (
    ("handshake", HANDSHAKE, State.IDLE),
    ("e-stop", ESTOP, EStop.USER),
    ("fault", LATCH, Latch.CLEAR),
    ("connection", CONNECTION, Connection.ABSENT),
    ("waiting", PATIENCE, Patience.ON_TIME),
)
"""Every table by the name that its transitions carry (`Transition.region`)."""


def page() -> str:
    """docs/toolchanger-states.md: the tables and their diagrams."""
    parts = [
        "# The states of the tool changer and I/O control",
        "",
        "Made from the tables in `protocol/iocontrol/tables.py` by `python -m protocol.iocontrol.tables`;",
        "a test keeps it true. What they mean for people and changers is in [toolchanger.md](toolchanger.md).",
    ]
    for name, table, start in TABLES:
        parts += ["", f"## {name}", "", str(type(start).__doc__), "", *_section(table, start)]
    return "\n".join((*parts, ""))


def _section(table: Mapping[Any, Enum], start: Enum) -> list[str]:
    handshake = isinstance(start, State)
    head = "| state | meaning | pin `state` |" if handshake else "| state | meaning |"
    lines = [head, "| --- | --- | --- |" if handshake else "| --- | --- |"]
    for state in type(start):
        pin = f" {STATE_PIN[state]} |" if isinstance(state, State) else ""
        lines.append(f"| {state.name} | {state.value} |{pin}")
    lines += ["", "| from | to | why |", "| --- | --- | --- |"]
    lines += [f"| {before.name} | {after.name} | {why.value} |" for (before, why), after in table.items()]
    lines += ["", "```mermaid", "stateDiagram-v2", f"    [*] --> {start.name}"]
    # Mermaid ends a label at a colon or a semicolon; the table above has the text in full.
    lines += sorted({f"    {before.name} --> {after.name}: {why.name}" for (before, why), after in table.items()})
    return [*lines, "```"]


if __name__ == "__main__":
    sys.stdout.write(page())
