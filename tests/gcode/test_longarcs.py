"""Long arcs drawn together: as many seconds as chord by chord, in far fewer blocks, and only where that is certain."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import gcode.planblocks
from gcode.chords import chord_counts
from gcode.columns import read_columns
from gcode.interpret import Reading
from gcode.interpreter import power_on
from gcode.longarcs import Limits, edges
from gcode.motion import Motion
from gcode.planner import plan
from gcode.profile import load_profile
from gcode.segments import Segments
from tests.harness.programs import quick


def read(lines: list[str]) -> Segments:
    profile = load_profile("grbl-1.1")
    return Reading(profile, power_on(profile).assumed()).read(read_columns("\n".join(lines).encode() + b"\n"))


def chord_by_chord(program: Segments, motion: Motion) -> np.ndarray:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(gcode.planblocks, "edges", lambda segments, *_: np.zeros(len(segments), np.int64))
        return plan(program, motion)


feeds = st.sampled_from((60, 400, 1200, 4000, 9000))
half_turns = st.builds(
    lambda turn, radius, rise, feed: f"G91 {turn} X{2 * radius} Y0 Z{rise} I{radius} J0 F{feed}",
    st.sampled_from(("G2", "G3")),
    st.sampled_from((0.5, 3.0, 12.5, 60.0)),
    st.sampled_from((0, 0, 2)),
    feeds,
)
lines = st.builds(
    lambda x, y, feed: f"G91 G1 X{x} Y{y} F{feed}",
    st.sampled_from((-3.0, -0.1, 0.2, 5.0)),
    st.sampled_from((-2.0, 0.1, 7.0)),
    feeds,
)
machines = st.builds(
    lambda x, y, blocks, steps: Motion(
        max_rate={"x": 8000, "y": 6000, "z": 2000},
        acceleration={"x": x, "y": y, "z": 100},
        planner_blocks=blocks,
        steps_per_mm=dict.fromkeys("xyz", steps) if steps else {},
    ),
    st.sampled_from((20.0, 200.0, 1000.0)),
    st.sampled_from((50.0, 200.0)),
    st.sampled_from((1, 2, 5, 16, 32)),
    st.sampled_from((0, 0, 100)),
)


@given(st.lists(st.one_of(half_turns, lines, lines), min_size=1, max_size=20), machines)
@quick
def test_the_seconds_stay_what_they_were(program: list[str], motion: Motion) -> None:
    segments = read(["G21 G17", *program])
    close = (
        1e-2 if motion.steps_per_mm else 1e-6
    )  # the end of each chord is a whole step, which is a ninth of the shortest
    assert plan(segments, motion) == pytest.approx(chord_by_chord(segments, motion), rel=close, abs=close)


def test_a_slow_large_arc_is_a_handful_of_blocks() -> None:
    segments = read(["G21 G17", "G2 X100 Y0 I50 J0 F600", "G2 X0 Y0 I-50 J0 F60000"])
    chords = chord_counts(segments, 0.002)
    limits = Limits(np.full(3, 200.0), np.full(3, 8000 / 60), np.zeros(3), 0.01, 14)
    assert chords.min() > 150
    slow, fast = edges(segments, chords, segments.feed / 60, limits).tolist()
    assert 0 < slow < 5
    assert fast == 0
    stops_everywhere = Limits(limits.acceleration, limits.rate, limits.step_mm, 0.01, 0)
    assert edges(segments, chords, segments.feed / 60, stops_everywhere).tolist() == [0, 0]
