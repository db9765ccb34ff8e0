"""Parameters and their values: LinuxCNC's numbered and named ones, Fanuc's variables. Not how they are written.

What only the machine knows (its position, its offsets, probe results) is asked of a hook. The one rule: a value that
depends on the machine and that nobody told is a RefusalError, never a 0.
"""

import re
from collections.abc import Callable, Mapping
from typing import Protocol

from gcode.expand.arithmetic import Value, as_number
from gcode.expand.errors import RefusalError

SystemHook = Callable[[int | str], float | None]
"""Given `#5420` as 5420 and `#<_x>` as `_x`, the value there, or None when it is not known."""

MAX_LINUXCNC = 5601
"""The highest number of a parameter in LinuxCNC."""

LINUXCNC_LOCALS = 30
"""#1 to #30 belong to the call of a subroutine; its arguments are the first of them."""

FANUC_LOCALS = 33


DEBUG_SWITCH = 5599
"""LinuxCNC: while this is 0, (DEBUG,) comments are not shown."""

# Probe results, G28, G30, G92, coordinate systems and their rotation, M66, tool and position.
_LINUXCNC_SYSTEM = (
    range(5061, 5071),
    range(5161, 5170),
    range(5181, 5190),
    range(5210, 5400),
    range(5400, 5429),
)
_SYSTEM_NAMES = frozenset(
    re.findall(
        r"[a-z_]+",
        """_vmajor _vminor _line _motion_mode _plane _ccomp _metric _imperial _absolute _incremental _inverse_time
        _units_per_minute _units_per_rev _coord_system _tool_offset _retract_r_plane _retract_old_z _spindle_rpm_mode
        _spindle_css_mode _ijk_absolute_mode _lathe_diameter_mode _lathe_radius_mode _spindle_on _spindle_cw _mist
        _flood _speed_override _feed_override _adaptive_feed _feed_hold _feed _rpm _x _y _z _a _b _c _u _v _w _abs_x
        _abs_y _abs_z _abs_a _abs_b _abs_c _current_tool _current_pocket _selected_tool _selected_pocket _task
        _remap_level""",
    )
)
_SYSTEM_PREFIXES = ("_ini[", "_hal[")
_OWN_NAMES = frozenset({"_VALUE", "_VALUE_RETURNED", "_CALL_LEVEL"})


class Parameters(Protocol):
    """What an expansion needs of either kind. All but `push` and `pop` may raise RefusalError."""

    def number(self, index: int) -> Value:
        """The value of `#index`."""

    def named(self, name: str) -> Value:
        """The value of `#<name>`."""

    def exists(self, name: str) -> bool:
        """Whether `#<name>` has a value."""

    def set_number(self, index: int, value: Value) -> None:
        """`#index = value`."""

    def set_named(self, name: str, value: Value) -> None:
        """`#<name> = value`."""

    def push(self, arguments: Mapping[int, float]) -> None:
        """A subprogram with local parameters begins."""

    def pop(self) -> None:
        """It ends: the caller's local parameters are those from before."""

    def returned(self, value: Value) -> None:
        """A subroutine ended with this value, or None."""


