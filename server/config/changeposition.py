"""Whether a machine can take the blocks of `change_position`: before the first job needs them, with a person inside.

Not when they go out (jobs/toolblocks.py). The one rule: what cannot be sent, leaves the travel, or changes more than
where the machine stands and the modes that are restored behind a change is refused with the block that does it.
"""

from collections.abc import Sequence

from gcode.check import check_program
from gcode.motion import Motion
from gcode.profile import Profile
from gcode.words import parse_block
from jobs.toolblocks import NEUTRAL

ALLOWED = frozenset(
    {
        *("G0", "G1", "G4", "G28", "G30", "G53", "G80", "G90", "G91", "G94", "M5", "M9"),
        *("G17", "G18", "G19", "G20", "G21", "G54", "G55", "G56", "G57", "G58", "G59"),
    }
)
"""Ways to get there, and the modes of docs/toolchanger.md: no others are restored behind it."""


def fault_of(blocks: Sequence[str], profile: Profile, motion: Motion) -> tuple[str, str] | None:
    """The first block that is not for this machine, and why; None: they can go out."""
    for text in blocks:
        for word in parse_block(text).words:
            if word.letter in profile.code_letters and word.code not in ALLOWED:
                return text, f"a way to where tools are changed, without {word.code}"
    report = check_program([block.encode() for block in (NEUTRAL, *blocks)], profile, motion)
    outside = [finding for finding in report.warnings if finding.code == "outside_travel_machine"]
    for finding in sorted([*report.errors, *outside], key=lambda one: one.line):
        if finding.line > 1:
            return blocks[finding.line - 2], f"what this machine can do: {finding.message}"
    return None
