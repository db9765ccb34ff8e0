"""Blocks to frames: every rule of ncframe §1 to §3, and that no rounding error ever grows."""

from decimal import Decimal

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcode.ncframe.rules import FrameRules
from gcode.ncframe.translate import MAX_WAITING, Translator
from gcode.words import parse_block
from tests.harness.frameprograms import LATHE, ORIGIN, errors, executed, frames, translation
from tests.harness.programs import quick

EXAMPLE = "G00,G90,G42,X35000,Z160000,F50,S07,T33,M03"


# --- coordinates ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("end", ["", ",LF", ";", " LF", ",LF;"])
def test_the_example_of_the_source(end: str) -> None:
    found = frames(EXAMPLE + end, resolution_mm=1, tool_radius_mm=5000, compensation="offset")
    assert found == ["G0 M3 X40000 Z165000 F50 S7 T33"]


def test_absolute_becomes_increments_and_incremental_stays() -> None:
    assert frames("G90 G0 X10 Z5|X12|Z5|G91 X1 Z-2|X1|G90 X0 Z0") == [
        "G0 X10000 Z5000",
        "X2000",
        "X1000 Z-2000",
        "X1000",
        "X-14000 Z-3000",
    ]


def test_u_and_w_are_increments_in_both_modes_and_stand_beside_absolute_words() -> None:
    found = frames("G0 X10 Z10|U2 W-1|X5 W-1|G91 U1 Z1")
    assert found == ["G0 X10000 Z10000", "X2000 Z-1000", "X-7000 Z-1000", "X1000 Z1000"]


@pytest.mark.parametrize("code", ["G92", "G50"])
def test_setting_the_position_sends_nothing_and_moves_what_follows(code: str) -> None:
    assert frames(f"G0 X10 Z10|{code} X0 Z100|X1 Z99") == ["G0 X10000 Z10000", "X1000 Z-1000"]


def test_inches_are_scaled_feed_and_radius_too() -> None:
    found = frames("G20 G1 X1 Z0.5 F2|G2 X2 Z1.5 R1|G21 X0 Z38.1 R-30", feed_unit_mm_min=0.2)
    assert found == ["G1 X25400 Z12700 F254", "G2 X25400 Z25400 R25400", "X-50800 R-30000"]


def test_diameter_programming_halves_x_and_u_and_leaves_the_radius() -> None:
    found = frames("G0 X40 Z1|U-10|G1 X0 F9|G3 X10 Z-4 R5|G50 X8|G1 X0", diameter_programming=True)
    assert found == ["G0 X20000 Z1000", "X-5000", "G1 X-15000 F9", "G3 X5000 Z-5000 R5000", "G1 X-4000"]


def test_with_diameters_positions_are_told_as_diameters() -> None:
    translator = Translator(LATHE, FrameRules(diameter_programming=True), {"x": 40.0, "z": 0.0})
    [frame] = translator.step(1, parse_block("G0 X50 Z1"))
    assert (frame.items.text(), frame.end, translator.place) == ("G0 X5000 Z1000", (50.0, 1.0), (50.0, 1.0))
    translator.relocate({"x": 30.0, "z": 0.0})
    assert [frame.items.text() for frame in translator.step(2, parse_block("X50 Z1"))] == ["G0 X10000 Z1000"]


def test_a_resolution_of_its_own() -> None:
    assert frames("G0 X1 Z-0.3", resolution_mm=0.02) == ["G0 X50 Z-15"]


STEPS = st.lists(
    st.tuples(
        st.sampled_from(["abs", "rel", "uw", "g92"]),
        st.sampled_from(["X", "Z"]),
        st.integers(-99_999, 99_999).filter(lambda tenth: tenth % 10 != 5),
    ),
    max_size=40,
)


