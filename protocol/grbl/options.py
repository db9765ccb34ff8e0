"""What the build options of a firmware mean: the letters of `[OPT:]`, the words of `[NEWOPT:]` (grbl II.6, grblHAL).

Data, no code that asks. The one rule: a letter or word that is not here is shown all the same, as unknown.
"""

from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True, slots=True)
class Option:
    """`warns`: somebody who relies on the usual build should know."""

    meaning: str
    warns: bool = False


LETTERS: Final[dict[str, Option]] = {
    "V": Option("spindle with variable speed"),
    "N": Option("line numbers in reports"),
    "M": Option("mist coolant (M7)"),
    "C": Option("CoreXY kinematics"),
    "P": Option("parking motion"),
    "Z": Option("homing sets the machine position to 0"),
    "H": Option("axes can be homed one by one"),
    "T": Option("two limit switches on an axis"),
    "A": Option("feed overrides act while probing"),
    "D": Option("the spindle's direction pin is its enable pin", warns=True),
    "0": Option("the spindle is off at S0"),
    "S": Option("limit switches are debounced by software"),
    "R": Option("parking can be overridden by the program"),
    "+": Option("safety door input"),
    "2": Option("dual-axis motors with a switch each"),
    "*": Option("built without $RST=*: everything cannot be put back to the defaults at once", warns=True),
    "$": Option("built without $RST=$: settings cannot be put back to the defaults", warns=True),
    "#": Option("built without $RST=#: offsets cannot be cleared at once", warns=True),
    "I": Option("built without $I=: the info text cannot be written", warns=True),
    "E": Option("does not wait for the end of motion before it writes its memory", warns=True),
    "W": Option("does not wait for the end of motion when a work offset changes: positions jump", warns=True),
    "L": Option("not locked at power-up although it is not homed: it moves without knowing where it is", warns=True),
}

WORDS: Final[dict[str, Option]] = {
    "ENUMS": Option("describes its own settings ($ES)"),
    "RT+": Option("? ! ~ act wherever they stand ($39=1)"),
    "RT-": Option("? ! ~ do not act in comments and settings ($39=0)"),
    "HOME": Option("homing can be ordered axis by axis"),
    "NOPROBE": Option("no probe input", warns=True),
    "PC": Option("probe input that says whether it is connected"),
    "OS": Option("optional stop input"),
    "BD": Option("block delete input"),
    "ES": Option("emergency stop input"),
    "MPG": Option("a pendant can take the machine over"),
    "LATHE": Option("lathe functions"),
    "EXPR": Option("parameters and expressions (#1=...)"),
    "TC": Option("tool change by hand (M6)"),
    "ATC": Option("automatic tool changer"),
    "SS": Option("spindle synchronisation"),
    "SED": Option("tells what a setting is for ($SED)"),
    "RTC": Option("real-time clock"),
    "SD": Option("SD card"),
    "ETH": Option("Ethernet"),
    "WIFI": Option("wireless network"),
    "BT": Option("Bluetooth"),
    "REBOOT": Option("can be rebooted by a command"),
    "PPI": Option("laser pulses per inch"),
    "CCMP": Option("cutter compensation"),
    "PID": Option("reports the data of a PID controller"),
    "CAN": Option("CAN bus"),
}


def letter(of: str) -> Option | None:
    """A letter of `[OPT:]`, or None."""
    return LETTERS.get(of)


def word(of: str) -> Option | None:
    """A word of `[NEWOPT:]`, with or without a value (`PROBES=2`), or None."""
    name, _, value = of.partition("=")
    if name == "PROBES":
        return Option(f"{value} probes" if value.isdigit() else "several probes")
    if name == "ATC" and value == "0":
        return Option("automatic tool changer, not in use")
    return WORDS.get(name)
