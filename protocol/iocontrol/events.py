"""What an I/O control block reports: frozen dataclasses, past tense or nouns.

`PinChanged` and `Transition` are the record of what happened; the others are what the rest of the daemon acts on.
The one rule: every T, M6 and M61 ends in exactly one of its ends (`ToolPrepared`/`PrepareFailed`,
`ToolChanged`/`ChangeFailed`, `ToolSet`/`SetToolFailed`), and an end with `goes_on` False has already been signalled
to the changer as an abort.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from protocol.iocontrol.tooltable import ToolTable

Cause = Literal[
    "unknown_tool",  # not in the tool table
    "not_prepared",  # M6 without a T word, or after one that came to nothing
    "no_changer",  # kind "none"
    "estop",
    "fault",  # toolchanger-fault, or the latch of an earlier one
    "aborted",
    "operator",  # a person said that it failed
    "lost",  # the connection of an external changer
    "superseded",  # a later T word came before this one was begun
    "change_pending",  # M61 in the middle of an M6
]

What = Literal[
    "tool-prepared",
    "start-change-ack",
    "position",
    "tool-changed",
    "operator",
    "emc-abort-ack",
    "verdict",
    "connection",
]
"""What is waited for. `position`: the machine, on its way to the change position. `operator`: a person with the tool.
`verdict`: a person who says which tool is in the spindle."""


@dataclass(frozen=True, slots=True)
class PinChanged:
    """A pin has another value since `at` (seconds). Changes of one `step` belong together, in this order."""

    pin: str
    value: bool | int
    at: float
    step: int


@dataclass(frozen=True, slots=True)
class Transition:
    """One of the tables (tables.py) went from a state to another."""

    region: str
    before: str
    after: str
    why: str
    at: float


@dataclass(frozen=True, slots=True)
class Snapshot:
    """The changer has just connected and is to be told all pins."""

    pins: Mapping[str, bool | int]


# --- the ends of requests ---------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class ToolPrepared:
    """T is done: an M6 loads this tool."""

    number: int
    pocket: int
    index: int
    line: int | None


@dataclass(frozen=True, slots=True)
class PrepareFailed:
    """T came to nothing. `reason`: that of the changer's fault. `goes_on`: the program does (seed §5, reason > 0)."""

    number: int
    cause: Cause
    message: str
    line: int | None
    reason: int | None = None
    goes_on: bool = False


@dataclass(frozen=True, slots=True)
class ChangeStarted:
    """The changer is ready for an M6: now the spindle stops and the machine goes to the change position."""

    number: int
    line: int | None


@dataclass(frozen=True, slots=True)
class ToolChanged:
    """M6 is done: `number` is in the spindle. `skipped`: it was there before."""

    number: int
    line: int | None
    skipped: bool = False


@dataclass(frozen=True, slots=True)
class ChangeFailed:
    """M6 did not happen. `reason`: that of the changer's fault. `goes_on`: the program does, with the old tool."""

    number: int | None
    cause: Cause
    message: str
    line: int | None
    reason: int | None = None
    goes_on: bool = False


@dataclass(frozen=True, slots=True)
class ToolSet:
    """M61: this is the tool in the spindle; nothing has moved."""

    number: int


@dataclass(frozen=True, slots=True)
class SetToolFailed:
    """M61 was refused; the tool number is what it was."""

    number: int
    cause: Cause
    message: str


# --- what else happened -----------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class OperatorMessage:
    """For people. `notice`: yellow, the work goes on; `wanted`: something is to be done; `error`: it has stopped."""

    text: str
    level: Literal["notice", "wanted", "error"]


@dataclass(frozen=True, slots=True)
class WaitingFor:
    """What is waited for has changed. `what` None: nothing. `overdue`: the timeout has passed, a person is to look."""

    what: What | None
    tool: int | None = None
    since_at: float | None = None
    deadline_at: float | None = None
    overdue: bool = False


@dataclass(frozen=True, slots=True)
class FaultLatched:
    """The next M6 aborts. `reason` as the changer gave it with the fault."""

    reason: int


@dataclass(frozen=True, slots=True)
class FaultCleared:
    """The latch is open again, and the parameters #5060, #5600 and #5601 are 0."""

    by: Literal["pin", "operator", "estop"]


@dataclass(frozen=True, slots=True)
class AbortSignalled:
    """Whatever was under way is aborted; `reason` is that of the call, even where the pin keeps an earlier one."""

    reason: int


@dataclass(frozen=True, slots=True)
class AbortAcknowledged:
    """The changer knows of the abort: requests and jobs may go again."""

    reason: int


@dataclass(frozen=True, slots=True)
class EStopped:
    """The job and the machine are to stop at once."""

    kind: Literal["user", "external"]


@dataclass(frozen=True, slots=True)
class EStopCleared:
    """The e-stop was reset and the external chain is closed."""


@dataclass(frozen=True, slots=True)
class AnswerIgnored:
    """An answer rose that nothing waits for: late, repeated, or a disturbed line."""

    pin: str
    why: str


@dataclass(frozen=True, slots=True)
class RequestIgnored:
    """Something was asked for that has no effect now; nothing waits for it."""

    what: str
    why: str


@dataclass(frozen=True, slots=True)
class TableChanged:
    """A random changer has exchanged two tools: the file is to be written."""

    table: ToolTable


End = ToolPrepared | PrepareFailed | ToolChanged | ChangeFailed | ToolSet | SetToolFailed

Event = (
    PinChanged
    | Transition
    | Snapshot
    | End
    | ChangeStarted
    | OperatorMessage
    | WaitingFor
    | FaultLatched
    | FaultCleared
    | AbortSignalled
    | AbortAcknowledged
    | EStopped
    | EStopCleared
    | AnswerIgnored
    | RequestIgnored
    | TableChanged
)