@quick
@given(STEPS)
def test_the_increments_add_up_to_the_rounded_path_at_every_block(steps: list[tuple[str, str, int]]) -> None:
    """The path is kept here in exact tenths of a count."""
    translator = Translator(LATHE, FrameRules(), ORIGIN)
    at = {"X": Decimal(0), "Z": Decimal(0)}
    zero = dict(at)
    sent = {"X": 0, "Z": 0}
    translator.step(1, parse_block("G0"))
    for number, (kind, axis, tenths) in enumerate(steps, 2):
        value = Decimal(tenths) / 10_000
        if kind == "g92":
            block = f"G92 {axis}{value}"
            zero[axis] = at[axis] - value
        elif kind == "abs":
            block = f"G90 {axis}{value}"
            at[axis] = zero[axis] + value
        else:
            block = f"G91 {axis}{value}" if kind == "rel" else f"{'U' if axis == 'X' else 'W'}{value}"
            at[axis] += value
        for frame in translator.step(number, parse_block(block)):
            sent["X"] += frame.items.x or 0
            sent["Z"] += frame.items.z or 0
        assert translator.errors == []
        for name, place in at.items():
            # Half a count, and the last digits of a double where the place is halfway between two.
            assert abs(Decimal(sent[name]) / 1000 - place) <= Decimal("0.00050001"), (name, block)


# --- what is left out -------------------------------------------------------------------------------------------------


def test_what_has_not_changed_is_left_out_and_m_never_is() -> None:
    assert frames("G1 X1 F50 S3 T2 M3|G1 X2 F50 S3 T2 M3|G1 X2 F50 S3 T2|G0 X2 F51|M8|M8") == [
        "G1 M3 X1000 F50 S3 T2",
        "M3 X1000",
        "G0 F51",
        "M8",
        "M8",
    ]


def test_a_block_with_nothing_to_send_makes_no_frame() -> None:
    assert frames("G90 G21 G18 G94 G97 G40 G54|N10|(remark)|%||G0 X0 Z0|G80") == ["G0"]


def test_a_step_under_half_a_count_waits_for_the_next() -> None:
    assert frames("G0 X0.0004|X0.0008|X0.0012|X0.0016") == ["G0", "X1", "X1"]


def test_an_increment_equal_to_the_one_before_is_a_new_move() -> None:
    assert frames("G91 G1 X1 F5|X1|X1") == ["G1 X1000 F5", "X1000", "X1000"]


def test_nothing_is_taken_as_known_behind_a_stop_but_a_tool_that_was_just_changed() -> None:
    program = "G1 X1 F50 S3 T2|M0|G1 X2 F50 S3 T2|T4 M6|G1 X3 F50 S3 T4|M30|G1 X4 F50 S3 T4"
    assert frames(program) == [
        "G1 X1000 F50 S3 T2",
        "M0",
        "G1 X1000 F50 S3 T2",
        "M6 T4",
        "G1 X1000 F50 S3",
        "M30",
        "G1 X1000 F50 S3 T4",
    ]


def test_behind_a_dwell_the_motion_mode_is_sent_anew() -> None:
    assert frames("G1 X1 F5|G4 P1.25|X2|G4 P0|G1 X3") == ["G1 X1000 F5", "G4 X1250", "G1 X1000", "G4", "G1 X1000"]


# --- M codes ----------------------------------------------------------------------------------------------------------


def test_a_frame_has_one_m_and_a_stop_comes_behind_the_motion_of_its_block() -> None:
    found = translation("M3 M8 S5 G1 X1 F9 M0|M30 X2 M9|T7 M6 G0 X3 S1")
    assert found.errors == []
    assert found.texts == ["M3 S5", "G1 M8 X1000 F9", "M0", "G1 M9 X1000 F9 S5", "M30", "M6 T7", "G0 X1000 F9 S1"]
    stops = [(frame.items.m, frame.stop) for frame in found.frames if frame.stop]
    assert [(m, stop.ends_program, stop.tool_change) for m, stop in stops] == [
        (0, False, False),
        (30, True, False),
        (6, False, True),
    ]
    assert [frame.tool for frame in found.frames if frame.stop] == [None, None, 7]


def test_every_m_code_is_sent_but_those_of_subprograms() -> None:
    sent = [number for number in range(100) if number not in (98, 99)]
    assert frames("|".join(f"M{number:02d}" for number in sent)) == [f"M{number}" for number in sent]


