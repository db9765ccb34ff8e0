"""The rows of the changer's table (harness/changerrows.py) against LinuxCNC's own I/O control: where the page and the
program agree, the very sequences of the program. Skipped where LinuxCNC is not installed.

Where they differ the page was followed; what the program does instead is below and in docs/toolchanger.md, so that both
sides are known to be as they are said to be. The one rule: a difference is written down as a change of the row's own
sequence, never as a row that is not looked at.
"""

import pytest

from tests.harness.changerrows import PREP_0, RESET, ROWS, Row
from tests.integrations.realhal import hal
from tests.integrations.realiocontrol import Played, expected, played

pytestmark = [pytest.mark.real, pytest.mark.slow]

TRIES = 3
"""The sampler has no real time: on a busy computer it may miss a millisecond. A difference must be there every time."""

NOT_PLAYED = {
    "a prepare that cannot finish for a fault": "the program has no time limits",
    "a change that takes too long is told and stays": "the program has no time limits",
}

Changes = tuple[tuple[str, str], ...]
A_CYCLE_LONG: Changes = (
    ("emc-reason=101, emc-abort^", "tool-change^ | emc-reason=101, emc-abort^, tool-change_ | emc-reason=3"),
)
THE_REASON_IS_LOST: Changes = (("emc-reason=101, emc-abort^", "emc-reason=101, emc-abort^ | emc-reason=3"),)
TWO_REASONS: Changes = (
    ("user-enable-out_", "user-enable-out_, emc-reason=0"),
    ("emc-reason=6, emc-abort^", "emc-reason=6, emc-abort^ | emc-reason=7"),
)
TWO_REASONS_EXTERNAL: Changes = (("emc-reason=2, emc-abort^", "emc-reason=2, emc-abort^ | emc-reason=7"),)
DIFFERENCES: dict[str, Changes] = {
    "tool already in the spindle": ((f" | {PREP_0}", ""),),
    "answers that are repeated and late": (  # nothing has to move there: the change is asked for at once
        (" | tool-prepared^ | tool-prepared_ | tool-change^", " | tool-change^ | tool-prepared^ | tool-prepared_"),
    ),
    "fault while idle, reason -2": A_CYCLE_LONG,
    "fault while idle, reason 0": A_CYCLE_LONG,
    "fault while idle, reason 4": ((A_CYCLE_LONG[0][0], A_CYCLE_LONG[0][1].removesuffix(" | emc-reason=3")),),
    "fault while preparing": A_CYCLE_LONG,
    "fault while changing, reason -5": THE_REASON_IS_LOST,
    "fault while changing, reason 0": THE_REASON_IS_LOST,
    "fault and tool-changed in the same step": (("tool-number=-1", f"tool-number=5, {PREP_0}"),),
    "the latch is cleared by the pin once its line is FALSE, and the next M6 goes": (
        (" | toolchanger-faulted_", ""),
        ("toolchanger-clear-fault^", "toolchanger-clear-fault^ | toolchanger-faulted_"),
    ),
    "user e-stop": TWO_REASONS,
    "user e-stop with coolant on": TWO_REASONS,
    "external e-stop, and the line's return does not switch on": (
        *TWO_REASONS_EXTERNAL,
        (f", tool-change_, {PREP_0}", ", tool-change_"),
        ("emc-abort^ | emc-reason=7, tool-change_", "emc-abort^, tool-change_ | emc-reason=7"),
        ("emc-enable-in^", "emc-enable-in^ | emc-abort^"),
    ),
    "e-stop reset": (
        *TWO_REASONS,
        (RESET, f"{RESET.replace(', emc-reason=5, emc-abort^', '')} | emc-reason=5, emc-abort^"),
    ),
    "an e-stop reset while the external chain is open": (
        *TWO_REASONS_EXTERNAL,
        (", emc-reason=5, emc-abort^ | user-request-enable_", " | user-request-enable_ | emc-reason=5, emc-abort^"),
    ),
}


def programs(row: Row) -> str:
    """The sequence of the row as the program has it."""
    sequence = row.sequence
    for page, program in DIFFERENCES.get(row.name, ()):
        assert sequence.count(page) == 1, (row.name, page)
        sequence = sequence.replace(page, program)
    return sequence


def agrees(row: Row, came: Played) -> bool:
    return came.sequence == expected(row, programs(row)) and not came.missed


def says(row: Row, came: Played) -> bool:
    """§3: the parameters (the program has #5600 and #5601) and what people are told of a fault, by its reason."""
    if not row.name.startswith("fault while changing"):
        return True
    reason = row.parameters[2]
    told = [f"toolchanger error {reason:g}"] if reason < 0 else []
    return came.parameters == [0.0, *row.parameters[1:]] and came.told == told


def test_the_real_program_does_the_rows() -> None:
    left = [row for row in ROWS if row.name not in NOT_PLAYED and not row.settings.get("random")]
    left.sort(key=lambda row: row.name != "M6 without a T")  # the program never forgets a T
    with hal() as one:
        for _ in range(TRIES):
            came = played(one, left)
            left = [row for row in left if not (agrees(row, came[row.name]) and says(row, came[row.name]))]
            for row in left:
                print(row.name, came[row.name], expected(row, programs(row)), sep="\n  ")
            if not left:
                break
    assert not left, [row.name for row in left]


def test_t0_of_a_random_changer() -> None:
    rows = [row for row in ROWS if row.settings.get("random")]
    with hal() as one:
        came = played(one, rows, random=True)
    for row in rows:
        assert agrees(row, came[row.name]), came


def test_every_difference_is_of_a_row() -> None:
    names = {row.name for row in ROWS}
    assert names >= DIFFERENCES.keys() | NOT_PLAYED.keys()
    assert all(programs(row) for row in ROWS)
