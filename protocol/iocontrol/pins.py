"""The pins of the I/O control block: names, types, directions, and which of them may be wired as a jumper.

It holds no values (board.py does) and knows no order (handshake.py does).
The one rule: this table is the only place where a pin is named; what is not in it does not exist.
"""

from dataclasses import dataclass
from enum import StrEnum
from typing import Final, Literal

from protocol.errors import LocalError

S32_MIN, S32_MAX = -(2**31), 2**31 - 1
"""What an s32 pin of HAL can hold; a value beyond is refused, not wrapped."""


class PinError(LocalError):
    """No such pin, a pin that is not to be driven from outside, or a value that its type does not have."""


class Pin(StrEnum):
    """The names of the source, without `iocontrol.0.`."""

    COOLANT_FLOOD = "coolant-flood"
    COOLANT_MIST = "coolant-mist"
    EMC_ENABLE_IN = "emc-enable-in"
    USER_ENABLE_OUT = "user-enable-out"
    USER_REQUEST_ENABLE = "user-request-enable"
    TOOL_PREPARE = "tool-prepare"
    TOOL_PREPARED = "tool-prepared"
    TOOL_PREP_NUMBER = "tool-prep-number"
    TOOL_PREP_POCKET = "tool-prep-pocket"
    TOOL_PREP_INDEX = "tool-prep-index"
    TOOL_CHANGE = "tool-change"
    TOOL_CHANGED = "tool-changed"
    TOOL_NUMBER = "tool-number"
    EMC_ABORT = "emc-abort"
    EMC_ABORT_ACK = "emc-abort-ack"
    EMC_REASON = "emc-reason"
    START_CHANGE = "start-change"
    START_CHANGE_ACK = "start-change-ack"
    TOOLCHANGER_FAULT = "toolchanger-fault"
    TOOLCHANGER_REASON = "toolchanger-reason"
    TOOLCHANGER_FAULT_ACK = "toolchanger-fault-ack"
    TOOLCHANGER_FAULTED = "toolchanger-faulted"
    TOOLCHANGER_CLEAR_FAULT = "toolchanger-clear-fault"
    STATE = "state"


@dataclass(frozen=True, slots=True)
class PinSpec:
    """`direction` as the daemon sees it: `out` it drives, `in` the changer or the plant. `since`: protocol version."""

    type: Literal["bit", "s32"]
    direction: Literal["in", "out"]
    since: Literal[1, 2]
    meaning: str


PINS: Final[dict[Pin, PinSpec]] = {
    Pin.COOLANT_FLOOD: PinSpec("bit", "out", 1, "flood coolant is wanted (M8)"),
    Pin.COOLANT_MIST: PinSpec("bit", "out", 1, "mist coolant is wanted (M7)"),
    Pin.EMC_ENABLE_IN: PinSpec("bit", "in", 1, "the external e-stop chain is closed"),
    Pin.USER_ENABLE_OUT: PinSpec("bit", "out", 1, "there is no internal e-stop"),
    Pin.USER_REQUEST_ENABLE: PinSpec("bit", "out", 1, "a pulse at each e-stop reset"),
    Pin.TOOL_PREPARE: PinSpec("bit", "out", 1, "prepare the tool of the prep pins"),
    Pin.TOOL_PREPARED: PinSpec("bit", "in", 1, "the tool is prepared"),
    Pin.TOOL_PREP_NUMBER: PinSpec("s32", "out", 1, "number of the tool to prepare"),
    Pin.TOOL_PREP_POCKET: PinSpec("s32", "out", 1, "its pocket"),
    Pin.TOOL_PREP_INDEX: PinSpec("s32", "out", 1, "its place in the tool table"),
    Pin.TOOL_CHANGE: PinSpec("bit", "out", 1, "put the prepared tool into the spindle"),
    Pin.TOOL_CHANGED: PinSpec("bit", "in", 1, "the tool is in the spindle"),
    Pin.TOOL_NUMBER: PinSpec("s32", "out", 1, "the tool in the spindle; 0 none, -1 not known"),
    Pin.EMC_ABORT: PinSpec("bit", "out", 2, "whatever is under way is aborted"),
    Pin.EMC_ABORT_ACK: PinSpec("bit", "in", 2, "the changer has taken note of the abort"),
    Pin.EMC_REASON: PinSpec("s32", "out", 2, "why it is aborted; valid while emc-abort is TRUE"),
    Pin.START_CHANGE: PinSpec("bit", "out", 2, "a change begins; nothing has moved for it yet"),
    Pin.START_CHANGE_ACK: PinSpec("bit", "in", 2, "the changer is ready for the moves to the change position"),
    Pin.TOOLCHANGER_FAULT: PinSpec("bit", "in", 2, "the changer has a fault"),
    Pin.TOOLCHANGER_REASON: PinSpec("s32", "in", 2, "which; read when the fault line rises"),
    Pin.TOOLCHANGER_FAULT_ACK: PinSpec("bit", "out", 2, "fault and reason have been read"),
    Pin.TOOLCHANGER_FAULTED: PinSpec("bit", "out", 2, "a fault was seen: the next M6 aborts"),
    Pin.TOOLCHANGER_CLEAR_FAULT: PinSpec("bit", "in", 2, "forget the fault, once its line is FALSE"),
    Pin.STATE: PinSpec("s32", "out", 1, "0 idle, 1 preparing, 2 start-change, 3 changing, 4 waiting for emc-abort-ack"),
}

JUMPERS: Final[dict[Pin, Pin]] = {
    Pin.EMC_ENABLE_IN: Pin.USER_ENABLE_OUT,
    Pin.TOOL_PREPARED: Pin.TOOL_PREPARE,
    Pin.TOOL_CHANGED: Pin.TOOL_CHANGE,
    Pin.EMC_ABORT_ACK: Pin.EMC_ABORT,
    Pin.START_CHANGE_ACK: Pin.START_CHANGE,
}
"""Inputs that can be wired to an output and then follow it: LinuxCNC's customary way to do without a handshake."""


def pins_of(version: int) -> tuple[Pin, ...]:
    """The pins that a block of this protocol version has, in the order of the table."""
    return tuple(pin for pin, spec in PINS.items() if spec.since <= version)


def checked_input(name: str, value: object, *, version: int) -> tuple[Pin, bool | int]:
    """A pin and a value that may be put on it from outside. Raises PinError and says which rule is broken."""
    try:
        pin = Pin(name)
    except ValueError:
        raise PinError(f"there is no pin {name[:40]!r}") from None
    spec = PINS[pin]
    if spec.since > version:
        raise PinError(f"{pin} does not exist in protocol version {version}")
    if spec.direction == "out":
        raise PinError(f"{pin} is an output: it is driven here, not from outside")
    if spec.type == "bit":
        if not isinstance(value, bool):
            raise PinError(f"{pin} is a bit: true or false, not {value!r}"[:120])
    elif isinstance(value, bool) or not isinstance(value, int) or not S32_MIN <= value <= S32_MAX:
        raise PinError(f"{pin} is a whole number of 32 bits, not {value!r}"[:120])
    return pin, value
