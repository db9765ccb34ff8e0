"""What a controller says that it holds (`$G` and `$#` of Grbl), as the state that a program begins in.

Not the asking, and not what a program makes of it. The one rule: what the controller has not told is not known; only
who asks for it (`assume`) gets a shift and a tool length of nothing where nobody has told any.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import nan
from typing import Any

from gcode.interpreter import Interpreter, power_on
from gcode.profile import Profile
from gcode.state import State
from gcode.words import Word, parse_block

Offsets = Mapping[str, Mapping[str, float]]
"""In mm by name, G54 to G59.3, G28, G30, G92, TLO, and lower-case axis."""

SYSTEM_NAMES = ("G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3")
_HOMES = {"G28": 28, "G30": 30}

_SKIPPED = frozenset(("stop", "length", "scaling", "path", "override"))
"""Groups whose word alone says nothing here: M0, M2 and M30 are under way, G43.1 has its length in `$#`."""
_NOTHING = frozenset(("F0", "T0"))
"""As good as not said: the controller has no feed, or no tool, since it was switched on."""


@dataclass(frozen=True, slots=True)
class Held:
    """`modal`: the words of the modal groups, as G0, G54, ..., T0, F0, S0; empty: not told.

    `offsets`: None where they were not told. `position`: program coordinates, mm by lower-case axis.
    """

    modal: tuple[str, ...] = ()
    offsets: Offsets | None = None
    position: Mapping[str, float] = field(default_factory=dict)

    def to_json(self) -> dict[str, Any]:
        """For the history of a job."""
        offsets = None if self.offsets is None else {name: dict(at) for name, at in self.offsets.items()}
        return {"modal": list(self.modal), "offsets": offsets, "position": dict(self.position)}

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> "Held":
        """What `to_json` has made."""
        return cls(tuple(data["modal"]), data["offsets"], data["position"])

    def again(self, now: "Held") -> "Held":
        """This beginning once more, on a controller that holds `now`: its systems are those of now, for they may have
        been set anew since; modes, shift and tool length, which a reset forgets, and the homes are those of then."""
        if self.offsets is None or now.offsets is None:
            return self
        systems = {name: at for name, at in now.offsets.items() if name in SYSTEM_NAMES}
        return Held(self.modal, {**self.offsets, **systems}, self.position)


def state_of(held: Held, profile: Profile, *, assume: bool = False) -> State:
    """The state of a controller that holds this, standing where it stands. `assume`: see the head of this file."""
    state = power_on(profile)
    if held.modal or held.offsets is not None:
        _offsets_into(state, held.offsets, known=assume)
        _modes_into(state, held.modal, profile)
    state.refresh_frame()
    state.locate(dict(held.position))
    return state


def _offsets_into(state: State, offsets: Offsets | None, *, known: bool) -> None:
    """A shift that nobody has told is in force with a length that nobody knows."""
    nothing = [0.0 if known else nan] * len(state.axes)
    if offsets is None:
        state.shift, state.shift_active, state.tool_offset = nothing, not known, list(nothing)
        return
    for number, name in enumerate(SYSTEM_NAMES, 1):
        if name in offsets:
            state.systems[number] = _row(state, offsets[name], nan)
    for name, number in _HOMES.items():
        if name in offsets:
            state.homes[number] = _row(state, offsets[name], nan)
    state.shift = _row(state, offsets.get("G92", {}), 0.0)
    state.shift_active = any(state.shift)
    state.tool_offset = _row(state, offsets.get("TLO", {}), 0.0)


def _row(state: State, at: Mapping[str, float], untold: float) -> list[float]:
    """A profile has more axes than most machines: those that are not told of have no place."""
    return [at.get(axis.lower(), untold) for axis in state.axes]


def _modes_into(state: State, words: tuple[str, ...], profile: Profile) -> None:
    """Each word by itself, as if it had been sent; a motion mode only as the mode that it is."""
    interpreter = Interpreter(profile, state)
    for text in words:
        block = parse_block(text)
        if block.faults or len(block.words) != 1:
            continue
        (word,) = block.words
        if word.letter in "GM":
            _code_into(interpreter, word, profile)
        elif f"{word.letter}{word.value:g}" not in _NOTHING:
            interpreter.step(0, block)
    interpreter.take()


def _code_into(interpreter: Interpreter, word: Word, profile: Profile) -> None:
    code = profile.codes.get(word.code)
    if code is None or code.group in _SKIPPED:
        return
    if code.group == "motion":
        interpreter.state.motion, interpreter.state.motion_name = code.effect, code.name
    else:
        interpreter.step(0, parse_block(word.code))
