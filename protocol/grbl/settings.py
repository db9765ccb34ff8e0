"""Settings `$n` as data: name, unit, range, meaning (grbl II.10), and those of grblHAL that every build has.

Not their values: those are in the controller, and a grblHAL describes its own (`$ES`), which goes before this table.
The one rule: `valid` refuses only what the controller would refuse or could not mean.
"""

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final, Literal, TypeAlias

from protocol.setting import SettingDescription

Kind: TypeAlias = Literal["bool", "mask", "integer", "number", "text"]


@dataclass(frozen=True, slots=True)
class Setting:
    """`minimum`, `maximum` in `unit`, both allowed; None: no limit. `grblhal`: Grbl 1.1 has none of this number.
    `bits` of a mask, from bit 0; `choices`: what 0, 1, ... stand for."""

    name: str
    unit: str
    kind: Kind
    minimum: float | None
    maximum: float | None
    meaning: str
    grblhal: bool = False
    bits: tuple[str, ...] = ()
    choices: tuple[str, ...] = ()

    def valid(self, value: str) -> str | None:
        """What is wrong with `value`, or None."""
        if self.kind == "text":
            return None
        if not re.fullmatch(r"-?[0-9]{1,9}(\.[0-9]{0,6})?|-?\.[0-9]{1,6}", value):
            return f"{self.name} is a number"
        number = float(value)
        if self.kind != "number" and not number.is_integer():
            return f"{self.name} is a whole number"
        low = -math.inf if self.minimum is None else self.minimum
        high = math.inf if self.maximum is None else self.maximum
        if not low <= number <= high:
            return f"{self.name} goes from {low:g} to {high:g} {self.unit}".rstrip()
        return None


_AXIS_BITS: Final = ("X", "Y", "Z")
_REPORT_BITS: Final = (
    "machine position", "buffer state", "line numbers", "feed and speed", "inputs", "work offset", "overrides",
    "probe coordinates", "sync on work offset", "parser state", "alarm substate", "run substate",
    "report while homing", "distance to go",
)  # fmt: skip


def _flag(name: str, meaning: str, *, grblhal: bool = False) -> Setting:
    return Setting(name, "", "bool", 0, 1, meaning, grblhal)


def _mask(name: str, meaning: str, bits: tuple[str, ...] = _AXIS_BITS, *, grblhal: bool = False) -> Setting:
    return Setting(name, "", "mask", 0, 2 ** max(len(bits), 8) - 1, meaning, grblhal, bits)


def _axes(first: int, name: str, unit: str, meaning: str, most: float | None = None) -> dict[int, Setting]:
    return {
        first + nth: Setting(f"{axis}-axis {name}", unit, "number", 0, most, meaning, nth > 2)
        for nth, axis in enumerate("XYZABC")
    }


