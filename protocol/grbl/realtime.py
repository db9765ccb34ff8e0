"""The real-time bytes: single bytes that the controller takes out of the stream wherever they stand (grbl II.2).

They occupy no room in its receive buffer and get no `ok`. Not when they are sent: that is `lane.py` and the engine.
The one rule: no byte of this table may ever stand in a line (II.1, trap): `acts_anywhere` tells.
"""

from dataclasses import dataclass
from typing import Final

from protocol.events import Status

SOFT_RESET: Final = b"\x18"
STATUS: Final = b"?"
CYCLE_START: Final = b"~"
FEED_HOLD: Final = b"!"
SAFETY_DOOR: Final = b"\x84"
JOG_CANCEL: Final = b"\x85"
FULL_STATUS: Final = b"\x87"
SPINDLE_STOP: Final = b"\x9e"
FLOOD: Final = b"\xa0"
MIST: Final = b"\xa1"
TOOL_ACK: Final = b"\xa3"

LINE_BYTES: Final = bytes(range(0x20, 0x7F))
"""What a line may consist of, but for the three characters that act at once."""


@dataclass(frozen=True, slots=True)
class RealtimeByte:
    """`works` are the states in which Grbl heeds it; elsewhere it is ignored. Empty: in every state."""

    name: str
    works: frozenset[Status] = frozenset()
    grblhal: bool = False


def _in(*states: Status) -> frozenset[Status]:
    return frozenset(states)


REALTIME: Final[dict[bytes, RealtimeByte]] = {
    SOFT_RESET: RealtimeByte("soft reset"),
    STATUS: RealtimeByte("status report"),
    CYCLE_START: RealtimeByte("cycle start", _in("hold", "door", "idle", "tool")),
    FEED_HOLD: RealtimeByte("feed hold", _in("idle", "run", "jog", "hold")),
    SAFETY_DOOR: RealtimeByte("safety door", _in("idle", "hold", "run", "jog", "home", "door")),
    JOG_CANCEL: RealtimeByte("jog cancel", _in("jog")),
    b"\x86": RealtimeByte("debug report"),
    b"\x90": RealtimeByte("feed override 100 %"),
    b"\x91": RealtimeByte("feed override +10 %"),
    b"\x92": RealtimeByte("feed override -10 %"),
    b"\x93": RealtimeByte("feed override +1 %"),
    b"\x94": RealtimeByte("feed override -1 %"),
    b"\x95": RealtimeByte("rapid override 100 %"),
    b"\x96": RealtimeByte("rapid override 50 %"),
    b"\x97": RealtimeByte("rapid override 25 %"),
    b"\x99": RealtimeByte("spindle override 100 %"),
    b"\x9a": RealtimeByte("spindle override +10 %"),
    b"\x9b": RealtimeByte("spindle override -10 %"),
    b"\x9c": RealtimeByte("spindle override +1 %"),
    b"\x9d": RealtimeByte("spindle override -1 %"),
    SPINDLE_STOP: RealtimeByte("spindle stop toggle", _in("hold")),
    FLOOD: RealtimeByte("flood toggle", _in("idle", "run", "hold")),
    MIST: RealtimeByte("mist toggle", _in("idle", "run", "hold")),
    b"\x03": RealtimeByte("exit", grblhal=True),
    b"\x19": RealtimeByte("stop", grblhal=True),
    b"\x80": RealtimeByte("status report", grblhal=True),
    b"\x81": RealtimeByte("cycle start", grblhal=True),
    b"\x82": RealtimeByte("feed hold", grblhal=True),
    b"\x83": RealtimeByte("parser state report", grblhal=True),
    FULL_STATUS: RealtimeByte("full status report", grblhal=True),
    b"\x88": RealtimeByte("optional stop toggle", grblhal=True),
    b"\x89": RealtimeByte("single block toggle", grblhal=True),
    b"\x8a": RealtimeByte("fan toggle", grblhal=True),
    b"\x8b": RealtimeByte("MPG toggle", grblhal=True),
    b"\x8c": RealtimeByte("auto report toggle", grblhal=True),
    b"\xa2": RealtimeByte("PID report", grblhal=True),
    TOOL_ACK: RealtimeByte("tool change acknowledged", _in("tool"), grblhal=True),
    b"\xa4": RealtimeByte("probe connected toggle", grblhal=True),
}

OVERRIDES: Final[dict[tuple[str, str], bytes]] = {
    ("feed", "reset"): b"\x90",
    ("feed", "+10"): b"\x91",
    ("feed", "-10"): b"\x92",
    ("feed", "+1"): b"\x93",
    ("feed", "-1"): b"\x94",
    ("rapid", "reset"): b"\x95",
    ("rapid", "50"): b"\x96",
    ("rapid", "25"): b"\x97",
    ("spindle", "reset"): b"\x99",
    ("spindle", "+10"): b"\x9a",
    ("spindle", "-10"): b"\x9b",
    ("spindle", "+1"): b"\x9c",
    ("spindle", "-1"): b"\x9d",
}
COOLANTS: Final = {"flood": FLOOD, "mist": MIST}
OPTIONS: Final = {
    "optional_stop": b"\x88",
    "single_block": b"\x89",
    "fan": b"\x8a",
    "mpg": b"\x8b",
    "auto_report": b"\x8c",
    "probe_connected": b"\xa4",
}
"""What `ToggleOption` can ask of a grblHAL."""


def acts_anywhere(byte: int) -> bool:
    """Whether the controller takes this byte out of a line, or Grbl would break the line at it."""
    return byte not in LINE_BYTES or byte in b"?!~"
