"""What a controller remembers between blocks: position, modes, offsets. Not what a block does; that is interpreter.py.

The one rule: what is not certain is NaN (a coordinate) or None (a mode), never a guess.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from math import isnan, nan

MOST_SYSTEMS = 9
"""G54 to G59.3."""


@dataclass(slots=True)
class State:
    """Lengths in mm, angles in degrees, in the order of `axes` (upper-case letters).

    `position` is in machine coordinates as far as they are known; program coordinate = machine coordinate - frame.
    `motion` is the effect of the modal motion code (`rapid`, `feed`, `arc_cw`, `drill`, ..., `cancel`), None where no
    code has set it; `motion_name` its name (`G83`). `spindle` is 1 clockwise, -1 counter-clockwise, 0 off.
    `tool` is in the spindle, `selected` is what T named last. `cycle` holds the sticky words of a canned cycle, in mm.
    `position` is replaced, never edited. `systems`, `tools`, `homes` hold what is known: an entry that is absent or
    NaN is an offset that nobody has told, and counts as 0 in `frame`. `diameters` are those of the tools.
    `adrift`: rows of axes whose machine coordinate is counted from an unknown origin since G92 or G10 L20 anchored it.
    `radius` is the tool's for compensation. `sync`: the controller's queue runs dry before the next motion.
    """

    axes: str
    position: list[float]
    absolute: bool | None = True
    remembered: bool | None = None
    arc_absolute: bool = False
    inches: bool = False
    plane: int = 17
    feed_mode: int = 94
    motion: str | None = None
    motion_name: str | None = None
    feed: float | None = None
    spindle: int | None = 0
    speed: float = 0.0
    mist: bool = False
    flood: bool = False
    tool: int | None = None
    selected: int | None = None
    return_to_r: bool = False
    compensation: int = 40
    home_ignored: bool = False
    cycle: dict[str, float] = field(default_factory=dict)
    system: int = 1
    systems: dict[int, list[float]] = field(default_factory=dict)
    shift: list[float] = field(default_factory=list)
    shift_active: bool = False
    tool_offset: list[float] = field(default_factory=list)
    homes: dict[int, list[float]] = field(default_factory=dict)
    tools: dict[int, list[float]] = field(default_factory=dict)
    diameters: dict[int, float] = field(default_factory=dict)
    radius: float | None = None
    diameter_mode: bool = False
    adrift: frozenset[int] = frozenset()
    saved: "State | None" = None
    sync: bool = False
    ended: bool = False
    frame: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        nothing = [0.0] * len(self.axes)
        self.shift = self.shift or list(nothing)
        self.tool_offset = self.tool_offset or list(nothing)
        self.frame = self.frame or tuple(nothing)

    @classmethod
    def unknown(cls, axes: str) -> "State":
        """The machine may stand anywhere."""
        return cls(axes, [nan] * len(axes))

    def copy(self) -> "State":
        """A second state that goes on from here by itself."""
        return replace(
            self,
            position=list(self.position),
            cycle=dict(self.cycle),
            systems={key: list(value) for key, value in self.systems.items()},
            shift=list(self.shift),
            tool_offset=list(self.tool_offset),
            homes={key: list(value) for key, value in self.homes.items()},
            tools={key: list(value) for key, value in self.tools.items()},
            diameters=dict(self.diameters),
        )

    def assumed(self, place: Sequence[float] | None = None) -> "State":
        """A second state in which nothing is unknown: for estimates, never for judging and never for sending.

        Axes whose place nobody knows stand at `place`, machine coordinates, or else at the program's zero; offsets and
        homes that nobody has told are 0, as in a controller that is new.
        """
        other = self.copy()
        nothing = [0.0] * len(self.axes)
        other.systems = {n: _told(self.systems.get(n, nothing)) for n in range(1, MOST_SYSTEMS + 1)}
        other.homes = {n: _told(self.homes.get(n, nothing)) for n in (28, 30)}
        other.shift, other.tool_offset = _told(self.shift), _told(self.tool_offset)
        other.adrift = frozenset()
        other.refresh_frame()
        fallback = other.frame if place is None else place
        pairs = zip(self.position, fallback, strict=True)
        other.position = [where if isnan(known) else known for known, where in pairs]
        return other

    def modes(self) -> tuple[object, ...]:
        """All modes that a block can change without a word beside it: two states of the same modes obey it alike."""
        return (
            *(self.absolute, self.remembered, self.arc_absolute, self.inches, self.plane, self.feed_mode),
            *(self.feed is None, self.motion_name, self.spindle, self.mist, self.flood, self.selected, self.tool),
            *(self.return_to_r, self.compensation, self.radius, self.home_ignored, self.system, self.shift_active),
            *(self.diameter_mode, self.sync, self.ended, self.frame),
        )

    def place(self) -> dict[str, float]:
        """The known program coordinates, by lower-case axis name: what the machine would report as work position."""
        return {
            axis.lower(): machine - offset
            for axis, machine, offset in zip(self.axes, self.position, self.frame, strict=True)
            if not isnan(machine)
        }

    def locate(self, place: dict[str, float]) -> None:
        """The machine's own account of its program coordinates; an axis that is not in it is not known any more."""
        self.position = [
            place.get(axis.lower(), nan) + offset for axis, offset in zip(self.axes, self.frame, strict=True)
        ]

    def refresh_frame(self) -> None:
        """Work out `frame` after a change of an offset. The machine has not moved."""
        system = self.systems.get(self.system)
        self.frame = tuple(
            _known(system[row] if system else 0.0)
            + (_known(self.shift[row]) if self.shift_active else 0.0)
            + _known(self.tool_offset[row])
            for row in range(len(self.axes))
        )


def _told(offsets: list[float]) -> list[float]:
    return [_known(offset) for offset in offsets]


def _known(offset: float) -> float:
    return 0.0 if isnan(offset) else offset
