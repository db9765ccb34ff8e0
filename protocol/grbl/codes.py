"""What `error:N` and `ALARM:N` mean and what to do about them: data (grbl II.8, II.9 and grblHAL's extras).

Ours are the words for people; a grblHAL can tell its own (`$EE`, `$EA`), which are shown beside them.
The one rule: every number of the sheet stands here once.
"""

from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True, slots=True)
class Code:
    """`meaning`: what is wrong; `remedy`: what to do. `position_lost` and `needs_reset` are for alarms."""

    meaning: str
    remedy: str
    position_lost: bool = False
    needs_reset: bool = False


_EDIT: Final = "correct the line in the program"
_LATER: Final = "wait until the machine is idle and try again"
_UNLOCK: Final = "home the machine, or unlock it ($X)"
_SETTING: Final = "see the range of the setting"
_REBUILD: Final = "the controller's firmware is built without it"
_CARD: Final = "check the SD card"

ERRORS: Final[dict[int, Code]] = {
    1: Code("a word does not begin with a letter", _EDIT),
    2: Code("the number of a word is missing or bad", _EDIT),
    3: Code("unknown $ command", "see $ for what this controller knows"),
    4: Code("the value may not be negative", "give a value of 0 or more"),
    5: Code("homing is off", "switch homing on ($22)"),
    6: Code("the step pulse is shorter than 3 us", "set $0 to 3 or more"),
    7: Code("the settings could not be read; the defaults were put back", "restore the settings from a backup"),
    8: Code("only when the machine is idle", _LATER),
    9: Code("G-code is locked out by an alarm or a jog", _UNLOCK),
    10: Code("soft limits need homing", "switch homing on ($22) before soft limits ($20)"),
    11: Code("the line is too long", "split the line"),
    12: Code("the step rate would be too high", "lower the maximum rate ($110-$112) or the steps per mm"),
    13: Code("the safety door is open", "close the door"),
    14: Code("the start-up line or the info text is too long", "shorten it"),
    15: Code("the jog goes beyond the travel", "jog less far"),
    16: Code("the jog is not well formed", "a jog takes axis words, F, and G20, G21, G53, G90, G91"),
    17: Code("laser mode needs a PWM spindle", _REBUILD),
    18: Code("the reset input is asserted", "release the reset button"),
    19: Code("the value must be greater than 0", _SETTING),
    20: Code("unsupported or unknown command", "check the program against the controller's profile"),
    21: Code("two commands of one modal group in one block", _EDIT),
    22: Code("no feed rate was given", "put an F word in or before the block"),
    23: Code("a whole number is needed", _EDIT),
    24: Code("two commands of the block want the axis words", _EDIT),
    25: Code("a word stands twice in the block", _EDIT),
    26: Code("axis words are missing", _EDIT),
    27: Code("the line number is out of range", "N goes up to 9999999"),
    28: Code("a value word (P, L, ...) is missing", _EDIT),
    29: Code("there is no such work coordinate system", "G54 to G59 exist in Grbl"),
    30: Code("G53 needs G0 or G1", _EDIT),
    31: Code("axis words where no command uses them (G80)", _EDIT),
    32: Code("an arc without an axis of its plane", _EDIT),
    33: Code("the target cannot be reached: an impossible arc, or a probe to where it stands", _EDIT),
    34: Code("no arc of this radius exists", _EDIT),
    35: Code("an arc without I, J, K of its plane", _EDIT),
    36: Code("words that no command uses", _EDIT),
    37: Code("G43.1 on another axis than the tool's", _EDIT),
    38: Code("the tool number is too big", _EDIT),
    39: Code("a value is out of range", _EDIT),
    40: Code("a tool change is pending", "change the tool and confirm it"),
    41: Code("the spindle is not running", "start the spindle first"),
    42: Code("not in this plane", "select the plane first (G17-G19)"),
    43: Code("the feed rate is too high", "lower F"),
    44: Code("the spindle speed is out of range", "see $30 and $31"),
    45: Code("a limit switch is engaged", "clear the switch"),
    46: Code("homing is required", "home the machine"),
    47: Code("tool error", "check the tool table"),
    48: Code("words that exclude each other", _EDIT),
    49: Code("the self-test failed", "see the controller's messages"),
    50: Code("the emergency stop is active", "release it, then reset"),
    51: Code("motor fault", "check the drives, then reset"),
    52: Code("the value of the setting is out of range", _SETTING),
    53: Code("the setting is disabled", _REBUILD),
    54: Code("the retract position is wrong", _EDIT),
    55: Code("the homing configuration is wrong", "check the homing settings"),
    56: Code("the coordinate system is locked", "unlock it in the settings"),
    57: Code("% where none may stand", _EDIT),
    58: Code("no such auxiliary port", _EDIT),
    60: Code("the SD card could not be mounted", _CARD),
    61: Code("the file could not be opened for reading", _CARD),
    62: Code("the folder could not be read", _CARD),
    63: Code("there is no such folder", _CARD),
    64: Code("the file is empty", _CARD),
    65: Code("no file system is mounted", _CARD),
    66: Code("the file system is read-only", _CARD),
    70: Code("Bluetooth could not be started", "check the Bluetooth settings"),
    71: Code("unknown operation in an expression", _EDIT),
    72: Code("division by zero in an expression", _EDIT),
    73: Code("argument out of range in an expression", _EDIT),
    74: Code("the argument of an expression is wrong", _EDIT),
    75: Code("syntax error in an expression", _EDIT),
    76: Code("the result of an expression is no number", _EDIT),
    77: Code("authentication is required", "log in at the controller"),
    78: Code("access denied", "log in at the controller with more rights"),
    79: Code("not while a critical event is active", "clear the alarm first"),
    80: Code("flow control outside a file", "O-words work only in files of the controller"),
    81: Code("flow control: wrong syntax", _EDIT),
    82: Code("flow control: nested too deep", _EDIT),
    83: Code("flow control: ran out of memory", _EDIT),
    84: Code("the file could not be found or opened", _CARD),
    85: Code("a file may not be called here", _EDIT),
    86: Code("flow control: wrong nesting", _EDIT),
    87: Code("a tool change is refused here", "see the controller's tool change settings"),
    88: Code("the tool in the spindle does not allow it", "check the tool"),
    89: Code("the tool could not be changed", "check the tool changer"),
    90: Code("cutter compensation: wrong command", _EDIT),
    91: Code("cutter compensation: impossible contour", _EDIT),
    92: Code("cutter compensation: the tool has no radius", "give the tool a radius"),
    253: Code("refused by an addition to the firmware", "see the controller's messages"),
}

