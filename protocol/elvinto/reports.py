"""What the machine's messages mean: STATE to StateReported, alarm numbers to words, the SD card's listing.

Pure functions and one small collector; nothing here sends.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from protocol.elvinto.codec import Message
from protocol.events import Alarm, FilesListed, StateReported, Status

AXES = {"MX": "x", "MY": "y", "MZ": "z", "MA": "a", "MB": "b", "MC": "c"}

# elvinto §4 STATE.TYPE
STATUSES: Mapping[str, Status] = {"idle": "idle", "run": "run", "cnscalarm": "alarm", "axisalarm": "alarm"}

# elvinto §4 ALARMNUM
ALARM_EMERGENCY = 100
ALARMS = {
    1: "start limit switch hit",
    2: "end limit switch hit",
    3: "start limit switch faulty (intermediate level)",
    4: "end limit switch faulty (intermediate level)",
    5: "soft limit at the start of the axis",
    6: "soft limit at the end of the axis",
    ALARM_EMERGENCY: "Emergency pressed",
}

MAX_FILES = 4096
"""Entries of an SD card's root kept: a card has at most 512 by FAT16; a babbling machine must not fill memory."""

LOCKED = StateReported(
    status="alarm",
    position={},
    alarm=Alarm(None, None, "the machine answers but executes nothing: an alarm that was not cleared; clear it"),
)
"""Concluded, not reported: READY is answered, W95 is not executed."""


def number(text: str | None) -> float | None:
    """A finite decimal number, or None for anything else."""
    try:
        value = float(text or "")
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def integer(text: str | None) -> int | None:
    """A non-negative decimal integer of at most 10 digits, or None."""
    return int(text) if text and text.isascii() and text.isdigit() and len(text) <= 10 else None


def read_state(message: Message) -> StateReported | None:
    """STATE as an event; None when its TYPE is not one of the standard's."""
    params = message.params
    status = STATUSES.get(params.get("TYPE", "").lower())
    if status is None:
        return None
    position = {axis: value for key, axis in AXES.items() if (value := number(params.get(key))) is not None}
    absolute = params.get("ISABS", "").upper()
    return StateReported(
        status=status,
        position=position,
        feed_mm_min=number(params.get("FEED")),
        spindle_rpm=number(params.get("SPEED")),
        absolute={"Y": True, "N": False}.get(absolute),
        alarm=_alarm(params) if status == "alarm" else None,
    )


def _alarm(params: Mapping[str, str]) -> Alarm:
    code = integer(params.get("ALARMNUM"))
    axis_number = integer(params.get("AXISNUM"))
    axis = _axis_name(axis_number) if params.get("TYPE", "").lower() == "axisalarm" else None
    known = ALARMS.get(code or 0, f"alarm {code}" if code is not None else "alarm without a number")
    message = f"{known}, axis {axis.upper()}" if axis else known
    return Alarm(code, axis, message, emergency=code == ALARM_EMERGENCY)


def _axis_name(axis_number: int | None) -> str | None:
    """AXISNUM counts from 1 in the order of STATE's coordinates [D]; 0 or absent names none."""
    names = tuple(AXES.values())
    return names[axis_number - 1] if axis_number and axis_number <= len(names) else None


@dataclass(slots=True)
class FileListing:
    """Collects SDD_*, DIR_BEGIN, FILE, DIR_END; `damaged` when a message was lost in between: ask again."""

    token: int
    card: str | None = None
    names: list[str] = field(default_factory=list)
    begun: bool = False
    damaged: bool = False

    def take(self, message: Message) -> FilesListed | None:
        """The finished listing, or None while it goes on."""
        match message.name:
            case "SDD_NO":
                return FilesListed(self.token, (), readable=False, problem="there is no SD card in the reader")
            case "SDD_OK":
                return self._card(message.params)
            case "DIR_BEGIN":
                self.begun, self.damaged, self.names = True, False, []
            case "FILE" if len(self.names) < MAX_FILES:
                self.names.append(message.params.get("NAME", ""))
            case "DIR_END" | "END_BEGIN" if self.begun and not self.damaged:
                return FilesListed(self.token, tuple(self.names), readable=True, card=self.card)
        return None

    def _card(self, params: Mapping[str, str]) -> FilesListed | None:
        self.card = params.get("TYPE")
        if params.get("FS", "").upper() == "NO":
            problem = "the card has no FAT file system"
        elif params.get("ROOT", "").upper() == "NO":
            problem = "the root folder of the card cannot be read"
        else:
            return None
        return FilesListed(self.token, (), readable=False, card=self.card, problem=problem)
