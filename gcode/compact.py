"""The same motion in fewer bytes, for a wire that is the bottleneck (elvinto §7).

Not the cleaner: comments are gone before. The one rule: never wrong. A word is left out only when this very program
has put the machine into the state that the word asks for, and nothing since can have changed it; after anything
unusual the compactor knows nothing and drops nothing.
"""

from typing import get_args

from gcode.clean import DROPPED_LETTERS
from gcode.profile import Effect, Profile
from gcode.words import Block, Word, code_name, shortest

_STRAIGHT = frozenset(("rapid", "feed"))
_MOTIONS = _STRAIGHT | {"arc_cw", "arc_ccw"}
_DISTANCES = frozenset(("absolute", "relative"))
_AXIS_LETTERS = frozenset("XYZABC")

_KEEPS_DISTANCE = frozenset(get_args(Effect)) - {"restore_distance", "program_end", "unknown"}


class Compactor:
    """Goes through a program once, block by block, and writes each in its shortest form."""

    __slots__ = ("_absolute", "_feed", "_mode", "_position", "_profile")

    def __init__(self, profile: Profile) -> None:
        self._profile = profile
        self._mode: str | None = None
        self._absolute: bool | None = None
        self._feed: float | None = None
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
        if same_mode and g_words == 1 and not _AXIS_LETTERS.isdisjoint(values):
            dropped.add("G")
        if (feed := values.get("F")) is not None:
            if feed == self._feed:
                dropped.add("F")
            self._feed = feed
        return dropped

    def _modes(self, effects: list[str]) -> list[str]:
        """The effects without those of the distance mode, which are taken note of here, even in unusual blocks."""
        distances = [effect for effect in effects if effect in _DISTANCES]
        if len(distances) > 1 or not _KEEPS_DISTANCE.issuperset(effects):
            self._absolute = None
        elif distances:
            self._absolute = distances[0] == "absolute"
        return [effect for effect in effects if effect not in _DISTANCES]

    def _dropped_axes(self, values: dict[str, float]) -> set[str]:
        targets = {letter: value for letter, value in values.items() if letter in _AXIS_LETTERS}
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