_HOME: Final = "reset, look for the cause, home again"

HOMING_FAILED: Final = frozenset((6, 7, 8, 9))
"""Alarms behind which the controller resets itself half a second later: `ok` of `$H`, then the banner."""

ALARMS: Final[dict[int, Code]] = {
    1: Code("hard limit: a switch was hit in motion", _HOME, position_lost=True, needs_reset=True),
    2: Code("soft limit: the move would leave the travel", "reset and unlock; the position is good", needs_reset=True),
    3: Code("reset while moving: steps may be lost", "home again", position_lost=True),
    4: Code("probe: it was in the wrong state before the move", "check the probe and its wiring"),
    5: Code("probe: not reached within the programmed travel", "bring the probe closer"),
    6: Code("homing failed: reset while homing", "home again", position_lost=True),
    7: Code("homing failed: the door was opened", "close the door, home again", position_lost=True),
    8: Code("homing failed: the switch is still closed after the pull-off", "raise $27, check the switch", True),
    9: Code("homing failed: the switch was not found", "check the switch, the direction ($23) and the travel", True),
    10: Code("homing failed: the second switch of a dual axis was not found", "check the second switch", True),
    11: Code("homing is required", "home the machine"),
    12: Code("a limit switch is engaged", "clear the switch"),
    13: Code("probe protection was triggered", "clear the probe, then reset"),
    14: Code("the spindle did not reach its speed in time", "check the spindle"),
    15: Code("homing failed: the second auto-squaring switch was not found", "check the second switch", True),
    16: Code("the self-test at power-up failed", "see the controller's messages"),
    17: Code("motor fault", "check the drives, then reset and home", position_lost=True, needs_reset=True),
    18: Code("the homing configuration is wrong", "check the homing settings"),
    19: Code("Modbus: no answer", "check the spindle drive and its wiring"),
    20: Code("the I/O expander does not answer", "check the wiring"),
    21: Code("the non-volatile memory failed", "restore the settings from a backup"),
    22: Code("the receive buffer overflowed", "reset; the stream was broken"),
}
GRBLHAL_EMERGENCY: Final = Code(
    "emergency stop", "release the button, reset, home again", position_lost=True, needs_reset=True
)
"""ALARM:10 of grblHAL; Grbl 1.1 numbers the second switch of a dual axis so."""


def error(code: int | None, text: str = "") -> str:
    """What to show for `error:N`."""
    known = ERRORS.get(code or 0)
    if known is None:
        return text or f"error {code}, which is not in our tables"
    return f"{known.meaning}; {known.remedy}"


def alarm(code: int | None, *, grblhal: bool = False) -> Code:
    """What `ALARM:N` means; an unknown one is read as loss of the position."""
    if grblhal and code == 10:
        return GRBLHAL_EMERGENCY
    if code is None:
        return Code("alarm; the controller gives no number", "look at the machine, then home or unlock")
    return ALARMS.get(code) or Code(
        f"alarm {code}, which is not in our tables", "look at the machine, reset, home again", True, False
    )
