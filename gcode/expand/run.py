"""The state of one expansion: where it is, which subprograms are open, what the parameters hold. Not the statements.

The one rule: every way backwards goes through `jump`, which counts it, so that nothing runs for ever; and a jump with
which nothing has changed since the one before is refused at once, for it would come back for ever.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Literal, TypeVar

from gcode.expand.arithmetic import Value, integer
from gcode.expand.errors import Meter, RefusalError
from gcode.expand.expressions import Parameter
from gcode.expand.parameters import Parameters
from gcode.expand.reading import Source
from gcode.expand.statements import Setting
from gcode.expand.structure import Place, Structure

T = TypeVar("T")


@dataclass(slots=True)
class Frame:
    """An open subprogram: `sub` called as an O-word, `m98` or `g65`. It was called at `caller` and goes back to `back`.

    `start` is its first place, `turns` how many more times it is to run, this one included, each with `arguments`;
    `counters` hold what is left of its `repeat` loops, by line.
    """

    kind: Literal["main", "sub", "m98", "g65"]
    caller: Place
    back: Place
    start: Place
    turns: int = 1
    arguments: Mapping[int, float] = field(default_factory=dict)
    counters: dict[int, int] = field(default_factory=dict)


@dataclass(slots=True)
class Run:
    """`place` is the statement that comes next."""

    structure: Structure
    parameters: Parameters
    meter: Meter
    place: Place = (1, 0)
    ended: bool = False
    frames: list[Frame] = field(default_factory=lambda: [Frame("main", (0, 0), (0, 0), (1, 0))])
    _changes: int = 0
    _jumped: dict[Place, tuple[int, int, int, dict[int, int]]] = field(default_factory=dict)

    @property
    def frame(self) -> Frame:
        """The innermost one."""
        return self.frames[-1]

    def jump(self, place: Place, *, counted: bool = False) -> None:
        """Go on there; `counted`: a jump that is made so many times and no more. Raises RefusalError for too many."""
        if place <= self.place:
            self.meter.iteration()
            if not counted:
                self._refuse_endless()
        self.place = place

    def _refuse_endless(self) -> None:
        """Conditions hang on parameters and counters alone: with the same of both the same turn follows, always."""
        frame = self.frame
        now = self._changes, id(frame), frame.turns, dict(frame.counters)
        if self._jumped.get(self.place) == now:
            raise RefusalError("endless", "this loop never ends: nothing that it does changes its condition")
        self._jumped[self.place] = now

    def call(self, frame: Frame) -> None:
        """Begin a subprogram. Raises RefusalError when it is too deep."""
        self.meter.depth(len(self.frames))
        self.frames.append(frame)
        self._changes += 1
        self.place = frame.start

    def leave(self) -> Frame:
        """End the innermost subprogram and go on behind its call."""
        frame = self.frames.pop()
        self._changes += 1
        self.place = frame.back
        return frame

    def located(self, source: Source, at: int, action: Callable[[], T]) -> T:
        """Do something that may be refused; raises ExpandError with the place then."""
        try:
            return action()
        except RefusalError as error:
            raise source.error(at, error.code, error.message) from error

    def target(self, source: Source, parameter: Parameter) -> int | str:
        """Number or name of the parameter that a setting means."""
        if parameter.index is None:
            return parameter.name
        index = parameter.index(self.parameters)
        return self.located(source, parameter.at, lambda: integer(index, "a parameter's number"))

    def set(self, source: Source, setting: Setting, target: int | str, value: Value) -> None:
        """Carry out a setting whose sides are known."""

        def store() -> None:
            if isinstance(target, str):
                self.parameters.set_named(target, value)
            else:
                self.parameters.set_number(target, value)

        self._changes += 1
        self.located(source, setting.target.at, store)
