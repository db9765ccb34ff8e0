"""Blocks to motion, one after the other, in the order of execution of rs274 §3: the reference interpreter.

What single codes do is in actions.py and motions.py; runs of plain blocks take the way of runs.py, to the same end.
The one rule: a coordinate that is not certain is NaN, never guessed. No block raises, whatever stands in it.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from gcode.actions import ACTIONS, MOTION, ONLY_MODES, SETTING_RANKS, TAKES_AXES, WORDS, apply_setting
from gcode.compensated import refusal
from gcode.cycles import CYCLES
from gcode.executor import MM_PER_INCH, Executor, Note, Work
from gcode.motions import ARCS, move
from gcode.profile import Code, Profile
from gcode.rows import NO_TOOL, Row, Rows
from gcode.segments import FEED, RAPID, Segments
from gcode.state import State
from gcode.words import Block, code_name

MAX_NAMES = 4096
"""Spellings of codes that are remembered: a hostile file could make up ever new ones."""

NO_COMPENSATION = 40
"""G40."""

_STRAIGHT = {"rapid": RAPID, "feed": FEED}
_CUTTING = ARCS | {"feed"}
_NOT_TAKEN = frozenset("NO")
_HARMLESS_GROUPS = frozenset(("spindle", "coolant", "stop", "override", "path", "plasma", "tool", "spindle_mode"))
"""Two of these in one block contradict each other, but lead nowhere else."""

_MODES_OF_MOTION = frozenset(("rapid", "feed", "probe", "thread", "rigid_tap", "not_followed")) | ARCS | CYCLES


def power_on(profile: Profile) -> State:
    """What a controller remembers when it has just been switched on; where it stands, nobody knows."""
    state = State.unknown("".join(profile.axes).upper())
    return replace(state, **profile.initial)


class Interpreter:
    """Follows one program. `state` is always that behind everything executed so far; it is changed in place."""

    def __init__(self, profile: Profile, state: State | None = None, *, laser: bool = False) -> None:
        self._executor = executor = Executor(profile, power_on(profile) if state is None else state)
        self.state: State = executor.state
        self.rows: Rows = executor.rows
        self.notes: list[Note] = executor.notes
        self._profile = profile
        self._laser = laser
        self._axis_rows = executor.axis_rows
        self._codes: dict[str, dict[str, Code | None]] = {letter: {} for letter in profile.code_letters}
        self._tool_at_once = "tool_at_once" in profile.features
        self._cancel_beside = "cancel_with_motion" in profile.features
        self._barriers = profile.barrier_letters - profile.code_letters

    @property
    def compensating(self) -> bool:
        """Whether moves go through the cutter compensation: `state.position` is the programmed one then."""
        return self._executor.compensating

    @property
    def executor(self) -> Executor:
        """For whoever works plain blocks out elsewhere: their moves go through the compensation all the same."""
        return self._executor

    @property
    def held_line(self) -> int | None:
        """The line of the move that waits for the corner behind it: rows of it, and of lines behind it, may follow."""
        return self._executor.held_line

    def take(self) -> Segments:
        """Everything that is certain since the last take."""
        return self.rows.take()

    def finish(self) -> None:
        """The program is over, with or without its end: what compensation holds back is certain now."""
        if self._executor.compensating:
            self._executor.end_compensation(entirely=True)

    def step(self, line: int, block: Block) -> None:
        """Execute one block."""
        words = block.words
        values: dict[str, float] = {}
        codes: list[Code] = []
        lost = False
        tables = self._codes
        for letter, value, text, _ in words:
            table = tables.get(letter)
            if table is None:
                values[letter] = value
                continue
            code = table.get(text)
            if code is None:
                code = self._code(letter, text)
                if code is None:
                    lost = True
                    continue
            codes.append(code)
        if not lost and len(values) + len(codes) == len(words) and self._straight(line, values, codes):
            return
        self._execute(Work(line, block, values, codes), lost=lost)

    def _code(self, letter: str, text: str) -> Code | None:
        table = self._codes[letter]
        if len(table) >= MAX_NAMES:
            table.clear()
        code = table[text] = self._profile.codes.get(code_name(letter, text))
        return code

    # --- the usual block ------------------------------------------------------------------------------------------

    def _straight(self, line: int, values: dict[str, float], codes: list[Code]) -> bool:
        """A straight move in mm and G90 or G91, and nothing else; False, with nothing done, if it is something else."""
        state = self.state
        if codes:
            kind = _STRAIGHT.get(codes[0].effect)
            if kind is None or len(codes) > 1:
                return False
        else:
            kind = _STRAIGHT.get(state.motion or "")
        if kind is None or self._executor.compensating or state.inches or state.feed_mode != 94 or state.diameter_mode:
            return False
        absolute, rows, frame = state.absolute, self._axis_rows, state.frame
        start = state.position
        end = start[:]
        moves = False
        feed = state.feed
        for letter, value in values.items():
            row = rows.get(letter)
            if row is not None:
                moves = True
                if absolute:
                    end[row] = value + frame[row] if frame[row] else value
                elif absolute is None:
                    return False
                else:
                    end[row] += value
            elif letter == "F":
                feed = value
            elif letter != "N":
                return False
        if not moves:
            return False
        state.feed = feed
        if codes:
            self._enter_mode(codes[0])
        sync, state.sync = state.sync, False
        state.position = end
        self.rows.add(
            Row(
                line,
                kind,
                start,
                end,
                _NAN if feed is None else feed,
                state.speed * state.spindle if state.spindle else 0.0,
                NO_TOOL if state.tool is None else state.tool,
                sync,
                self.rows.frame_of(frame),
            )
        )
        return True

    def _enter_mode(self, code: Code) -> None:
        """The motion mode that a code sets. Sticky words hold only while the same cycle does (rs274 §2)."""
        state = self.state
        if state.cycle and code.effect != state.motion:
            level = state.cycle.get("level")
            keeps_level = level is not None and code.effect in CYCLES
            state.cycle = {"level": level} if keeps_level and level is not None else {}
        state.motion, state.motion_name = code.effect, code.name

    # --- any block ------------------------------------------------------------------------------------------------

    def _execute(self, work: Work, *, lost: bool) -> None:
        executor = self._executor
        if self._cancel_beside and len(work.codes) > 1:
            self._drop_cancel(work)
        lost |= self._contradicts(work)
        plan = sorted(((_rank(code), place, code) for place, code in enumerate(work.codes)), key=_by_rank)
        words_done = False
        for rank, _, code in plan:
            if rank >= WORDS and not words_done:
                self._words(work)
                words_done = True
            if rank >= MOTION:
                break
            if not lost or code.effect in ONLY_MODES or code.sets:
                self._apply(work, code)
        if not words_done:
            self._words(work)
        self._motion(work, lost=lost)
        for rank, _, code in plan:
            if rank > MOTION:
                self._apply(work, code)
        if executor.strict and not lost:
            self._left_over(work)

    def _drop_cancel(self, work: Work) -> None:
        """LinuxCNC takes G80 beside another motion code: it ends the cycle, the other one is the mode."""
        modes = [code for code in work.codes if code.group == "motion"]
        if len(modes) > 1:
            for code in modes:
                if code.effect == "cancel":
                    self._enter_mode(code)
            work.codes = [code for code in work.codes if code.effect != "cancel"]

    def _contradicts(self, work: Work) -> bool:
        """Words that contradict each other: whether nobody knows where that leads."""
        codes, executor = work.codes, self._executor
        lost = False
        groups = [code.group for code in codes if code.group]
        for group in {group for group in groups if groups.count(group) > 1} if len(groups) > 1 else ():
            names = " ".join(code.name for code in codes if code.group == group)
            executor.note(work, "group_conflict", f"{names} contradict each other in one block")
            lost |= group not in _HARMLESS_GROUPS
        letters = [word.letter for word in work.block.words if word.letter not in self._codes]
        if len(letters) > len(work.values):
            twice = next(letter for letter in letters if letters.count(letter) > 1)
            executor.note(work, "word_twice", f"{twice} stands twice in one block", twice)
            lost = True
        acting = [code for code in codes if code.barrier and code.effect not in ONLY_MODES and code.effect != "none"]
        return lost or len(acting) > 1

    def _apply(self, work: Work, code: Code) -> None:
        """One code that is no motion mode. `sync`: the queue runs dry, now or before the next motion (gcode §5)."""
        state, executor = self.state, self._executor
        if state.compensation != NO_COMPENSATION and (why := refusal(code, state.plane)) is not None:
            executor.note(work, "compensation", why)
        before = _synced(state) if code.sync == "change" else None
        if code.sync == "always" or code.barrier:
            state.sync = True
        if code.sets:
            apply_setting(executor, work, code)
        if code.effect in ACTIONS:
            ACTIONS[code.effect][1](executor, work, code)
        if before is not None and _synced(state) != before:
            state.sync = True

    def _words(self, work: Work) -> None:
        """F, S and T (rs274 §3)."""
        state, values = self.state, work.values
        if (feed := values.get("F")) is not None:
            if state.feed_mode == 93:
                work.inverse = feed
            else:
                state.feed = feed * MM_PER_INCH if state.inches else feed
        if "S" in values or (self._laser and state.spindle == 1):
            self._speed(work, values.get("S", state.speed))
        if (tool := values.get("T")) is not None:
            state.selected = int(tool)
            if self._tool_at_once:
                state.tool = state.selected
        if not self._barriers.isdisjoint(values):
            state.sync = True

    def _speed(self, work: Work, speed: float) -> None:
        """S. With the spindle on the queue runs dry, but not for the power of a laser that moves (Grbl 1.1)."""
        state = self.state
        changed = speed != state.speed
        state.speed = speed
        if "S" not in self._profile.sync_letters or not state.spindle:
            return
        if not self._laser:
            state.sync |= changed
            return
        now = self._coming_mode(work)
        if self._executor.has_axes(work) and not self._takes_axes(work) and now in _MODES_OF_MOTION:
            return
        leaves = state.spindle == 1 and (state.motion in _CUTTING) != (now in _CUTTING)
        state.sync |= changed or leaves

    def _coming_mode(self, work: Work) -> str | None:
        return next((code.effect for code in work.codes if code.group == "motion"), self.state.motion)

    def _takes_axes(self, work: Work) -> bool:
        return any(code.effect in TAKES_AXES for code in work.codes)

    # --- motion ---------------------------------------------------------------------------------------------------

    def _motion(self, work: Work, *, lost: bool) -> None:
        """The motion of the block, unless another code has taken its axis words."""
        executor, state = self._executor, self.state
        mode: Code | None = None
        for code in work.codes:
            if code.group == "motion":
                mode = code
        if mode is not None:
            self._enter_mode(mode)
        takers = [code for code in work.codes if code.effect in TAKES_AXES]
        has_axes = executor.has_axes(work)
        if takers and executor.strict and (len(takers) > 1 or (mode is not None and mode.effect in _MODES_OF_MOTION)):
            names = " ".join(code.name for code in [*takers, *([mode] if mode else [])])
            executor.note(work, "axis_conflict", f"{names} all want the axis words of the block")
        if lost or self._is_lost(work, takers, has_axes=has_axes):
            self._lose(work, has_axes=has_axes)
            return
        if takers:
            return
        if work.machine:
            self._check_machine(work)
        effect = state.motion or ""
        in_place = effect in ARCS and any(letter in work.values for letter in "IJK")
        if not has_axes and not in_place:
            if mode is not None and mode.effect in CYCLES and executor.strict:
                executor.note(work, "cycle_words", f"{mode.name} without an axis word", level="warning")
            return
        if state.compensation != NO_COMPENSATION and effect in CYCLES:
            executor.note(work, "compensation", "a canned cycle while compensation is on")
        move(executor, work, effect)

    def _is_lost(self, work: Work, takers: list[Code], *, has_axes: bool) -> bool:
        """Axis words beside a code of its own kind that has no use for them (elvinto §6)."""
        if len(takers) > 1:
            return True
        return has_axes and not takers and any(code.effect in _ALONE for code in work.codes)

    def _lose(self, work: Work, *, has_axes: bool) -> None:
        executor = self._executor
        if has_axes:
            work.inverse = None
            executor.emit(work, FEED, [_NAN] * len(self.state.axes))
        executor.lose()

    def _check_machine(self, work: Work) -> None:
        """G53 (rs274 §2): only with G0 and G1; LinuxCNC wants G90 with it, Grbl does not."""
        state, executor = self.state, self._executor
        if state.motion not in _STRAIGHT:
            executor.note(work, "g53_without_g0_g1", "G53 wants G0 or G1")
        elif not executor.has_axes(work):
            executor.note(work, "axis_words_missing", "G53 without an axis word", level="warning")

    def _left_over(self, work: Work) -> None:
        """Words that nothing in the block has used."""
        executor = self._executor
        free = _NOT_TAKEN | {"F", "S", "T"}
        for letter in work.values.keys() - work.used - free:
            if letter in self._profile.letters and not self._takes_word(work, letter):
                executor.note(work, "word_left_over", f"nothing in this block uses {letter}", letter)

    def _takes_word(self, work: Work, letter: str) -> bool:
        """Codes without an effect here may have words of their own: M62-M68, M19, G64, G96."""
        return any(letter in _OWN_WORDS.get(code.name, "") for code in work.codes)


_NAN = float("nan")

_ALONE = frozenset(("zero_all", "zero_z", "turn_a", "unknown"))

_OWN_WORDS: Mapping[str, str] = {
    "G64": "PQ",
    "G96": "DS",
    "M19": "RPQ",
    "M50": "P",
    "M51": "P",
    "M52": "P",
    "M53": "P",
    "M56": "P",
    "M62": "P",
    "M63": "P",
    "M64": "P",
    "M65": "P",
    "M66": "PELQ",
    "M67": "EQ",
    "M68": "EQ",
    "G65": "PLQ",
    "M98": "PL",
    "M99": "P",
    "M6": "D",
    "G51": "P",
}


def _rank(code: Code) -> int:
    if code.group == "motion":
        return MOTION
    if code.effect in ACTIONS:
        return ACTIONS[code.effect][0]
    return SETTING_RANKS.get(code.sets.partition("_")[0], WORDS) if code.sets else WORDS


def _by_rank(entry: tuple[int, int, Code]) -> tuple[int, int]:
    return entry[:2]


def _synced(state: State) -> tuple[Any, ...]:
    """What Grbl compares before it lets the queue run dry: only changes do."""
    return state.spindle, state.mist, state.flood, state.system, state.frame, state.tool_offset
