"""Taking a program up at a line on a controller that has forgotten its modes: the plan, and the lines that run it.

Not how the plan is made (gcode/resume.py) and not ElVinto's way, which goes on from where the machine stands
(restart.py). The one rule: plan and rest are one stream of lines; until the plan is done, the line is not.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain, islice
from math import isnan

from gcode.check.words import judge
from gcode.clean import clean
from gcode.entry import AHEAD_BLOCKS
from gcode.held import SYSTEM_NAMES, Held, state_of
from gcode.interpreter import Interpreter
from gcode.offsets import adrift
from gcode.profile import Profile
from gcode.resume import CannotResumeError, Past, Reentry, Step, Way, past_of, plan_reentry
from gcode.state import State
from gcode.words import Block, decode_line, parse_block
from jobs.restart import CannotStartError, Lines

PIECE_LINES = 20_000
"""Lines that are followed at once."""
MAX_BLOCKS = 200
"""Of a plan that somebody has edited; ours have some twenty."""

MODES = (
    *("absolute", "arc_absolute", "inches", "plane", "feed_mode", "motion_name", "spindle", "mist", "flood", "system"),
    *("return_to_r", "diameter_mode"),
)
"""Of a State: what a controller tells of itself and a reset makes forget. Feed, speed and offsets beside them."""
FEED_ROUNDING = 2.54
"""mm/min: `$G` says F in whole mm/min, or in tenths of inches/min."""
SPEED_ROUNDING = 1.0
"""rpm, likewise."""
OFFSET_ROUNDING = 0.002
"""mm: three decimals for each of what makes an offset."""
SAME_MM = 0.0015
"""Of an offset that is told with three decimals."""

SHIFT_ASSUMED = (
    "Whether a shift (G92) or a tool length was in force when the job began was not told: none is assumed. "
    "Compare the coordinates with the workpiece."
)
MODES_ASSUMED = (
    "In which modes the job began is not known: those of a controller that was just switched on are assumed."
)


@dataclass(frozen=True, slots=True)
class Course:
    """A program as one has it, each time from the file: the lines before, and the rest from `line` on. `encoding` is
    that of its comments."""

    before: Callable[[], Lines]
    rest: Callable[[], Lines]
    line: int
    profile: Profile
    encoding: str


def plan_at(course: Course, way: Way, *, began: Held | None, now: Held) -> Reentry:
    """The plan. `began`: what the controller held, and where it stood, before the first line.

    Raises CannotStartError with one of gcode.reentry.REASONS.
    """
    profile = course.profile
    past = _past(course, began, now, laser=way.laser)
    rest = (parse_block(decode_line(raw, course.encoding)) for _, raw in islice(course.rest(), AHEAD_BLOCKS))
    position = _place_in(past.state, now, profile) if now.offsets is not None else None
    try:
        plan = plan_reentry(past, rest, profile, way, position=position)
    except CannotResumeError as error:
        raise CannotStartError(str(error), reason=error.reason) from error
    return replace(plan, steps=_heard(plan.steps, now), warnings=(*_doubts(past, began, now), *plan.warnings))


def has_kept_its_modes(course: Course, *, began: Held | None, now: Held, laser: bool) -> bool:
    """Whether the controller holds now what the lines before have set: evidence that it was not reset since."""
    if began is None or not now.modal or now.offsets is None:
        return False
    profile = course.profile
    then, here = _past(course, began, now, laser=laser).state, state_of(now, profile, assume=True)
    numbers = [
        (then.feed or 0.0, here.feed or 0.0, FEED_ROUNDING),
        (then.speed, here.speed, SPEED_ROUNDING),
        *((one, other, OFFSET_ROUNDING) for one, other in zip(then.frame, here.frame, strict=True)),
    ]
    alike = all(getattr(then, name) == getattr(here, name) for name in MODES)
    return alike and all(abs(one - other) <= tolerance for one, other, tolerance in numbers)


def _past(course: Course, began: Held | None, now: Held, *, laser: bool) -> Past:
    """The systems of now, for they may have been set anew since. But where the lines before set them (G10), those of
    then: what a coordinate meant hangs on what was in force when it was said."""

    def follow(start: Held) -> Past:
        pieces, state = _pieces(course.before()), state_of(start, course.profile, assume=True)
        return past_of(pieces, course.line, course.profile, state=state, laser=laser, encoding=course.encoding)

    past = follow((began or Held(offsets={})).again(now))
    return follow(began) if began is not None and "data" in past.said else past


def with_plan(line: int, blocks: Sequence[str], takes_over: int, rest: Lines) -> Lines:
    """The plan's blocks and the rest, which begins behind the lines that the plan takes over. All are under `line - 1`,
    for until the last of them is done `line` is not; the last one is under the last line that the plan takes over."""
    numbers = [line - 1] * (len(blocks) - 1) + [line - 1 + takes_over]
    said = ((number, text.encode()) for number, text in zip(numbers, blocks, strict=True))
    return chain(said, rest)


def check_blocks(blocks: Sequence[str], profile: Profile, now: Held) -> None:
    """Raises CannotStartError for a plan, edited by somebody, that this controller would not take block by block."""
    if not 0 < len(blocks) <= MAX_BLOCKS:
        raise CannotStartError(f"The edited plan has {len(blocks)} blocks; 1 to {MAX_BLOCKS} can be sent.")
    interpreter = Interpreter(profile, state_of(now, profile, assume=True))
    for number, text in enumerate(blocks, 1):
        block = parse_block(text)
        interpreter.step(number, block)
        notes = [note.message for note in interpreter.notes if note.line == number and note.level == "error"]
        for message in (*_faults(block, profile), *notes):
            raise CannotStartError(f"Block {number} of the edited plan, {text!r}: {message}.")


def _faults(block: Block, profile: Profile) -> Iterator[str]:
    yield from (fault.message for fault in block.faults)
    if not block.words:
        yield "there is nothing in it to send"
    if (size := len(clean(block))) > profile.max_block_bytes:
        yield f"it has {size} characters, the machine takes {profile.max_block_bytes}"
    for word in block.words:
        is_code = word.letter in profile.code_letters
        verdict = judge(profile, word.code if is_code else word.letter)
        if verdict is not None and verdict[0] == "error":
            yield verdict[2]
        code = profile.codes.get(word.code) if is_code else None
        if code is not None and code.effect in ("program_end", "subprogram"):
            yield f"{code.name} does not belong into a plan: it would end the job"
        lowest, highest = profile.ranges.get(word.letter, (word.value, word.value))
        if not lowest <= word.value <= highest:
            yield f"{word.letter} is from {lowest:.12g} to {highest:.12g}"


def _pieces(lines: Lines) -> Iterator[bytes]:
    source = iter(lines)
    while taken := [raw for _, raw in islice(source, PIECE_LINES)]:
        yield b"\n".join(taken) + b"\n"


def _heard(steps: tuple[Step, ...], now: Held) -> tuple[Step, ...]:
    """Without modes that this build does not have: grblHAL names G7 or G8 where it is built for a lathe, and refuses
    both elsewhere."""
    if not now.modal or {"G7", "G8"} & set(now.modal):
        return steps
    return tuple(step for step in steps if step.text != "G8")


def _place_in(before: State, now: Held, profile: Profile) -> dict[str, float]:
    """Where the machine stands, in the program coordinates of the state before the line; axes that can be told. The
    system itself is the controller's own: it has kept it, or somebody has set it anew."""
    here, there = state_of(now, profile), before.copy()
    there.systems = here.systems
    there.refresh_frame()
    lost = adrift(there) | adrift(here)
    return {
        axis.lower(): machine - offset
        for row, (axis, machine, offset) in enumerate(zip(here.axes, here.position, there.frame, strict=True))
        if row not in lost and not isnan(machine)
    }


def _doubts(past: Past, began: Held | None, now: Held) -> Iterable[str]:
    """What the plan rests on without proof."""
    if began is None:
        yield MODES_ASSUMED
    elif began.offsets is None:
        yield SHIFT_ASSUMED
    elif now.offsets is not None:
        name = SYSTEM_NAMES[past.state.system - 1]
        axes = past.state.axes.lower()
        then = began.offsets.get(name, {})
        if "data" in past.said:
            then = dict(zip(axes, past.state.systems.get(past.state.system, ()), strict=False))
        here = now.offsets.get(name, {})
        if any(abs(then[axis] - here[axis]) > SAME_MM for axis in here.keys() & then.keys()):
            yield f"{name} is {_shown(here)} now and was {_shown(then)} in the job: its zero was set anew."


def _shown(at: Mapping[str, float]) -> str:
    return " ".join(f"{axis.upper()}{value:g}" for axis, value in at.items())
