"""Refusals of a line: `error:N` (grbl II.8), and what the numbers mean, for grblHAL's `$EE` and `$EA` (II.9)."""

from typing import Final


class Refused(Exception):  # noqa: N818  # it is the controller's answer, no fault of ours
    """The line is answered by `error:code`."""

    def __init__(self, code: int) -> None:
        super().__init__(f"error:{code}")
        self.code = code


ERRORS: Final[dict[int, str]] = {
    1: "a letter is expected",
    2: "the number is missing or bad",
    3: "unknown $ command",
    4: "negative value",
    5: "homing is off",
    6: "step pulse under 3 us",
    7: "settings could not be read, defaults put back",
    8: "only when idle",
    9: "locked by alarm or jog",
    10: "soft limits need homing",
    11: "line too long",
    12: "step rate too high",
    13: "safety door is open",
    14: "stored line too long",
    15: "jog beyond the travel",
    16: "jog syntax",
    17: "laser mode needs PWM",
    18: "reset is asserted",
    19: "value must be more than 0",
    20: "unsupported command",
    21: "two commands of one modal group",
    22: "feed rate is missing",
    23: "whole number needed",
    24: "two commands want the axis words",
    25: "word twice",
    26: "axis words are missing",
    27: "line number out of range",
    28: "a value word is missing",
    29: "no such work coordinate system",
    30: "G53 needs G0 or G1",
    31: "axis words with G80",
    32: "arc without an axis of its plane",
    33: "bad target",
    34: "arc radius impossible",
    35: "arc without offsets in its plane",
    36: "words that nothing uses",
    37: "G43.1 on another axis",
    38: "tool number too big",
    39: "value out of range",
    40: "tool change is pending",
    41: "spindle is not running",
    42: "wrong plane",
    45: "limit switch is engaged",
    46: "homing is required",
    47: "tool error",
    54: "retract position below the bottom",
    57: "stray %",
}

ALARMS: Final[dict[int, str]] = {
    1: "hard limit, position lost",
    2: "soft limit",
    3: "reset while in motion, position lost",
    4: "probe was in the wrong state at the start",
    5: "probe did not trigger",
    6: "reset while homing",
    7: "door opened while homing",
    8: "switch still closed after pull-off",
    9: "switch not found",
    10: "emergency stop",
    11: "homing is required",
    12: "limit switch is engaged",
    13: "probe protection",
}
