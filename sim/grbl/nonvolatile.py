"""What survives without power: `$n` settings, work offsets, start-up lines, the build line (grbl II.10, II.6).

The table of settings is data; every value is read, checked and printed by it. The one rule: a write says how many bytes
of the EEPROM it changed, for that is how long the controller is deaf.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Literal

from sim.grbl.errors import Refused
from sim.grbl.simsettings import AXES, ORIGIN, Point, SimSettings

Kind = Literal["int", "mask", "bool", "float"]

FLOAT_BYTES: Final = 5
"""A changed number, four bytes, and the checksum of its record."""
COORD_BYTES: Final = 4 * len(AXES) + 1


@dataclass(frozen=True, slots=True)
class Setting:
    """One row of `$$`."""

    number: int
    name: str
    default: float
    unit: str
    kind: Kind


def _axes(first: int, name: str, default: float, unit: str) -> list[Setting]:
    return [Setting(first + at, f"{axis} {name}", default, unit, "float") for at, axis in enumerate(AXES)]


_ROWS: Final = [
    Setting(0, "step pulse", 10, "us", "int"),
    Setting(1, "step idle delay", 25, "ms", "int"),
    Setting(2, "step invert", 0, "mask", "mask"),
    Setting(3, "direction invert", 0, "mask", "mask"),
    Setting(4, "step enable invert", 0, "", "bool"),
    Setting(5, "limit pins invert", 0, "", "bool"),
    Setting(6, "probe pin invert", 0, "", "bool"),
    Setting(10, "status report", 1, "mask", "mask"),
    Setting(11, "junction deviation", 0.010, "mm", "float"),
    Setting(12, "arc tolerance", 0.002, "mm", "float"),
    Setting(13, "report inches", 0, "", "bool"),
    Setting(20, "soft limits", 0, "", "bool"),
    Setting(21, "hard limits", 0, "", "bool"),
    Setting(22, "homing cycle", 0, "", "bool"),
    Setting(23, "homing direction invert", 0, "mask", "mask"),
    Setting(24, "homing locate rate", 25.0, "mm/min", "float"),
    Setting(25, "homing search rate", 500.0, "mm/min", "float"),
    Setting(26, "homing debounce", 250, "ms", "int"),
    Setting(27, "homing pull-off", 1.0, "mm", "float"),
    Setting(30, "maximum spindle speed", 1000, "rpm", "int"),
    Setting(31, "minimum spindle speed", 0, "rpm", "int"),
    Setting(32, "laser mode", 0, "", "bool"),
    *_axes(100, "steps", 250.0, "step/mm"),
    *_axes(110, "maximum rate", 500.0, "mm/min"),
    *_axes(120, "acceleration", 10.0, "mm/s2"),
    *_axes(130, "maximum travel", 200.0, "mm"),
]

_HAL_ROWS: Final = [
    Setting(39, "legacy realtime commands", 1, "", "bool"),
    Setting(341, "tool change mode", 0, "", "int"),
]

TABLE: Final[dict[int, Setting]] = {row.number: row for row in _ROWS}
HAL_TABLE: Final[dict[int, Setting]] = {row.number: row for row in sorted((*_ROWS, *_HAL_ROWS), key=lambda r: r.number)}

COORDINATE_SYSTEMS: Final = ("G54", "G55", "G56", "G57", "G58", "G59")
HAL_COORDINATE_SYSTEMS: Final = (*COORDINATE_SYSTEMS, "G59.1", "G59.2", "G59.3")
STARTUP_LINES: Final = 2


class Nonvolatile:
    """The EEPROM. Kept by resets and without power; `$RST` puts parts of it back."""

    def __init__(self, kind: SimSettings) -> None:
        self._kind = kind
        self.table = HAL_TABLE if kind.hal else TABLE
        self._values: dict[int, float] = {}
        self.coords: dict[str, Point] = {}
        self.startup = [""] * STARTUP_LINES
        self.build_info = ""
        self.restore("*")
        for number, value in kind.dollar.items():
            if number not in self.table:
                raise ValueError(f"there is no setting ${number}")
            self._values[number] = value

    # Settings.

    def __getitem__(self, number: int) -> float:
        return self._values[number]

    def on(self, number: int) -> bool:
        return self._values[number] != 0

    def axes(self, first: int) -> Point:
        """Three settings of the axes: 100 steps, 110 rates, 120 accelerations, 130 travels."""
        values = self._values
        return values[first], values[first + 1], values[first + 2]

    def settings(self) -> Mapping[int, float]:
        return self._values

    def show(self, number: int) -> str:
        """The value as `$$` prints it."""
        value = self._values[number]
        if self.table[number].kind == "float" or (self._kind.hal and number == 0):
            return f"{value:.1f}" if self._kind.hal and number == 0 else f"{value:.3f}"
        return f"{int(value)}"

    def store(self, number: int, value: float) -> int:
        """`$number=value`: bytes written. Raises Refused (II.8)."""
        row = self.table.get(number)
        if value < 0:
            raise Refused(4)
        if row is None:
            raise Refused(3)
        if row.kind != "float":
            value = float(int(value)) if row.kind != "bool" else float(int(value) != 0)
        self._check(number, value)
        if self._kind.hal and number == 10:
            value = float(int(value) & 0x3FFF)
        before = dict(self._values)
        self._values[number] = value
        if number == 22 and not value:
            self._values[20] = 0.0  # soft limits cannot be without homing
        return FLOAT_BYTES * sum(before[key] != now for key, now in self._values.items())

    def _check(self, number: int, value: float) -> None:
        if number == 0 and value < 3:
            raise Refused(6)
        if number == 20 and value and not self.on(22):
            raise Refused(10)
        if number == 32 and value and not self._kind.variable_spindle:
            raise Refused(17)
        if self._kind.hal and 100 <= number < 130 and value <= 0:
            raise Refused(19)
        if number in range(100, 103) or number in range(110, 113):
            axis = number % 10
            steps = value if number < 110 else self._values[100 + axis]
            rate = value if number >= 110 else self._values[110 + axis]
            if self._kind.max_step_rate_hz and steps * rate / 60 > self._kind.max_step_rate_hz:
                raise Refused(12)

    # Everything else.

    @property
    def systems(self) -> tuple[str, ...]:
        return HAL_COORDINATE_SYSTEMS if self._kind.hal else COORDINATE_SYSTEMS

    def store_coord(self, name: str, value: Point) -> int:
        before = self.coords[name]
        self.coords[name] = value
        return COORD_BYTES if before != value else 0

    def store_startup(self, number: int, text: str) -> int:
        """Raises Refused for a number that is no line's."""
        if number not in range(STARTUP_LINES):
            raise Refused(3)
        before, self.startup[number] = self.startup[number], text
        return len(text) + 2 if before != text else 0

    def store_build_info(self, text: str) -> int:
        before, self.build_info = self.build_info, text
        return len(text) + 2 if before != text else 0

    def restore(self, what: str) -> int:
        """`$`: settings, `#`: offsets, `*`: everything, start-up lines and build line too."""
        written = 0
        if what in "$*":
            self._values = {number: float(row.default) for number, row in self.table.items()}
            if self._kind.hal:
                self._values[10] = 511.0
            written += 90
        if what in "#*":
            self.coords = dict.fromkeys((*self.systems, "G28", "G30"), ORIGIN)
            written += COORD_BYTES * len(self.coords)
        if what == "*":
            self.startup = [""] * STARTUP_LINES
            self.build_info = ""
            written += 2 * (STARTUP_LINES + 1)
        return written