class LinuxcncParameters:
    """Numbers 1 to 5601 and names; a name that begins with _ is global. A number never written is 0."""

    def __init__(self, initial: Mapping[int, float], system: SystemHook) -> None:
        self._system = system
        self._told = dict(initial)
        self._numbers = {DEBUG_SWITCH: 1.0}
        self._globals: dict[str, float] = {"_VALUE": 0.0, "_VALUE_RETURNED": 0.0}
        self._frames: list[tuple[dict[int, float], dict[str, float]]] = []
        self.push({index: value for index, value in initial.items() if 1 <= index <= LINUXCNC_LOCALS})

    def number(self, index: int) -> float:
        """The value of `#index`."""
        self._check(index)
        if index <= LINUXCNC_LOCALS:
            return self._frames[-1][0].get(index, 0.0)
        if index in self._numbers:
            return self._numbers[index]
        if index in self._told:
            return self._told[index]
        if _is_linuxcnc_system(index):
            return _asked(self._system, index, f"#{index}")
        return 0.0

    def named(self, name: str) -> float:
        """The value of `#<name>`."""
        if name == "_CALL_LEVEL":
            return float(len(self._frames) - 1)
        values = self._names(name)
        if name in values:
            return values[name]
        if _is_system_name(name):
            return _asked(self._system, name.lower(), f"#<{name.lower()}>")
        value = self._system(name.lower()) if name.startswith("_") else None
        if value is None:
            raise RefusalError("undefined_parameter", f"#<{name.lower()}> is read before it is set")
        return value

    def exists(self, name: str) -> bool:
        """Whether `#<name>` has a value."""
        if name in self._names(name) or name in _OWN_NAMES:
            return True
        return name.startswith("_") and (name.lower() in _SYSTEM_NAMES or self._system(name.lower()) is not None)

    def set_number(self, index: int, value: Value) -> None:
        """`#index = value`."""
        self._check(index)
        if _is_linuxcnc_system(index):
            raise RefusalError("machine_parameter", f"#{index} belongs to the machine: plain G-code cannot set it")
        (self._frames[-1][0] if index <= LINUXCNC_LOCALS else self._numbers)[index] = as_number(value)

    def set_named(self, name: str, value: Value) -> None:
        """`#<name> = value`."""
        if name in _OWN_NAMES or _is_system_name(name):
            raise RefusalError("machine_parameter", f"#<{name.lower()}> is given by the control: it cannot be set")
        self._names(name)[name] = as_number(value)

    def push(self, arguments: Mapping[int, float]) -> None:
        """A subroutine begins: its arguments, and all other local parameters new."""
        self._frames.append((dict(arguments), {}))

    def pop(self) -> None:
        """The caller's local parameters are those from before."""
        self._frames.pop()

    def returned(self, value: Value) -> None:
        """Sets `#<_value>` and `#<_value_returned>`."""
        self._globals["_VALUE_RETURNED"] = float(value is not None)
        self._globals["_VALUE"] = as_number(value)

    def _names(self, name: str) -> dict[str, float]:
        return self._globals if name.startswith("_") else self._frames[-1][1]

    def _check(self, index: int) -> None:
        if not 1 <= index <= MAX_LINUXCNC:
            raise RefusalError("bad_parameter", f"#{index}: parameters are numbered from 1 to {MAX_LINUXCNC}")


class FanucParameters:
    """#0 is null, #1 to #33 local, #100 to #199 and #500 to #999 common. What was never written is null."""

    def __init__(self, initial: Mapping[int, float], system: SystemHook) -> None:
        self._system = system
        self._told = dict(initial)
        self._commons: dict[int, float] = {}
        self._frames: list[dict[int, float]] = []
        self.push({index: value for index, value in initial.items() if 1 <= index <= FANUC_LOCALS})

    def number(self, index: int) -> Value:
        """The value of `#index`."""
        if index == 0:
            return None
        if index in self._told and index > FANUC_LOCALS:
            return self._commons.get(index, self._told[index])
        if index >= 1000:
            return _asked(self._system, index, f"#{index}")
        return self._place(index).get(index)

    def named(self, name: str) -> Value:
        """Fanuc has no names."""
        raise RefusalError("bad_parameter", f"#<{name.lower()}>: Fanuc's parameters have numbers")

    def exists(self, name: str) -> bool:  # noqa: ARG002 - what a scope must be able to answer
        """Fanuc has no names."""
        return False

    def set_number(self, index: int, value: Value) -> None:
        """`#index = value`; null makes it empty."""
        if index == 0:
            raise RefusalError("bad_parameter", "#0 is always empty: it cannot be set")
        if index >= 1000:
            raise RefusalError("machine_parameter", f"#{index} belongs to the machine: plain G-code cannot set it")
        place = self._place(index)
        self._told.pop(index, None)
        if value is None:
            place.pop(index, None)
        else:
            place[index] = value

    def set_named(self, name: str, value: Value) -> None:  # noqa: ARG002 - as above
        """Fanuc has no names."""
        self.named(name)

    def push(self, arguments: Mapping[int, float]) -> None:
        """A macro called with G65 begins: its arguments, and all other local parameters empty."""
        self._frames.append(dict(arguments))

    def pop(self) -> None:
        """The caller's local parameters are those from before."""
        self._frames.pop()

    def returned(self, value: Value) -> None:
        """Fanuc's subprograms give no value back."""

    def _place(self, index: int) -> dict[int, float]:
        if 1 <= index <= FANUC_LOCALS:
            return self._frames[-1]
        if 100 <= index <= 199 or 500 <= index <= 999:
            return self._commons
        raise RefusalError("bad_parameter", f"#{index} does not exist: there are #1-#33, #100-#199 and #500-#999")


def _is_linuxcnc_system(index: int) -> bool:
    return any(index in numbers for numbers in _LINUXCNC_SYSTEM)


def _is_system_name(name: str) -> bool:
    lower = name.lower()
    return lower in _SYSTEM_NAMES or lower.startswith(_SYSTEM_PREFIXES)


def _asked(system: SystemHook, key: int | str, shown: str) -> float:
    value = system(key)
    if value is None:
        raise RefusalError(
            "machine_parameter", f"{shown} depends on the machine: its value is not known before the job runs"
        )
    return value
