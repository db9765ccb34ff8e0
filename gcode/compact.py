"""The same motion in fewer bytes, for a wire that is the bottleneck (elvinto §7).

Not the cleaner: comments are gone before. The one rule: never wrong. A word is left out only when this very program
has put the machine into the state that the word asks for, and nothing since can have changed it; after anything
unusual the compactor knows nothing and drops nothing.
"""

from dataclasses import dataclass
from math import nan
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from gcode.blocks import MOTIONS, Blocks, CodeTable, Letter, filled, words_between
from gcode.clean import DROPPED_LETTERS
from gcode.columns import Columns
from gcode.profile import Effect, Profile
from gcode.segments import FEED, RAPID, Bools, Floats, Ints
from gcode.words import Block, Word, code_name, shortest

_STRAIGHT = frozenset(("rapid", "feed"))
_MOTIONS = _STRAIGHT | {"arc_cw", "arc_ccw"}
_DISTANCES = frozenset(("absolute", "relative"))

_FEED_MODES = {
    "inverse_time": False,
    "per_revolution": False,
    "per_minute": True,
    "unknown": False,
    "program_end": True,
}
"""What these effects make of an F: whether it holds for the blocks that follow."""

_KEEPS_DISTANCE = frozenset(get_args(Effect)) - {"restore_distance", "restore_modes", "program_end", "unknown"}


class Compactor:
    """Goes through a program once, block by block, and writes each in its shortest form."""

    __slots__ = ("_absolute", "_axes", "_feed", "_feed_holds", "_mode", "_position", "_profile")

    def __init__(self, profile: Profile) -> None:
        self._profile = profile
        self._axes = frozenset(axis.upper() for axis in profile.axes)
        self._mode: str | None = None
        self._absolute: bool | None = None
        self._feed: float | None = None
        # In G93 and G95 an F belongs to its block (rs274 §2).
        self._feed_holds = True
        # What the program itself has commanded in G90, not where the machine says it is.
        self._position: dict[str, float] = {}

    def forget(self) -> None:
        """Somebody else may have been at the machine: its motion mode, feed and position are not known any more.

        G90 or G91 stays: the program relies on it itself, in words that no compactor drops.
        """
        self._mode = None
        self._feed = None
        self._position = {}

    def compact(self, block: Block) -> str:
        """The wire text of `block`; empty when it has nothing to send."""
        dropped = self._dropped(block.words) | DROPPED_LETTERS
        kept = [word.letter + shortest(word.text) for word in block.words if word.letter not in dropped]
        if not kept:
            # A block that changes nothing stays a block: whoever counts blocks must find it again.
            kept = [word.letter + shortest(word.text) for word in block.words if word.letter not in DROPPED_LETTERS]
        return "".join(kept)

    def _dropped(self, words: tuple[Word, ...]) -> set[str]:
        """The letters that change nothing. `G` stands for the block's only G word. Follows the state on the way."""
        code_letters, codes = self._profile.code_letters, self._profile.codes
        values: dict[str, float] = {}
        effects: list[str] = []
        g_words = 0
        usual = True
        for letter, value, text, _ in words:
            if letter not in code_letters:
                if letter in DROPPED_LETTERS:
                    continue
                usual = usual and letter not in values
                values[letter] = value
                continue
            g_words += letter == "G"
            code = codes.get(code_name(letter, text))
            usual = usual and code is not None and not code.barrier
            if code is None or code.effect != "none":
                effects.append(code.effect if code else "unknown")
        modes = self._modes(effects) if effects else effects
        if not usual or len(modes) > 1 or not _MOTIONS.issuperset(modes):
            self.forget()
            return set()
        same_mode = bool(modes) and modes[0] == self._mode
        self._mode = modes[0] if modes else self._mode
        dropped = self._dropped_axes(values)
        # Without axis words it would be a guess that the controller still takes the rest as a motion.
        if same_mode and g_words == 1 and not self._axes.isdisjoint(values):
            dropped.add("G")
        if (feed := values.get("F")) is not None:
            if feed == self._feed and self._feed_holds:
                dropped.add("F")
            self._feed = feed
        return dropped

    def _modes(self, effects: list[str]) -> list[str]:
        """The effects without those of the distance mode, which are taken note of here, even in unusual blocks."""
        distances = [effect for effect in effects if effect in _DISTANCES]
        for effect in effects:
            self._feed_holds = _FEED_MODES.get(effect, self._feed_holds)
        if len(distances) > 1 or not _KEEPS_DISTANCE.issuperset(effects):
            self._absolute = None
        elif distances:
            self._absolute = distances[0] == "absolute"
        return [effect for effect in effects if effect not in _DISTANCES]

    def _dropped_axes(self, values: dict[str, float]) -> set[str]:
        targets = {letter: value for letter, value in values.items() if letter in self._axes}
        position = self._position
        if self._mode not in _STRAIGHT or not self._absolute:
            # Where an arc ends is the machine's own arithmetic; where a relative move ends, is not said.
            for letter in targets if self._mode in _STRAIGHT else tuple(position):
                position.pop(letter, None)
            return set()
        unchanged = {letter for letter, value in targets.items() if position.get(letter) == value}
        if len(unchanged) == len(targets):
            # One axis word remains, or the block would not be a motion any more.
            unchanged.discard(next(iter(targets), ""))
        position.update(targets)
        return unchanged

    # --- many rows at once ---------------------------------------------------------------------------------------

    def kept(self, columns: Columns, blocks: Blocks, table: CodeTable, begin: int, end: int) -> Bools:
        """Which words of the rows [begin, end) stay: what `compact` says row by row, for a run of plain rows.

        Plain as in gcode.blocks, and their modal codes change nothing. Where this program has not said G90 or G91
        yet, a row that says it ends such a run: see `first_distance`.
        """
        words = words_between(columns, begin, end)
        rows: Ints = columns.row[words].astype(np.int64) - begin
        letters = columns.letter[words]
        run = _Run.of(blocks, begin, end, self._axes)
        before, mode = self._modes_of(run)
        dropped: dict[str, Bools] = {}
        one_g = np.bincount(rows[letters == ord("G")], minlength=run.count) == 1
        dropped["G"] = one_g & (run.motion > 0) & (before == mode) & run.has_axes
        dropped["F"] = self._unchanged_feed(run)
        unchanged = self._unchanged_axes(run, (mode == RAPID + 1) | (mode == FEED + 1))
        goes = _words_of(dropped | unchanged, rows, letters)
        _keep_one_axis(run, unchanged, rows, letters, goes)
        stays = ~table.is_dropped[letters]
        kept: Bools = stays & ~goes
        if not run.has_axes.all():
            # A block that changes nothing stays a block.
            nothing = np.bincount(rows[kept], minlength=run.count) == 0
            kept |= stays & nothing[rows]
        return kept

    def first_distance(self, blocks: Blocks, table: CodeTable, begin: int, end: int) -> int:
        """The first row that `kept` must leave to `compact`: it says G90 or G91, and none has before."""
        if self._absolute is not None:
            return end
        for number, rows in blocks.settings.items():
            if table.codes[number].effect in _DISTANCES:
                at = int(np.searchsorted(rows, begin))
                end = min(end, int(rows[at])) if at < len(rows) else end
        return end

    def _modes_of(self, run: "_Run") -> tuple[Floats, Floats]:
        """The motion mode before and after each row, as in Blocks.motion."""
        initial = 0 if self._mode is None else MOTIONS[self._mode] + 1
        mode = filled(run.motion.astype(np.float64), run.motion > 0, initial)
        self._mode = _EFFECTS.get(int(mode[-1]))
        return np.concatenate(([initial], mode[:-1])), mode

    def _unchanged_feed(self, run: "_Run") -> Bools:
        feed = filled(run.feed.values, run.feed.has, _known(self._feed))
        before = np.concatenate(([_known(self._feed)], feed[:-1]))
        self._feed = None if np.isnan(feed[-1]) else float(feed[-1])
        same: Bools = run.feed.has & (feed == before) & self._feed_holds
        return same

    def _unchanged_axes(self, run: "_Run", straight: Bools) -> dict[str, Bools]:
        """Axis words that name the coordinate which the program itself has commanded last."""
        found: dict[str, Bools] = {}
        place = np.arange(run.count)
        # Where an arc ends is the machine's own arithmetic; nothing from before it is known after it.
        cleared = np.maximum.accumulate(np.where(straight, -1, place))
        cleared_before = np.concatenate(([-1], cleared[:-1]))
        for axis in [axis for axis in self._position if axis not in run.axes]:
            if cleared[-1] >= 0:
                del self._position[axis]
        for axis, words in run.axes.items():
            told = words.has & straight & bool(self._absolute)
            index = np.maximum.accumulate(np.where(told, place, -1))
            before = np.concatenate(([-1], index[:-1]))
            value = np.where(before >= 0, words.values[before], _known(self._position.get(axis)))
            found[axis] = told & (before >= cleared_before) & (value == words.values)
            if index[-1] > cleared[-1]:
                self._position[axis] = float(words.values[index[-1]])
            elif cleared[-1] >= 0 or (not self._absolute and words.has.any()):
                self._position.pop(axis, None)
        return found