def test_words_of_a_block_with_an_m_code_that_something_else_takes() -> None:
    assert frames("M8 G4 P1|M9 G2 X2 Z2 R2 F9|M8 X4 Z4 R2") == [
        "G4 M8 X1000",
        "G2 M9 X2000 Z2000 R2000 F9",
        "M8 X2000 Z2000 R2000",
    ]


def test_a_stop_alone_takes_along_what_is_new() -> None:
    assert frames("M0 S4 T3 F9 G1") == ["G1 M0 F9 S4 T3"]


# --- feeds and speeds -------------------------------------------------------------------------------------------------


def test_a_feed_per_turn_is_that_of_the_speed() -> None:
    found = frames("G95 G1 X1 F0.1 S200 M3|S400 X2|G94 F30 X3", speed_unit_rpm=10)
    assert found == ["G1 M3 X1000 F20 S20", "X1000 F40 S40", "X1000 F30"]


@pytest.mark.parametrize(
    ("program", "rules", "found"),
    [
        ("G1 X1", {}, "feed_missing"),
        ("G1 X1 F0", {}, "feed_missing"),
        ("G1 X1 F9|G95 X2", {}, "feed_missing"),
        ("G95 G1 X1 F1 S9", {}, "feed_missing"),
        ("G1 X1 F256", {}, "frame_range"),
        ("G1 X1 F0.4", {}, "frame_range"),
        ("S256", {}, "frame_range"),
        ("S1.5", {}, "frame_range"),
        ("S4", {"speed_unit_rpm": 10}, "frame_range"),
        ("T256", {}, "frame_range"),
        ("T1.5", {}, "frame_range"),
        ("T-1", {}, "frame_range"),
        ("G0 X8388.608", {}, "frame_range"),
        ("G0 Z-8388.609", {}, "frame_range"),
        ("G2 X1 Z1 R9000 F5", {}, "frame_range"),
        ("G96 S9", {}, "unknown_code"),
        ("G17", {}, "unknown_code"),
        ("G19", {}, "unknown_code"),
        ("G28 X0", {}, "unknown_code"),
        ("M98 P1", {}, "unknown_code"),
        ("G0 Y1", {}, "unknown_word"),
        ("G0 X", {}, "no_number"),
        ("G0 X1 R5", {}, "word_left_over"),
        ("X1", {}, "motion_not_set"),
        ("G0 G1 X1 F5", {}, "group_conflict"),
        ("G4", {}, "word_missing"),
        ("G2 X0 Z0 R5 F5", {}, "arc_impossible"),
        ("G2 X20 R9.9 F5", {}, "arc_impossible"),
        ("G2 X1 Z1 F5", {}, "arc_without_centre"),
        ("G2 X10 Z0 I4 F5", {}, "arc_not_closed"),
        ("G2 X1 I0 K0 F5", {}, "arc_impossible"),
        ("G41 X1", {}, "compensation"),
        ("M62 P1", {}, "word_left_over"),
        ("M19 R90", {}, "word_left_over"),
        ("M6 T1 D1", {}, "word_left_over"),
    ],
)
def test_what_cannot_be_sent_is_an_error_of_its_line(program: str, rules: dict[str, float], found: str) -> None:
    lead = "G21 G90"
    line = 2 + program.count("|")
    assert (line, found) in errors(f"{lead}|{program}", **rules)


def test_the_ends_of_the_ranges_do_fit() -> None:
    found = frames("G0 X-8388.608 Z8388.607|X-0.001|G1 F255 S255 T255|G1 F1 S0 T0")
    assert found == ["G0 X-8388608 Z8388607", "X8388607", "G1 F255 S255 T255", "F1 S0 T0"]


def test_a_chord_over_2r_names_both_numbers() -> None:
    note = translation("G0 X0|G2 X20 R9.9 F5").errors[0]
    assert (note.line, note.message) == (2, "the ends of the arc are 20.0000 mm apart, more than 2R = 19.8000 mm")


def test_what_is_out_of_range_is_told_where_it_stands_and_once() -> None:
    notes = translation("S300 G0 X1|X2|G0 X99999 Z1").errors
    assert [(note.line, note.column) for note in notes] == [(1, 1), (3, 4)]
    assert "-8388608 to 8388607" in notes[1].message


