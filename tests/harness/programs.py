"""G-code for tests: strategies of lines as programs have them, the corpus where it lies, and the usual planner.

Hypothesis runs derandomised here: the same examples every time, a failing one is printed.
"""

from pathlib import Path

import pytest
from hypothesis import settings
from hypothesis import strategies as st

from gcode.profile import Profile, load_profile
from tests.harness.effort import more

CORPUS = Path(__file__).resolve().parents[2].parent / "shared" / "corpus"

FITTING_FILES = ("gsender_mb31.nc", "ugs_gates_combined.nc", "fluidnc_raster_tree.nc", "camotics_compass.ngc")
"""Files of the corpus that run on an ElVinto machine as they are."""

quick = settings(derandomize=True, deadline=None, max_examples=more(50))
thorough = settings(derandomize=True, deadline=None, max_examples=more(100))

# Few values, so that the same coordinate and the same feed come again: that is what compaction lives on.
COORDINATES = ("0", "10", "10.000", "-5.25", "+3.", ".5", "007", "-0", "2.50")
numbers = st.sampled_from(COORDINATES)
axis_words = st.builds(lambda letter, number: letter + number, st.sampled_from("XYZA"), numbers)
feed_words = st.sampled_from(("F300", "F300.0", "F1000"))
motion_words = st.sampled_from(("G0", "G1", "G01", "G00"))
distance_words = st.sampled_from(("G90", "G91"))
arc_blocks = st.sampled_from(("G2 X10 Y0 I5 J0", "G3X0Y10R20", "X5 Y5 I2 J2", "G2 I5", "G3 X10 I-5 J0 Z1"))
other_blocks = st.sampled_from(
    ("M3 S1000", "M5", "G80", "G81 X5 Y5 Z-3 R1 F100", "G83 X1 Z-9 R1 Q2", "X7 Y7", "G21", "G17", "G40", "M8", "G54")
)
barrier_blocks = st.sampled_from(
    ("G28", "G28 Z0", "G29", "G92 X0 Y0", "G92", "M200", "M210", "M6 T2", "T1", "W90", "W70", "W71", "G76 S5", "M1")
)
remarks = st.sampled_from(("", "%", "(comment)", "; G1 X5", "N10", "O1234 (NAME)", "( a ) "))


def _block(*words: str | None) -> str:
    # An axis or a letter twice is no block that a program has.
    unique = {word[:3] if word[0] in "GM" else word[0]: word for word in words if word}
    return " ".join(unique.values())


move_blocks = st.builds(
    lambda motion, distance, axes, feed: _block(motion, distance, *axes, feed),
    st.none() | motion_words,
    st.none() | distance_words,
    st.lists(axis_words, max_size=3),
    st.none() | feed_words,
)
motion_lines = st.one_of(move_blocks, move_blocks, move_blocks, arc_blocks, other_blocks, remarks)
program_lines = st.one_of(motion_lines, motion_lines, motion_lines, barrier_blocks)
positions = st.dictionaries(st.sampled_from("xyza"), st.sampled_from((0.0, 10.0, -5.25)), max_size=4)


def elvinto() -> Profile:
    """The profile that most tests are about."""
    return load_profile("elvinto")


def corpus_files() -> list[Path]:
    """The programs of the corpus; a test without them is skipped, and says so."""
    if not CORPUS.is_dir():
        pytest.skip(f"the corpus of real programs is missing at {CORPUS}: nothing of this test was run")
    return sorted(path for path in CORPUS.iterdir() if path.suffix not in (".md", ".tsv"))


def numbered(text: str) -> list[tuple[int, bytes]]:
    """The lines of a program as ProgramStore gives them."""
    return list(enumerate(text.encode().splitlines(), 1))
