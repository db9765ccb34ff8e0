"""Blocks to frames, one after the other (ncframe §1, §3). Not the lines of a file and not the bytes of a frame.

The interpreter says where a block leads; here it becomes increments in counts. With compensation "contour" a block
waits until the corner behind it is known, and all behind it wait in their order.
The one rule: after the last frame of every block the increments sent so far add up to the rounded position of the
tool, so that no error ever grows.
"""

from collections import deque
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from math import isnan, nan

from gcode.check.words import judge
from gcode.executor import Note
from gcode.interpreter import Interpreter
from gcode.ncframe.blockwriter import BlockWriter
from gcode.ncframe.frame import BlockLine, Frame, Pending
from gcode.ncframe.rules import FrameRules, profile_for, state_for
from gcode.profile import Code, Profile
from gcode.rows import Row
from gcode.state import State
from gcode.words import Block, Word

MAX_WAITING = 2000
"""Most blocks that wait for a corner; twice of what compensation itself holds back."""

MAX_VERDICTS = 4096
"""Words are judged once; a hostile file could make up ever new ones."""

_OFF = 40


@dataclass(slots=True)
class _Words:
    """What a block says, by kind."""

    codes: list[Code] = field(default_factory=list)
    values: dict[str, float] = field(default_factory=dict)

    def has(self, effect: str) -> bool:
        return any(code.effect == effect for code in self.codes)


