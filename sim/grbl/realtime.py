"""Bytes that act at once, wherever they stand, in comments too (grbl II.1, II.2).

They never reach the ring and have no `ok`. Bytes above 0x7E that mean nothing are swallowed. The one rule: this says
which byte is which command, not what it does.
"""

import re
from enum import Enum
from typing import Final


class Realtime(Enum):
    """What a byte asks for."""

    RESET = "reset"
    STATUS = "status"
    FULL_STATUS = "full status"
    CYCLE_START = "cycle start"
    FEED_HOLD = "feed hold"
    SAFETY_DOOR = "safety door"
    JOG_CANCEL = "jog cancel"
    FEED_100 = "feed 100"
    FEED_PLUS_10 = "feed +10"
    FEED_MINUS_10 = "feed -10"
    FEED_PLUS_1 = "feed +1"
    FEED_MINUS_1 = "feed -1"
    RAPID_100 = "rapid 100"
    RAPID_50 = "rapid 50"
    RAPID_25 = "rapid 25"
    SPINDLE_100 = "spindle 100"
    SPINDLE_PLUS_10 = "spindle +10"
    SPINDLE_MINUS_10 = "spindle -10"
    SPINDLE_PLUS_1 = "spindle +1"
    SPINDLE_MINUS_1 = "spindle -1"
    SPINDLE_STOP = "spindle stop"
    FLOOD = "flood"
    MIST = "mist"
    PARSER_STATE = "parser state"
    MPG = "mpg"
    AUTO_REPORT = "auto report"
    TOOL_ACK = "tool change acknowledged"
    OPTIONAL_STOP = "optional stop"
    SINGLE_BLOCK = "single block"
    PROBE_CONNECTED = "probe connected"


BYTES: Final[dict[int, Realtime]] = {
    0x18: Realtime.RESET,
    ord("?"): Realtime.STATUS,
    ord("~"): Realtime.CYCLE_START,
    ord("!"): Realtime.FEED_HOLD,
    0x84: Realtime.SAFETY_DOOR,
    0x85: Realtime.JOG_CANCEL,
    0x90: Realtime.FEED_100,
    0x91: Realtime.FEED_PLUS_10,
    0x92: Realtime.FEED_MINUS_10,
    0x93: Realtime.FEED_PLUS_1,
    0x94: Realtime.FEED_MINUS_1,
    0x95: Realtime.RAPID_100,
    0x96: Realtime.RAPID_50,
    0x97: Realtime.RAPID_25,
    0x99: Realtime.SPINDLE_100,
    0x9A: Realtime.SPINDLE_PLUS_10,
    0x9B: Realtime.SPINDLE_MINUS_10,
    0x9C: Realtime.SPINDLE_PLUS_1,
    0x9D: Realtime.SPINDLE_MINUS_1,
    0x9E: Realtime.SPINDLE_STOP,
    0xA0: Realtime.FLOOD,
    0xA1: Realtime.MIST,
}

HAL_BYTES: Final[dict[int, Realtime]] = BYTES | {
    0x19: Realtime.RESET,  # "stop": like a reset, keeps more; what more is not documented
    0x80: Realtime.STATUS,
    0x81: Realtime.CYCLE_START,
    0x82: Realtime.FEED_HOLD,
    0x83: Realtime.PARSER_STATE,
    0x87: Realtime.FULL_STATUS,
    0x88: Realtime.OPTIONAL_STOP,
    0x89: Realtime.SINGLE_BLOCK,
    0x8B: Realtime.MPG,
    0x8C: Realtime.AUTO_REPORT,
    0xA3: Realtime.TOOL_ACK,
    0xA4: Realtime.PROBE_CONNECTED,
}

_SWALLOWED: Final = bytes(range(0x80, 0x100))
_PIECES: Final = {
    False: re.compile(rb"[?~!\x18\x80-\xff]|[^?~!\x18\x80-\xff]+"),
    True: re.compile(rb"[?~!\x18\x19\x80-\xff]|[^?~!\x18\x19\x80-\xff]+"),
}


def pieces(data: bytes, *, hal: bool) -> list[bytes]:
    """Cut into runs of ordinary bytes and single bytes that never reach the ring."""
    return _PIECES[hal].findall(data)


def meaning(piece: bytes, *, hal: bool) -> Realtime | None:
    """The command of a single byte; None for an ordinary one and for one that is swallowed."""
    return (HAL_BYTES if hal else BYTES).get(piece[0]) if len(piece) == 1 else None


def swallowed(piece: bytes) -> bool:
    """A byte above 0x7F never reaches the ring, whether it means something or not."""
    return piece[0] in _SWALLOWED