SETTINGS: Final[dict[int, Setting]] = {
    0: Setting("step pulse", "us", "number", 2, 255, "length of the step pulse; Grbl needs 3 or more"),
    1: Setting("step idle delay", "ms", "integer", 0, 65535, "until the motors are switched off; 255 keeps them on"),
    2: _mask("step invert", "inverts the step signal of each axis"),
    3: _mask("direction invert", "inverts the direction of each axis"),
    4: _mask("step enable invert", "inverts the enable pin; one bit for all axes in Grbl 1.1"),
    5: _mask("limit pins invert", "inverts the limit switches; one bit for all axes in Grbl 1.1"),
    6: _flag("probe pin invert", "inverts the probe input"),
    10: Setting("status report", "", "mask", 0, 16383, "what a status report holds", bits=_REPORT_BITS),
    11: Setting("junction deviation", "mm", "number", 0, None, "how fast corners are taken"),
    12: Setting("arc tolerance", "mm", "number", 0, None, "how far the chords of an arc may lie from it"),
    13: _flag("report inches", "positions and feeds are reported in inches; settings stay in mm"),
    14: _mask("control pins invert", "inverts the control inputs", (), grblhal=True),
    15: _mask("coolant pins invert", "inverts the coolant outputs", ("flood", "mist"), grblhal=True),
    16: _mask("spindle pins invert", "inverts the spindle outputs", ("enable", "direction", "PWM"), grblhal=True),
    17: _mask("control pull-ups off", "switches pull-up resistors off", (), grblhal=True),
    18: _mask("limit pull-ups off", "switches pull-up resistors off", grblhal=True),
    19: _flag("probe pull-up off", "switches the pull-up resistor of the probe off", grblhal=True),
    20: _flag("soft limits", "refuses moves beyond the travel; needs homing"),
    21: _mask("hard limits", "a limit switch stops the machine", ("on", "strict")),
    22: _mask("homing cycle", "homing is possible and needed at power-up", ("on", "single axes", "on start")),
    23: _mask("homing direction", "axes that home towards the negative end"),
    24: Setting("homing feed", "mm/min", "number", 0, None, "slow approach to the switch"),
    25: Setting("homing seek", "mm/min", "number", 0, None, "fast approach to the switch"),
    26: Setting("homing debounce", "ms", "integer", 0, 65535, "pause that lets a switch settle"),
    27: Setting("homing pull-off", "mm", "number", 0, None, "distance from the switch after homing"),
    28: Setting("G73 retract", "mm", "number", 0, None, "how far G73 backs off", True),
    29: Setting("pulse delay", "us", "number", 0, 20, "from the direction to the step", True),
    30: Setting("spindle maximum", "rpm", "number", 0, None, "speed at full output"),
    31: Setting("spindle minimum", "rpm", "number", 0, None, "speed at the least output"),
    32: Setting("mode", "", "integer", 0, 2, "0 mill, 1 laser, 2 lathe (grblHAL)"),
    33: Setting("spindle PWM frequency", "Hz", "number", 0, None, "frequency of the PWM signal", True),
    34: Setting("spindle PWM off", "%", "number", 0, 100, "duty cycle of a spindle at rest", True),
    35: Setting("spindle PWM minimum", "%", "number", 0, 100, "duty cycle at the minimum speed", True),
    36: Setting("spindle PWM maximum", "%", "number", 0, 100, "duty cycle at the maximum speed", True),
    37: _mask("motors kept on", "axes whose motors are never switched off", grblhal=True),
    38: Setting("encoder pulses", "", "integer", 0, None, "of the spindle encoder per revolution", True),
    39: _flag("legacy real-time commands", "whether ? ! ~ act in comments too", grblhal=True),
    40: _flag("limit jogs", "jogs end at the soft limits instead of being refused", grblhal=True),
    43: Setting("homing passes", "", "integer", 1, 128, "how often each switch is located", True),
    44: _mask("homing: first axes", "axes of the first homing cycle", grblhal=True),
    45: _mask("homing: second axes", "axes of the second homing cycle", grblhal=True),
    46: _mask("homing: third axes", "axes of the third homing cycle", grblhal=True),
    56: Setting("parking pull-out", "mm", "number", 0, None, "distance of the first parking move", True),
    57: Setting("parking pull-out rate", "mm/min", "number", 0, None, "its speed", True),
    58: Setting("parking target", "mm", "number", None, None, "machine position of the parked axis", True),
    59: Setting("parking fast rate", "mm/min", "number", 0, None, "speed of the second parking move", True),
    60: _flag("restore overrides", "overrides go back to 100 % at M2, M30", grblhal=True),
    61: _mask("safety door options", "what the door does", ("ignore when idle", "keep coolant on"), grblhal=True),
    62: _mask("sleep", "goes to sleep by itself", ("on",), grblhal=True),
    63: _mask("feed hold actions", "what a hold does", ("laser off", "restore"), grblhal=True),
    64: _flag("force alarm at start", "the machine is locked after every reset", grblhal=True),
    65: _mask("probing options", "what may happen while probing", ("feed override",), grblhal=True),
    341: Setting(
        "tool change mode", "", "integer", 0, 4, "0 normal, 1 and 2 manual touch-off, 3 at G59.3, 4 none", True
    ),
    342: Setting("tool change probing distance", "mm", "number", 0, None, "travel of the touch-off", True),
    343: Setting("tool change locate feed", "mm/min", "number", 0, None, "slow approach of the touch-off", True),
    344: Setting("tool change seek feed", "mm/min", "number", 0, None, "fast approach of the touch-off", True),
    **_axes(100, "steps", "step/mm", "motor steps per mm of travel"),
    **_axes(110, "maximum rate", "mm/min", "speed of rapids; feeds are limited to it"),
    **_axes(120, "acceleration", "mm/s2", "how fast the axis gains speed"),
    **_axes(130, "travel", "mm", "from the homed end; machine space goes from minus this to 0"),
}

_GRBL: Final[dict[int, Setting]] = {
    0: Setting("step pulse", "us", "integer", 3, 255, "length of the step pulse"),
    4: _flag("step enable invert", "inverts the enable pin of all axes"),
    5: _flag("limit pins invert", "inverts the limit switches of all axes"),
    10: _mask("status report", "what a status report holds", _REPORT_BITS[:2]),
    21: _flag("hard limits", "a limit switch stops the machine"),
    22: _flag("homing cycle", "homing is possible and needed at power-up"),
    32: _flag("laser mode", "the spindle output follows the motion, without stops"),
}
"""What Grbl 1.1 takes otherwise than grblHAL."""


def known(number: int, *, grblhal: bool) -> Setting | None:
    """What is known of a setting of this firmware, or None."""
    return SETTINGS.get(number) if grblhal else _GRBL.get(number) or SETTINGS.get(number)


def of_grblhal(numbers: Iterable[int]) -> bool:
    """Whether a controller with these settings is a grblHAL: every one has some that Grbl 1.1 lacks."""
    return any(setting.grblhal for number in numbers if (setting := SETTINGS.get(number)) is not None)


_KINDS: Final[dict[int | None, Kind]] = {
    0: "bool", 1: "mask", 2: "mask", 3: "integer", 4: "mask", 5: "integer", 6: "number"
}  # fmt: skip
"""grblHAL's data types: boolean, bit field, bit field whose first bit switches it on, one of several, axes, whole
number, decimal. Text, password and address are text."""
_RADIO: Final = 3
_AXES_MASK: Final = 4
_AXIS_LETTERS: Final = tuple("XYZABCUVW")


def described(said: SettingDescription) -> Setting:
    """A setting as a grblHAL describes it; what it is for is the table's, where that knows it."""
    kind = _KINDS.get(said.datatype, "text")
    named = tuple(part.strip() for part in said.form.split(","))
    bits: tuple[str, ...] = ()
    choices: tuple[str, ...] = ()
    low, high = said.minimum, said.maximum
    if kind == "bool":
        low, high = 0.0, 1.0
    elif said.datatype == _RADIO:
        choices = named
        low, high = 0.0, len(named) - 1.0
    elif kind == "mask":
        bits = _AXIS_LETTERS if said.datatype == _AXES_MASK else named
        low, high = 0.0, 2.0 ** max(len(bits), 8) - 1
    elif kind == "text":
        low = high = None  # they bound its length
    meaning = SETTINGS[said.number].meaning if said.number in SETTINGS else ""
    return Setting(said.name, said.unit, kind, low, high, meaning, grblhal=True, bits=bits, choices=choices)


STEPS_PER_MM: Final = 100
