"""The `$` lines (grbl II.6): which are allowed when, and what they do.

The one rule: a refusal is raised before anything is done, with the code that Grbl would give.
"""

from collections.abc import Callable, Iterable, Mapping
from typing import Final

from sim.grbl import card, reports
from sim.grbl.core import Core, Flag, State, Task, eeprom
from sim.grbl.errors import Refused
from sim.grbl.execute import gcode, jog
from sim.grbl.gcodewords import read_number
from sim.grbl.hal import extra_lines
from sim.grbl.homing import home
from sim.grbl.service import realtime

_MOVING: Final = (State.RUN, State.HOLD)
_STILL: Final = (State.IDLE, State.ALARM, State.TOOL)


def dollar(core: Core, text: str) -> Task[None]:
    """A line that begins with `$`. Raises Refused."""
    rest = text[1:]
    if core.kind.hal and (lines := extra_lines(core, rest)) is not None:
        _say(core, lines)
    elif core.kind.card is not None and (rest == "F" or rest.startswith("F=")):
        _card(core, core.kind.card, rest)
    elif rest == "":
        core.say(reports.HELP)
    elif rest[0] == "J":
        yield from _jog(core, rest)
    elif rest[0] in "$GCX":
        if len(rest) > 1:
            raise Refused(3)
        _SHORT[rest](core)
    else:
        if core.state not in _STILL:
            raise Refused(8)
        yield from _still(core, rest)


def run_startup(core: Core) -> Task[None]:
    """`>line:ok` for each start-up line: a report, no answer (II.3)."""
    for text in core.memory.startup:
        if not text:
            continue
        try:
            yield from gcode(core, text)
        except Refused as refused:
            core.say(f">{text}:error:{refused.code}")
        else:
            core.say(f">{text}:ok")
        if core.abort:
            return


def _say(core: Core, lines: Iterable[str]) -> None:
    for line in lines:
        core.say(line)


def _card(core: Core, files: Mapping[str, str], rest: str) -> None:
    """The ok of a file that is run comes at once; its lines have none."""
    if rest == "F":
        _say(core, card.listing(files))
        return
    if core.state not in (State.IDLE, State.CHECK):
        raise Refused(8)
    core.file = card.opened(files, rest[2:], core.kind.line_limit)
    if core.file is None:
        raise Refused(card.NOT_FOUND)


def _jog(core: Core, rest: str) -> Task[None]:
    if core.state not in (State.IDLE, State.JOG, State.TOOL):
        raise Refused(8)
    if not rest.startswith("J="):
        raise Refused(3)
    yield from jog(core, rest[2:])


def _settings(core: Core) -> None:
    if core.state in _MOVING:
        raise Refused(8)
    _say(core, reports.settings(core))


def _modes(core: Core) -> None:
    core.say(reports.parser_state(core))


def _check_mode(core: Core) -> None:
    """On: nothing moves any more. Off: a full reset follows the ok (II.3)."""
    if core.state is State.CHECK:
        core.reset()
        core.message("Disabled")
    elif core.state is State.IDLE:
        core.state = State.CHECK
        core.message("Enabled")
    else:
        raise Refused(8)


def _unlock(core: Core) -> None:
    if core.state is State.ALARM:
        if core.door_open:
            raise Refused(13)
        core.message("Caution: Unlocked")
        core.last_alarm = 0
        core.state = State.IDLE


_SHORT: Final[dict[str, Callable[[Core], None]]] = {
    "$": _settings,
    "G": _modes,
    "C": _check_mode,
    "X": _unlock,
}


def _still(core: Core, rest: str) -> Task[None]:
    """Commands for an idle or locked machine."""
    letter = rest[0]
    if letter == "#":
        if len(rest) > 1:
            raise Refused(3)
        _say(core, reports.parameters(core))
    elif letter == "H":
        yield from _home(core, rest[1:])
    elif letter == "S":
        if rest != "SLP":
            raise Refused(3)
        core.flag(Flag.SLEEP)
    elif letter == "I":
        yield from _build_info(core, rest[1:])
    elif letter == "R":
        yield from _restore(core, rest)
    elif letter == "N":
        yield from _startup(core, rest[1:])
    else:
        yield from _store(core, rest)


def _home(core: Core, axis: str) -> Task[None]:
    if not core.memory.on(22):
        raise Refused(5)
    if core.door_open:
        raise Refused(13)
    if axis and not (core.kind.single_axis_homing and axis in ("X", "Y", "Z")):
        raise Refused(3)
    core.state = State.HOMING
    yield from home(core, axis)
    if core.abort:
        return
    core.state = State.IDLE
    if not axis:
        yield from run_startup(core)


def _build_info(core: Core, rest: str) -> Task[None]:
    if not rest:
        _say(core, reports.build(core))
    elif rest[0] != "=":
        raise Refused(3)
    else:
        yield from eeprom(core, core.memory.store_build_info(rest[1:]))


def _restore(core: Core, rest: str) -> Task[None]:
    if len(rest) != 5 or not rest.startswith("RST=") or rest[4] not in "$#*":
        raise Refused(3)
    yield from eeprom(core, core.memory.restore(rest[4]))
    core.message("Restoring defaults")
    core.reset()


def _startup(core: Core, rest: str) -> Task[None]:
    """A new start-up line is executed before it is stored: `$N0=G20` changes the units at once (II.6)."""
    if not rest:
        _say(core, reports.startup(core))
        return
    if core.state is not State.IDLE:
        raise Refused(8)
    number, at = read_number(rest, 0)
    if rest[at : at + 1] != "=":
        raise Refused(3)
    text = rest[at + 1 :]
    yield from gcode(core, text)
    if not core.abort:
        yield from realtime(core)
        yield from eeprom(core, core.memory.store_startup(int(number), text))


def _store(core: Core, rest: str) -> Task[None]:
    number, at = read_number(rest, 0)
    if rest[at : at + 1] != "=":
        raise Refused(3)
    value, end = read_number(rest, at + 1)
    if end != len(rest) or number > 255 + 744 * core.kind.hal:
        raise Refused(3)
    yield from eeprom(core, core.memory.store(int(number), value))
