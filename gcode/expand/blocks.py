"""Words and settings of one block to a plain line. Not the statements of flow around them.

The one rule: the numbers of the line are those that stand there before its settings take effect (rs274 §1: in
`#3=6 G1X#3` X is the old #3).
"""

from dataclasses import dataclass

from gcode.expand.errors import ExpandError
from gcode.expand.fanuc import ALARM, STOP, arguments_of, call_macro, call_program, end_program
from gcode.expand.messages import is_active, needs_values, shown
from gcode.expand.reading import Source
from gcode.expand.run import Run
from gcode.expand.statements import Part, Setting, Words
from gcode.expand.structure import Place
from gcode.words import MAX_NUMBER

DECIMALS = 9
"""Numbers are written to a nanometre of a millimetre: within 1e-9 of what was computed."""

_ENDS = (2.0, 30.0)


@dataclass(frozen=True, slots=True)
class Expanded:
    """A plain line and the line of the source that it came from, from 1. `text` reads without faults."""

    line: int
    text: str


@dataclass(frozen=True, slots=True)
class _Word:
    letter: str
    text: str
    value: float
    at: int


def written_out(value: float) -> str:
    """A number in plain digits, at most nine decimals, no exponent, no zeros that say nothing."""
    text = f"{value:.{DECIMALS}f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


def remarks(run: Run, source: Source) -> Expanded | None:
    """A line with nothing but comments. `%` marks the ends of a tape and goes."""
    if source.remark:
        text = source.text.strip()
        return None if text.startswith("%") else Expanded(source.line, text)
    text = " ".join(shown(source.comments, run.parameters, run.structure.dialect))
    return Expanded(source.line, text) if text else None


def execute_words(run: Run, source: Source, words: Words, place: Place) -> Expanded | None:
    """Carry out the words and settings of a block. Raises ExpandError or RefusalError."""
    computed = [word for part in words.parts if (word := _computed(run, source, part)) is not None]
    stopped = _set(run, source, words.settings)
    left = _calls(run, source, computed, place)
    if words.as_written and len(left) == len(words.parts) and not needs_values(source.comments):
        return Expanded(source.line, source.text.strip())
    if any(word.letter != "N" for word in left):
        return _line(run, source, left)
    return stopped or _message(run, source)


def execute_setting(run: Run, source: Source, setting: Setting) -> Expanded | None:
    """Carry out `IF [...] THEN #1 = 2` when its condition holds. Raises ExpandError or RefusalError."""
    return _set(run, source, (setting,))


def _computed(run: Run, source: Source, part: Part) -> _Word | None:
    if part.value is None:
        return _Word(part.letter, part.text, float(part.text), part.at)
    value = part.value(run.parameters)
    if value is None:
        # Fanuc: a word whose parameter is empty is not there.
        return None
    if abs(value) >= MAX_NUMBER:
        raise source.error(part.at, "bad_number", f"the number of {part.letter} is too large: {value:g}")
    return _Word(part.letter, text := written_out(value), float(text), part.at)


def _set(run: Run, source: Source, settings: tuple[Setting, ...]) -> Expanded | None:
    """All sides first, then all settings in order: of several for one parameter the last one counts (rs274 §1).

    Gives the line that Fanuc's `#3006 = n (text)` stands for; `#3000 = n (text)` is an ExpandError.
    """
    known = [(setting, run.target(source, setting.target), setting.value(run.parameters)) for setting in settings]
    stopped = None
    for setting, target, value in known:
        text = " ".join(source.comments)
        if run.structure.dialect != "fanuc" or target not in (ALARM, STOP):
            run.set(source, setting, target, value)
        elif target == ALARM:
            raise source.error(
                setting.target.at, "alarm", f"the program ends itself here with an alarm {text}".rstrip()
            )
        else:
            stopped = Expanded(source.line, f"M0 {text}".rstrip())
    return stopped


def _calls(run: Run, source: Source, words: list[_Word], place: Place) -> list[_Word]:
    """Carry out M98, M99, G65 and the end of the program; gives the words that are left for the line."""
    codes = {(word.letter, word.value): word for word in words if word.letter in "GM"}
    if run.structure.dialect == "fanuc":
        if macro := codes.get(("G", 65.0)):
            run.located(source, macro.at, lambda: _macro(run, source, words, place))
            return []
        if modal := codes.get(("G", 66.0)) or codes.get(("G", 66.1)):
            raise source.error(modal.at, "unsupported", "G66 is not expanded: write G65 on every line that calls")
    if call := codes.get(("M", 98.0)):
        run.located(source, call.at, lambda: call_program(run, _value(words, "P"), _value(words, "L"), place))
        return [word for word in words if word is not call and word.letter not in "PL"]
    if end := codes.get(("M", 99.0)):
        run.located(source, end.at, lambda: end_program(run, _value(words, "P"), place))
        return [word for word in words if word is not end and word.letter != "P"]
    run.ended = any(("M", value) in codes for value in _ENDS)
    return words


def _macro(run: Run, source: Source, words: list[_Word], place: Place) -> None:
    own = [word for word in words if word.letter in "PLN" or (word.letter, word.value) == ("G", 65.0)]
    others = [(word.letter, word.value) for word in words if word not in own]

    def refuse(letter: str) -> ExpandError:
        at = [word.at for word in words if word.letter == letter][-1]
        return source.error(at, "macro_arguments", f"G65 cannot hand over {letter}: each letter once, no G, L, N, O, P")

    call_macro(run, _value(words, "P"), _value(words, "L"), arguments_of(others, refuse), place)


def _value(words: list[_Word], letter: str) -> float | None:
    return next((word.value for word in words if word.letter == letter), None)


def _message(run: Run, source: Source) -> Expanded | None:
    """Of a line without words only what the control would show: its last comment, if that is active."""
    last = source.comments[-1:]
    if not last or not is_active(last[0]):
        return None
    text = shown(last, run.parameters, run.structure.dialect)
    return Expanded(source.line, text[0]) if text else None


def _line(run: Run, source: Source, words: list[_Word]) -> Expanded:
    pieces = [word.letter + word.text for word in words]
    pieces += shown(source.comments, run.parameters, run.structure.dialect)
    return Expanded(source.line, ("/" if source.deleted else "") + " ".join(pieces))
