"""What kind of Grbl board is simulated: its flavour, its build options, its pace and its mechanics.

Not the `$n` settings of the firmware (`nonvolatile.py`), though `dollar` may give some of them other first values.
The one rule: every field has a default, and the defaults together are an Uno with Grbl 1.1h as it is downloaded.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final, Literal

Flavour = Literal["1.1h", "grblHAL"]
Point = tuple[float, float, float]

AXES: Final = "XYZ"
ORIGIN: Final[Point] = (0.0, 0.0, 0.0)

_RX_BYTES: Final = {"1.1h": 128, "grblHAL": 1023}
"""What the ring really takes: grblHAL reports 1024 and wastes one."""
_PLANNER_BLOCKS: Final = {"1.1h": 15, "grblHAL": 100}


def _travel() -> dict[str, float]:
    return {"X": 200.0, "Y": 200.0, "Z": 200.0}


@dataclass(frozen=True, slots=True)
class SimSettings:
    """Times in seconds of the outer clock; `speed_factor` is for motion, dwell and homing only."""

    flavour: Flavour = "1.1h"
    rx_bytes: int = 0
    """Bytes that the receive ring takes; 0: what the flavour has (128, 1023)."""
    planner_blocks: int = 0
    """Blocks that can be queued; 0: what the flavour has (15, one less with line numbers; 100)."""

    speed_factor: float = 1.0
    instant: bool = False
    """Motion, dwell and homing take no time at all."""
    line_s: float = 0.0
    """Time to parse a line."""
    boot_s: float = 1.5
    """From power-on, or the DTR pulse of opening the port, to the banner: the bootloader."""
    reset_s: float = 0.03
    """From a soft reset to the banner; bytes in between are lost."""
    alarm_s: float = 0.5
    """Grbl stands still so long after ALARM:n."""
    eeprom_byte_s: float = 0.0034
    """Interrupts are off so long for each byte written to the EEPROM. grblHAL writes without a pause."""
    reset_on_open: bool = False
    """Opening the port resets the board, as DTR does on an Uno."""

    spindle_delay_s: float = 4.0
    """Spin-up before motion goes on after a door or a spindle stop."""
    coolant_delay_s: float = 1.0
    variable_spindle: bool = True
    mist: bool = False
    """Built with M7."""
    line_numbers: bool = False
    door_pin: bool = False
    single_axis_homing: bool = False
    homing_lock: bool = True
    """Alarm at power-up when homing is enabled, until $H or $X."""
    echo: bool = False
    """[echo:LINE] before each answer."""
    max_step_rate_hz: float = 0.0
    """error:12 for settings beyond; 0: not checked, as downloaded."""
    tool_change: bool = True
    """grblHAL: M6 leads to the state Tool; without it M6 is ignored."""

    travel: Mapping[str, float] = field(default_factory=_travel)
    """Distance of the limit switches of an axis, mm: they stand at 0 and -travel of machine space."""
    start_position: Point = (-50.0, -50.0, -50.0)
    """Where the tool really stands at power-on, in machine space; Grbl calls that place 0,0,0 until it is homed."""
    probe_z: float | None = None
    """The probe touches at this Z of machine space and below it; None: nothing is there."""
    dollar: Mapping[int, float] = field(default_factory=dict[int, float])
    """`$n` settings that differ from the defaults from the start."""

    card: Mapping[str, str] | None = None
    """grblHAL: the files of its SD card, their text by name; None: built without."""

    executed_limit: int = 0
    """Keep at least the last so many executed lines in memory; 0: all."""

    def __post_init__(self) -> None:
        """Raises ValueError for a value no machine can have."""
        if self.flavour not in _RX_BYTES:
            raise ValueError(f"flavour must be 1.1h or grblHAL, not {self.flavour!r}")
        if not self.speed_factor > 0:
            raise ValueError(f"speed_factor must be more than 0, not {self.speed_factor}")
        for name in (
            "line_s",
            "boot_s",
            "reset_s",
            "alarm_s",
            "eeprom_byte_s",
            "spindle_delay_s",
            "coolant_delay_s",
            "max_step_rate_hz",
            "executed_limit",
        ):
            if getattr(self, name) < 0:
                raise ValueError(f"{name} must not be negative, not {getattr(self, name)}")
        if self.rx_bytes and self.rx_bytes < 16:
            raise ValueError(f"rx_bytes must be 0 or at least 16, not {self.rx_bytes}")
        if self.planner_blocks and self.planner_blocks < 2:
            raise ValueError(f"planner_blocks must be 0 or at least 2, not {self.planner_blocks}")
        for axis, length_mm in self.travel.items():
            if axis not in ("X", "Y", "Z") or not length_mm > 0:
                raise ValueError(f"travel of {axis!r} must be more than 0 mm of an axis of {AXES}, not {length_mm}")

    @property
    def hal(self) -> bool:
        return self.flavour == "grblHAL"

    @property
    def ring_bytes(self) -> int:
        return self.rx_bytes or _RX_BYTES[self.flavour]

    @property
    def reported_rx_bytes(self) -> int:
        """The number in `[OPT:`."""
        return self.ring_bytes + 1 if self.hal else self.ring_bytes

    @property
    def usable_blocks(self) -> int:
        return self.planner_blocks or _PLANNER_BLOCKS[self.flavour] - (self.line_numbers and not self.hal)

    @property
    def line_limit(self) -> int:
        """Characters of a line after blanks and comments are out: an 80-byte buffer with its end mark (II.1)."""
        return 255 if self.hal else 79
