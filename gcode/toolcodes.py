"""A controller whose tools somebody else changes: its profile with M6 and M61, which it may not have itself.

Not what is sent in their place (jobs/toolblocks.py). The one rule: both codes travel alone, for what stands behind
them must not be executed before the tool is in.
"""

from dataclasses import replace

from gcode.profile import Code, Profile

COOLANT = frozenset({"mist", "flood", "coolant_off"})
"""What the codes of coolant set in a profile."""


def with_tool_codes(profile: Profile, *, moves: bool) -> Profile:
    """`moves`: the machine goes somewhere else for a change, so that nobody knows where it stands behind it."""
    change = profile.codes.get("M6")
    if change is not None and change.barrier:
        return profile  # the controller takes it, alone, and moves by itself (elvinto §6)
    codes = {
        "M6": Code("M6", effect="tool_change" if moves else "load_tool", group="tool", barrier=True, locate=True),
        "M61": Code("M61", effect="set_tool", group="tool", barrier=True),
    }
    return replace(profile, codes={**profile.codes, **codes}, letters=profile.letters | {"T", "Q"})


def coolant_codes(profile: Profile) -> frozenset[int]:
    """Which of M7, M8 and M9 switch coolant on this controller; on some they are something else."""
    known = {number: profile.codes.get(f"M{number}") for number in (7, 8, 9)}
    return frozenset({number for number, code in known.items() if code is not None and code.sets in COOLANT})


def without_changer(profile: Profile) -> Profile:
    """Nobody changes tools: the check refuses M6, whatever the controller makes of it."""
    return replace(profile, features=profile.features | {"no_tool_changer"})
