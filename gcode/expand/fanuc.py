"""Macro statements of Fanuc and the calls M98, M99, G65. Not the O-words of LinuxCNC.

The one rule: a target that is not there, or there twice, is an error at the call; nothing is searched elsewhere.
"""

from collections.abc import Callable, Mapping

from gcode.expand.arithmetic import integer
from gcode.expand.errors import RefusalError
from gcode.expand.reading import Source
from gcode.expand.run import Frame, Run
from gcode.expand.statements import Jump, Loop, LoopEnd
from gcode.expand.structure import Place

MACRO_ARGUMENTS: Mapping[str, int] = {
    "A": 1,
    "B": 2,
    "C": 3,
    "I": 4,
    "J": 5,
    "K": 6,
    "D": 7,
    "E": 8,
    "F": 9,
    "H": 11,
    "M": 13,
    "Q": 17,
    "R": 18,
    "S": 19,
    "T": 20,
    "U": 21,
    "V": 22,
    "W": 23,
    "X": 24,
    "Y": 25,
    "Z": 26,
}
"""G65: which local parameter a letter sets (argument specification I)."""

PROGRAM_DIGITS = 10_000
"""`M98 P31234`: the last four digits name the program, those before them say how often."""

ALARM, STOP = 3000, 3006
"""`#3000 = n (text)` ends the program with an alarm, `#3006 = n (text)` stops it with a message."""


def execute_loop(run: Run, source: Source, loop: Loop, place: Place) -> None:
    """`WHILE [...] DO n`. `run.place` stands behind it. Raises ExpandError or RefusalError."""
    link = run.structure.loops.get(place)
    if link is None:
        raise source.error(loop.at, "not_nested", f"DO{loop.number} does not belong to any END{loop.number}")
    if loop.condition is not None and not loop.condition(run.parameters):
        line, index = link.end
        run.jump((line, index + 1))


def execute_end(run: Run, source: Source, end: LoopEnd, place: Place) -> None:
    """`END n`: back to the condition. Raises ExpandError or RefusalError."""
    link = run.structure.loops.get(place)
    if link is None:
        raise source.error(end.at, "not_nested", f"END{end.number} closes no DO{end.number} here")
    run.jump(link.start)


def execute_jump(run: Run, source: Source, jump: Jump, place: Place) -> None:
    """`GOTO n` and `IF [...] GOTO n`. Raises ExpandError or RefusalError."""
    if jump.condition is not None and not jump.condition(run.parameters):
        return
    value = jump.target(run.parameters)
    number = run.located(source, jump.at, lambda: integer(value, "the number behind GOTO"))
    run.located(source, jump.at, lambda: go_to(run, number, place))


def go_to(run: Run, number: int, origin: Place) -> None:
    """To the line with N`number` in the program that `origin` is in. Raises RefusalError."""
    section = run.structure.section_of(origin[0])
    lines = run.structure.numbers.get((section, str(number)), [])
    if not lines:
        raise RefusalError("goto_target", f"there is no line N{number} in this program")
    if len(lines) > 1:
        raise RefusalError("goto_target", f"N{number} stands on lines {lines[0]} and {lines[1]}: it must be unique")
    target = (lines[0], 0)
    around = {loop.start for loop in run.structure.loops_around(origin)}
    if any(loop.start not in around and loop.start < target for loop in run.structure.loops_around(target)):
        raise RefusalError("goto_target", f"N{number} is inside a loop: GOTO may leave loops, not enter them")
    run.jump(target)


def call_program(run: Run, program: float | None, repeats: float | None, place: Place) -> None:
    """M98 at `place`. `run.place` stands behind it. Raises RefusalError."""
    start, turns = _find(run, "M98", program, repeats, packed=True)
    run.call(Frame("m98", place, run.place, start, turns))


def call_macro(
    run: Run, program: float | None, repeats: float | None, arguments: Mapping[int, float], place: Place
) -> None:
    """G65 at `place`. Raises RefusalError."""
    start, turns = _find(run, "G65", program, repeats, packed=False)
    run.call(Frame("g65", place, run.place, start, turns, arguments))
    run.parameters.push(arguments)


def end_program(run: Run, target: float | None, origin: Place) -> None:
    """M99: the next turn of the subprogram, or back to the caller, there to N`target`. Raises RefusalError."""
    frame = run.frame
    if frame.kind == "sub":
        raise RefusalError("not_nested", "M99 in a sub that was called as an O-word: end it with endsub")
    if frame.kind == "main":
        if target is None:
            raise RefusalError("endless", "M99 repeats the main program for ever: end it with M30 to run it once")
        go_to(run, integer(target, "the number behind M99 P"), origin)
        return
    frame.turns -= 1
    if frame.turns > 0 and target is None:
        run.jump(frame.start)
        if frame.kind == "g65":
            # Every turn is a call of its own.
            run.parameters.pop()
            run.parameters.push(frame.arguments)
        return
    run.leave()
    if frame.kind == "g65":
        run.parameters.pop()
    if target is not None:
        go_to(run, integer(target, "the number behind M99 P"), frame.caller)


def _find(run: Run, code: str, program: float | None, repeats: float | None, *, packed: bool) -> tuple[Place, int]:
    if program is None:
        raise RefusalError("m98_target", f"{code} without P: it does not say which subprogram")
    number = integer(program, f"P of {code}")
    turns = 1 if repeats is None else integer(repeats, f"L of {code}")
    line = run.structure.sections.get(str(number))
    if line is None and packed and repeats is None and number >= PROGRAM_DIGITS:
        turns, number = divmod(number, PROGRAM_DIGITS)
        line = run.structure.sections.get(str(number))
    if line is None and str(number) in run.structure.subs:
        raise RefusalError("m98_target", f"{code}: O{number} is a sub, call it with o{number} call")
    if line is None:
        raise RefusalError("m98_target", f"{code}: subprogram O{number} is not in this file: append it behind M30")
    if turns < 1:
        raise RefusalError("m98_target", f"{code}: L says how often, from 1 on, not {turns}")
    return (line, 0), turns


def arguments_of(words: list[tuple[str, float]], refuse: Callable[[str], Exception]) -> dict[int, float]:
    """The local parameters that the words behind G65 set. `refuse` makes the exception for a letter."""
    arguments: dict[int, float] = {}
    for letter, value in words:
        index = MACRO_ARGUMENTS.get(letter)
        if index is None or index in arguments:
            raise refuse(letter)
        arguments[index] = value
    return arguments