# --- where the machine stands -----------------------------------------------------------------------------------------


def test_an_axis_that_nobody_knows_takes_steps_or_a_new_zero_only() -> None:
    assert errors("G0 X1", None) == [(1, "position_unknown")]
    assert frames("G91 G0 X1 Z2|U1|G90 W1|G92 X0 Z0|X5 Z1", None) == ["G0 X1000 Z2000", "X1000", "Z1000", "X5000 Z1000"]
    assert errors("G92 X0|G0 X1|Z1", None) == [(3, "position_unknown")]
    assert errors("G0 X1 Z1", {"x": 4.0}) == [(1, "position_unknown")]
    assert frames("G0 X1", {"x": 4.0}) == ["G0 X-3000"]


def test_where_it_stands_is_told_only_where_that_is_known() -> None:
    ends = [frame.end for frame in translation("G91 G0 X1|G92 Z0|G90 Z3", {"x": 4.0}).frames]
    assert [end[0] for end in ends] == [5.0, 5.0]
    assert all(end[1] != end[1] for end in ends)


def test_coordinate_systems_need_their_zeros_told() -> None:
    assert errors("G0 X1|G55|X1") == [(3, "position_unknown")]
    assert frames("G0 X1|G55|U1|G92 X0|X2") == ["G0 X1000", "X1000", "X2000"]
    systems = {2: {"x": 10.0, "z": -5.0}}
    assert frames("G0 X1 Z1|G55 X1 Z1|G54 X0 Z0", systems=systems) == [
        "G0 X1000 Z1000",
        "X10000 Z-5000",
        "X-11000 Z4000",
    ]


def test_a_translator_goes_on_from_where_the_machine_really_stands() -> None:
    translator = Translator(LATHE, FrameRules(), ORIGIN)
    translator.step(1, parse_block("G0 X10 Z10"))
    assert translator.place == (10.0, 10.0)
    translator.relocate({"x": 4.0, "z": 1.0})
    texts = [frame.items.text() for frame in translator.step(2, parse_block("X10 Z10"))]
    assert texts == ["G0 X6000 Z9000"]
    translator.relocate({})
    translator.step(3, parse_block("X1"))
    assert [note.code for note in translator.errors] == ["position_unknown"]


# --- compensation -----------------------------------------------------------------------------------------------------


def test_the_offset_is_taken_and_left_by_each_axis_with_its_own_straight_move() -> None:
    found = frames("G42 D3|G0 X10|Z5|G1 X8 F5|G2 X10 Z7 R2|G40 G1 X10|Z7", tools={3: 0.5}, compensation="offset")
    assert found == [
        "G0 X10500",
        "Z5500",
        "G1 X-2000 F5",
        "G2 X2000 Z2000 R2000",
        "G1 X-500",
        "Z-500",
    ]


def test_the_offset_of_a_tool_on_the_other_side_is_negative_and_d0_is_no_tool() -> None:
    assert frames("G41 G0 X1 T5", tools={5: -0.4}, compensation="offset") == ["G0 X600 T5"]
    assert frames("G41 D0 G0 X1 T5", tools={5: 0.4}, compensation="offset") == ["G0 X1000 T5"]


def test_the_offset_never_bends_an_arc() -> None:
    program = "G0 X0 Z0|G42 G2 X1 Z1 R1 F5"
    assert errors(program, tool_radius_mm=0.4, compensation="offset") == [(2, "compensation")]
    assert errors("G42 G0 X1|G2 X2 Z1 R1 F5", tool_radius_mm=0.4, compensation="offset") == [(2, "compensation")]


def test_the_contour_is_guided_and_other_blocks_keep_their_place() -> None:
    # A shaft of radius 10 with a shoulder: from outside along the face, then along the shaft towards the chuck.
    found = translation("G0 X20 Z5|G42 G1 X10 Z2 F100|M8|Z-20|X20 M9|G40|G0 X30 M30", tool_radius_mm=0.4)
    assert found.errors == []
    machine = executed(found)
    assert [(way.end.imag, way.end.real) for way in machine.ways][2:] == [
        (10400, -19600),
        (20000, -19600),
        (30000, -20000),
    ]
    assert [frame.items.m for frame in found.frames] == [None, None, 8, None, 9, None, 30]
    assert found.lines == [1, 2, 3, 4, 5, 7, 7]