@dataclass(frozen=True, slots=True)
class _Run:
    """The letters of a run of rows that compaction looks at."""

    count: int
    motion: NDArray[np.uint8]
    feed: Letter
    axes: dict[str, Letter]
    has_axes: Bools

    @classmethod
    def of(cls, blocks: Blocks, begin: int, end: int, letters: frozenset[str]) -> "_Run":
        axes = {letter: blocks.part(letter, begin, end) for letter in blocks.letters if letter in letters}
        has_axes = np.zeros(end - begin, np.bool_)
        for words in axes.values():
            has_axes |= words.has
        return cls(end - begin, blocks.motion[begin:end], blocks.part("F", begin, end), axes, has_axes)


def _words_of(letters_of_rows: dict[str, Bools], rows: Ints, letters: NDArray[np.uint8]) -> Bools:
    """The words of these letters in these rows: each letter is a bit."""
    bits = np.zeros(len(next(iter(letters_of_rows.values()))), np.uint16)
    bit_of = np.zeros(128, np.uint16)
    for number, (letter, where) in enumerate(letters_of_rows.items()):
        bit_of[ord(letter)] = 1 << number
        bits |= where * bit_of[ord(letter)]
    found: Bools = (bits[rows] & bit_of[letters]) != 0
    return found


def _keep_one_axis(run: _Run, unchanged: dict[str, Bools], rows: Ints, letters: NDArray[np.uint8], goes: Bools) -> None:
    """One axis word remains of a row whose axis words all go, the first: else it would not be a motion any more."""
    left = np.zeros(run.count, np.int8)
    for axis, words in run.axes.items():
        left += words.has & ~unchanged[axis]
    bare = run.has_axes & (left == 0)
    if not bare.any():
        return
    codes = np.array([ord(axis) for axis in run.axes], np.uint8)
    axes = np.flatnonzero(np.isin(letters, codes) & bare[rows])
    first = np.concatenate(([True], rows[axes][1:] != rows[axes][:-1]))
    goes[axes[first]] = False


def _known(value: float | None) -> float:
    return nan if value is None else value


_EFFECTS = {kind + 1: effect for effect, kind in MOTIONS.items()}