class Translator:
    """One program. `errors` is what was found so far; nothing may be sent of a program that has any.

    `position` is where the machine stands, in mm from the host's zero, X a diameter where the program has diameters;
    the host keeps the account from there on, whatever G92 and G54 make of its coordinates. An axis that is absent has
    to be named by G92 (or moved in steps only) before the program can use it.
    """

    def __init__(self, profile: Profile, rules: FrameRules, position: Mapping[str, float] | None = None) -> None:
        self.profile = profile_for(profile, rules)
        self.errors: list[Note] = []
        self._rules = rules
        self._scale = {axis: 2.0 if axis == "x" and rules.diameter_programming else 1.0 for axis in profile.axes}
        state = state_for(self.profile, self._inward(position or {}))
        self._unlocated = {row for row, value in enumerate(state.position) if isnan(value)}
        self._unset = set(self._unlocated)
        state.position = [0.0 if isnan(value) else value for value in state.position]
        self.interpreter = Interpreter(self.profile, state)
        self._writer = BlockWriter(rules, self.interpreter.state, self.errors)
        self._blocks = 0
        self._waiting: deque[Pending] = deque()
        self._by_block: dict[int, Pending] = {}
        self._verdicts: dict[str, str | None] = {}

    @property
    def state(self) -> State:
        """Behind everything that was stepped through; X and Z are the programmed ones while the tool is guided."""
        return self.interpreter.state

    @property
    def settled(self) -> bool:
        """Whether everything that was stepped through has been given out."""
        return not self._waiting and not self.interpreter.compensating

    @property
    def is_plain(self) -> bool:
        """Whether a plain move comes to a frame of its own here and to nothing else: nothing waits, every axis is
        known, no offset is to be taken or left."""
        return not self._unset and self.settled and self._writer.has_its_offset

    @property
    def is_cut(self) -> bool:
        """Whether plain moves are those of a compensated contour: all that waits, waits for their corner."""
        held = self.interpreter.held_line
        cutting = self.interpreter.executor.cutting and isinstance(held, BlockLine)
        return cutting and self._writer.has_its_offset and not self._unset

    @property
    def counts(self) -> list[int]:
        """Where the machine stands, over the axes of the state."""
        return self._writer.counts

    @property
    def added(self) -> tuple[float, ...]:
        """What compensation "offset" adds to each axis now, mm."""
        return self._writer.added

    def leap(self) -> None:
        """The state has gone on through plain moves whose frames nobody wants. They hold their tool."""
        self._writer.stand([at + added for at, added in zip(self.state.position, self.added, strict=True)])
        self._writer.memory.forget(tool=False)

    def leap_along(self, moves: list[Row], line: int, block: Block, fits: Callable[[list[Row]], bool]) -> bool:
        """Plain moves of a compensated contour whose frames nobody wants; the state has gone on through them. `block`,
        in `line`, is the last of them, which waits for the corner behind it. False, with nothing done, where a corner
        is at fault or `fits` says no of what the tool does; of the moves held back before the frames are written."""
        interpreter, executor, known = self.interpreter, self.interpreter.executor, len(self.errors)
        mark = executor.mark()
        here = BlockLine(line, self._blocks + 1)
        executor.guide([*moves[:-1], moves[-1]._replace(line=here)])
        rows = interpreter.rows.drain()
        leapt = [row for row in rows if not isinstance(row.line, BlockLine)]
        words = self._read(line, block)
        if interpreter.notes or interpreter.held_line is not here or words is None or not fits(leapt):
            executor.back(mark)
            del self.errors[known:]
            return False
        self._share_out(rows)
        while self._waiting:
            pending = self._waiting.popleft()
            del self._by_block[pending.line.block]
            self._writer.write(pending)
        if leapt:
            self._writer.stand(list(leapt[-1].end))
        self._writer.memory.forget(tool=False)
        pending = self._wait(here, block, words)
        pending.rows += [row for row in rows if row.line is here]
        self._writer.complete(pending)
        return True

    def _wait(self, here: BlockLine, block: Block, words: "_Words") -> Pending:
        """A block whose frames are still to come."""
        self._blocks = here.block
        pending = self._writer.begin(here, block, words.codes, words.values)
        self._waiting.append(pending)
        self._by_block[here.block] = pending
        return pending

    @property
    def place(self) -> tuple[float, ...]:
        """Where the tool stands after the frames given out, mm from the host's zero, NaN where that is not known."""
        return self._located(self._writer.place)

    def relocate(self, position: Mapping[str, float]) -> None:
        """Where the machine really stands. Only where everything is `settled`."""
        state, position = self.state, self._inward(position)
        for row, axis in enumerate(state.axes.lower()):
            if axis in position:
                self._unlocated.discard(row)
                self._unset.discard(row)
            else:
                self._unlocated.add(row)
                self._unset.add(row)
        # The program's own position is without what "offset" has added.
        self.state.position = [
            position[axis] - added if axis in position else known
            for axis, known, added in zip(state.axes.lower(), state.position, self._writer.added, strict=True)
        ]
        self._writer.stand(
            [position.get(axis, at) for axis, at in zip(state.axes.lower(), self._writer.place, strict=True)]
        )
        self.forget()

    def forget(self) -> None:
        """Somebody else may have been at the machine: modes are sent anew."""
        self._writer.memory.forget()

    def step(self, line: int, block: Block) -> list[Frame]:
        """Take one block; the frames that are certain now. Raises nothing, whatever stands in it."""
        if self._rules.block_delete and block.deleted:
            return []
        if block.faults:
            self.errors += [Note(line, fault.column, fault.code, fault.message) for fault in block.faults[:1]]
            return []
        if not block.words:
            return []
        words = self._read(line, block)
        if words is None:
            return []
        here = BlockLine(line, self._blocks + 1)
        pending = self._wait(here, block, words)
        before = self.state.position
        self._guard(pending, words)
        self.interpreter.step(here, block)
        self._locate(words, before)
        self._writer.complete(pending)
        return self._given_out()

    def finish(self) -> list[Frame]:
        """The program is over."""
        self.interpreter.finish()
        return self._given_out()

    # --- words ----------------------------------------------------------------------------------------------------

    def _read(self, line: int, block: Block) -> _Words | None:
        """The words by kind; None, with an error, where the profile has not all of them."""
        found = _Words()
        for word in block.words:
            message = self._verdict(word)
            if message is not None:
                code = "unknown_code" if word.letter in self.profile.code_letters else "unknown_word"
                self.errors.append(Note(line, word.column, code, message))
                return None
            if word.letter in self.profile.code_letters:
                found.codes.append(self.profile.codes[word.code])
            else:
                found.values[word.letter] = word.value
        return found

    def _verdict(self, word: Word) -> str | None:
        name = word.code if word.letter in self.profile.code_letters else word.letter
        if name not in self._verdicts:
            if len(self._verdicts) >= MAX_VERDICTS:
                self._verdicts.clear()
            verdict = judge(self.profile, name)
            self._verdicts[name] = verdict[2] if verdict is not None and verdict[0] == "error" else None
        return self._verdicts[name]

    def _guard(self, pending: Pending, words: _Words) -> None:
        """What the interpreter lets pass, as it does not know how this machine is made."""
        state = self.state
        tool = words.values.get("T")
        if state.compensation != _OFF and tool is not None and int(tool) != state.selected:
            pending.note("compensation", "T while compensation is on: the tool cannot be changed", "T")
        if words.codes and not words.values.keys().isdisjoint(_TAKERS):
            self._guard_words(pending, words)
        if not self._unset or words.has("set_position"):
            return
        if not words.has("absolute") and (state.absolute is not True or words.has("relative")):
            return
        for row in sorted(self._unset):
            axis = state.axes[row]
            if axis in words.values:
                text = (
                    f"where {axis} stands in these coordinates is not known: G92, or steps ({_STEPS[axis]}), come first"
                )
                pending.note("position_unknown", text, axis)

    def _guard_words(self, pending: Pending, words: _Words) -> None:
        """Other controllers have M codes with words of their own (M62 P, M19 R): no frame can carry these."""
        codes = [code.name for code in words.codes if code.name.startswith("M")]
        taken = {self.state.motion, *(code.effect for code in words.codes), *(code.sets for code in words.codes)}
        for letter in sorted(_TAKERS.keys() & words.values.keys()):
            if codes and taken.isdisjoint(_TAKERS[letter]):
                pending.note("word_left_over", f"{' '.join(codes)} with {letter}: no frame can carry it", letter)

    def _locate(self, words: _Words, before: list[float]) -> None:
        """G92 says where an axis stands; a change to coordinates whose zero nobody has told says that nobody knows."""
        state = self.state
        if self._unset and words.has("set_position"):
            self._unset -= {row for row, axis in enumerate(state.axes) if axis in words.values}
        if any(map(isnan, state.position)):
            self._unset |= {row for row, value in enumerate(state.position) if isnan(value)}
            state.position = [
                known if isnan(value) else value for known, value in zip(before, state.position, strict=True)
            ]

    # --- frames ---------------------------------------------------------------------------------------------------

    def _given_out(self) -> list[Frame]:
        notes = self.interpreter.notes
        if notes:
            self.errors += [note._replace(line=int(note.line)) for note in notes if note.level == "error"]
            notes.clear()
        self._share_out(self.interpreter.rows.drain())
        held = self.interpreter.held_line
        last = held.block if isinstance(held, BlockLine) else self._blocks + 1
        if len(self._waiting) > MAX_WAITING:
            text = f"over {MAX_WAITING} blocks without a motion in the plane while compensation is on"
            self._waiting[-1].note("compensation_still", text)
            last = self._blocks + 1
        frames: list[Frame] = []
        while self._waiting and self._waiting[0].line.block < last:
            pending = self._waiting.popleft()
            del self._by_block[pending.line.block]
            frames += self._writer.write(pending)
        for frame in frames:
            frame.end = self._located(frame.end)
        return frames

    def _share_out(self, rows: Iterable[Row]) -> None:
        for row in rows:
            pending = self._by_block.get(row.line.block) if isinstance(row.line, BlockLine) else None
            if pending is not None:
                pending.rows.append(row)

    def _located(self, place: tuple[float, ...]) -> tuple[float, ...]:
        """As it is told outside."""
        scales = self._scale.values()
        return tuple(
            [
                nan if row in self._unlocated else value * scale
                for row, (value, scale) in enumerate(zip(place, scales, strict=True))
            ]
        )

    def _inward(self, position: Mapping[str, float]) -> dict[str, float]:
        return {axis: value / self._scale[axis] for axis, value in position.items() if axis in self._scale}


_TAKERS = {
    "P": frozenset(("dwell",)),
    "D": frozenset(("compensation_left", "compensation_right")),
    "R": frozenset(("arc_cw", "arc_ccw")),
}
"""What takes a word that is in no frame as such."""

_STEPS = {"X": "U", "Z": "W"}