def test_round_an_outside_corner_goes_an_arc_of_the_radius_of_the_tool() -> None:
    found = translation("G41 G1 X5 Z0 F60|X10|Z10|X0|G40|G0 X0 Z0", tool_radius_mm=2)
    radii = [frame.items.r for frame in found.frames if frame.items.r is not None]
    assert found.errors == []
    assert set(radii) <= {2000}


def test_an_inside_corner_too_small_for_the_tool_names_its_lines() -> None:
    program = "G0 X0 Z10|G42 G1 X0 Z0 F50|Z-10|X1|Z-12|X1.5|Z-11.9|X20|G40|G0 X40"
    notes = translation(program, tool_radius_mm=3).errors
    assert notes
    assert notes[0].code == "compensation_corner"
    assert f"line {notes[0].line}" in notes[0].message
    assert errors("G42 G1 X0 Z-9 F9|G2 X2 Z-11 R1", tool_radius_mm=1.5) != []


def test_two_blocks_in_a_line_stay_apart_while_they_wait_for_their_corners() -> None:
    one = translation("G42 G1 X5 Z0 F60|X10;M8;Z-10;M9|X20|G40|G0 X0 Z0", tool_radius_mm=1)
    several = translation("G42 G1 X5 Z0 F60|X10|M8|Z-10|M9|X20|G40|G0 X0 Z0", tool_radius_mm=1)
    assert one.errors == []
    assert one.texts == several.texts
    assert set(one.lines) == {1, 2, 3, 5}


def test_the_tool_stays_while_it_is_guided() -> None:
    assert errors("T1 G42 G1 X5 F9|T2 Z-5|G40|G0 X9", tools={1: 0.4, 2: 0.4}) == [(2, "compensation")]
    assert errors("G42 G1 X5 F9|G92 X0|G40|G0 X9", tool_radius_mm=0.4) == [(2, "compensation")]


def test_what_waits_for_a_corner_is_bounded() -> None:
    program = "G42 G1 X5 F9|" + "M8|" * (MAX_WAITING + 1) + "Z-5"
    assert errors(program, tool_radius_mm=0.4)[0][1] == "compensation_still"


def test_the_end_of_the_program_lets_go_what_was_held_back() -> None:
    found = translation("G42 G1 X5 Z5 F9|Z-5|M30", tool_radius_mm=0.4)
    assert found.texts[-1] == "M30"
    assert executed(found).ways[-1].end.real == -5000
    assert translation("G42 G1 X5 Z5 F9|Z-5", tool_radius_mm=0.4).lines == [1, 2, 2]


# --- anything at all --------------------------------------------------------------------------------------------------

WORDS = st.sampled_from(
    (
        *("G0", "G1", "G2", "G3", "G4", "G20", "G21", "G40", "G41", "G42", "G50", "G54", "G55", "G90", "G91", "G92"),
        *("G94", "G95", "X1", "X-3.2", "Z7", "Z0", "U1", "W-2", "R5", "R-5", "I3", "K-2", "F30", "F0", "S5", "T1"),
        *("T9", "D1", "P2", "M0", "M3", "M6", "M8", "M30", "X1e"),
    )
)


@quick
@given(st.lists(st.lists(WORDS, max_size=5).map(" ".join), max_size=25), st.sampled_from(["contour", "offset"]))
def test_no_block_raises_and_what_has_no_error_fits_into_frames(lines: list[str], compensation: str) -> None:
    translator = Translator(LATHE, FrameRules(tool_radius_mm=0.4, compensation=compensation), ORIGIN)  # type: ignore[arg-type]
    found = [frame for number, line in enumerate(lines, 1) for frame in translator.step(number, parse_block(line))]
    found += translator.finish()
    if not translator.errors:
        assert all(frame.items.faults() == [] for frame in found)
        assert all(frame.items for frame in found)
        assert translator.settled
        assert [frame.line for frame in found] == sorted(frame.line for frame in found)
