"""Words of a block to the text that goes out: no comments, no `%`, no N and O words, no blanks (elvinto §7).

Not compaction: every other word is kept, its number as it was written. The one rule: the text is ASCII words and
nothing else, so that no comment can press a machine's real-time keys.
"""

from gcode.words import Block

DROPPED_LETTERS = frozenset("NO")
"""Line and program numbers: for people, no controller needs them."""


def clean(block: Block, *, block_delete: bool = False) -> str:
    """The wire text of `block`; empty when nothing is to be sent. With `block_delete` the `/` lines are left out."""
    if block_delete and block.deleted:
        return ""
    return "".join([word.letter + word.text for word in block.words if word.letter not in DROPPED_LETTERS])
