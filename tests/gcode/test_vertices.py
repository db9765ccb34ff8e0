"""Corners of the drawing: where they are, and where nothing is drawn."""

from dataclasses import replace
from math import hypot, inf, nan

import numpy as np
import pytest

from gcode import vertices as v
from gcode.segments import CCW, CW, DWELL, FEED, HOMING, RAPID, Segments
from gcode.vertices import START, VertexMaker, Vertices
from tests.harness.segmentrows import Path, through


def made(*parts: Segments, maker: VertexMaker | None = None) -> Vertices:
    maker = maker or VertexMaker(parts[0].axes)
    pieces = [piece for part in parts for piece in maker.vertices(part)]
    assert pieces
    return Vertices(
        *(
            np.concatenate([getattr(piece, name) for piece in pieces], axis=-1)
            for name in ("position", "line", "kind", "feed", "tool", "frame", "unknown")
        )
    )


def places(found: Vertices) -> list[tuple[int, ...]]:
    return [tuple(place) for place in found.position.T.tolist()]


def test_a_path_is_its_start_and_the_end_of_each_way() -> None:
    path = Path(at=(0, 0, 5), feed=600, tool=3).to(1, 2, 5, kind=RAPID).to(1, 2, -0.0004).to(1.2345, 2, -1)
    found = made(path.segments())
    assert places(found) == [(0, 0, 5000), (1000, 2000, 5000), (1000, 2000, 0), (1234, 2000, -1000)]
    assert found.kind.tolist() == [START | RAPID, RAPID, FEED, FEED]
    assert found.line.tolist() == [1, 1, 2, 3]
    assert found.feed.tolist() == [600] * 4
    assert found.tool.tolist() == [3] * 4


def test_pieces_follow_on_without_a_seam() -> None:
    whole = Path(at=(0, 0, 0)).to(1, 0, 0).to(2, 0, 0).to(3, 1, 0).segments()
    parts = [whole.take(slice(0, 1)), whole.take(slice(1, 1)), whole.take(slice(1, 3))]
    assert places(made(*parts)) == places(made(whole))
    assert made(*parts).kind.tolist() == made(whole).kind.tolist()


def test_dwell_is_not_drawn_and_breaks_nothing() -> None:
    path = Path(at=(0, 0, 0)).to(1, 0, 0).to(1, 0, 0, kind=DWELL).to(2, 0, 0)
    maker = VertexMaker("XYZ")
    assert made(path.segments(), maker=maker).line.tolist() == [1, 1, 3]
    assert maker.segments == 2


def test_nothing_but_dwell_draws_nothing() -> None:
    path = Path(at=(0, 0, 0)).to(0, 0, 0, kind=DWELL)
    assert list(VertexMaker("XYZ").vertices(path.segments())) == []


def test_a_way_that_begins_elsewhere_has_a_start_of_its_own() -> None:
    path = Path(at=(0, 0, 0)).to(1, 0, 0)
    path.at = (5, 5, 0)
    path.to(6, 5, 0)
    found = made(path.segments())
    assert places(found) == [(0, 0, 0), (1000, 0, 0), (5000, 5000, 0), (6000, 5000, 0)]
    assert (found.kind & START).tolist() == [START, 0, START, 0]
    assert found.line.tolist() == [1, 1, 2, 2]


def test_noise_below_the_rounding_is_no_break() -> None:
    path = Path(at=(0, 0, 0)).to(1, 0, 0)
    path.at = (1 + 1e-12, 0, 0)
    assert len(made(path.to(2, 0, 0).segments())) == 3


def test_what_is_not_known_is_held_and_marked() -> None:
    path = Path(at=(nan, nan, nan)).to(nan, nan, 5).to(1, 2, 5).to(nan, nan, nan, kind=HOMING).to(3, nan, 1)
    maker = VertexMaker("XYZ")
    found = made(path.segments(), maker=maker)
    assert found.unknown.tolist() == [7, 3, 0, 7, 2]
    assert places(found) == [(0, 0, 0), (0, 0, 5000), (1000, 2000, 5000), (1000, 2000, 5000), (3000, 2000, 1000)]
    assert maker.known == 7


def test_what_is_held_goes_on_in_the_next_piece() -> None:
    first = Path(at=(1, 2, 3)).to(4, 5, 6)
    second = Path(at=(4, 5, 6)).to(nan, nan, nan)
    assert places(made(first.segments(), second.segments()))[-1] == (4000, 5000, 6000)


def test_an_axis_that_is_never_named_is_not_known() -> None:
    maker = VertexMaker("XYZA")
    found = made(Path(axes="XYZA", at=(0, 0, 0, nan)).to(1, 0, 0, nan).segments(), maker=maker)
    assert maker.known == 0b0111
    assert found.unknown.tolist() == [8, 8]
    assert np.isnan(maker.box.low[3])


@pytest.mark.parametrize("far", [2.2e6, -2.2e6, 1e300, inf, -inf])
def test_beyond_all_machines_is_as_good_as_unknown(far: float) -> None:
    maker = VertexMaker("XYZ")
    found = made(Path(at=(0, 0, 0)).to(far, 1, 0).to(2, 1, 0).segments(), maker=maker)
    assert found.unknown.tolist() == [0, 1, 0]
    assert maker.out_of_range


def test_bounds_are_those_of_what_is_certain() -> None:
    path = Path(at=(0, 0, 9)).to(50, 1, 9, kind=RAPID).to(50, 2, -1).to(40, nan, -2).to(0, 0, 9, kind=RAPID)
    maker = VertexMaker("XYZ")
    made(path.segments(), maker=maker)
    assert (maker.box.low.tolist(), maker.box.high.tolist()) == ([0, 0, -2000], [50000, 2000, 9000])
    assert (maker.cuts.low.tolist(), maker.cuts.high.tolist()) == ([40000, 2000, -2000], [50000, 2000, -1000])


# --- arcs -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("plane", [17, 18, 19])
@pytest.mark.parametrize("clockwise", [False, True])
@pytest.mark.parametrize("radius", [0.004, 0.5, 20.0, 3000.0])
def test_chords_keep_to_the_arc(plane: int, clockwise: bool, radius: float) -> None:
    first, second, along = {17: (0, 1, 2), 18: (2, 0, 1), 19: (1, 2, 0)}[plane]
    at, end = [7.0, 8.0, 9.0], [7.0, 8.0, 9.0]
    end[first] += radius
    end[second] += radius
    end[along] += 4.0
    path = Path(at=tuple(at)).arc(tuple(end), (radius, 0.0), clockwise=clockwise, plane=plane)
    found = made(path.segments())
    assert set(found.kind[1:].tolist()) == {CW if clockwise else CCW}
    points = found.position.T / 1000.0
    assert points[0] == pytest.approx(at, abs=0.0005)
    assert points[-1] == pytest.approx(end, abs=0.0005)
    corners = points[:, [first, second]] - [at[first] + radius, at[second]]
    assert np.hypot(*corners.T) == pytest.approx(np.full(len(points), radius), abs=0.0008)
    middles = np.hypot(*((corners[1:] + corners[:-1]) / 2).T)
    assert np.all(radius - middles < v.CHORD_TOLERANCE_MM + 0.0008)
    rise = np.diff(points[:, along])
    assert rise == pytest.approx(np.full(len(rise), 4.0 / len(rise)), abs=0.0011)
    # From (-r, 0) of its centre to (0, r): three quarters counter-clockwise, one quarter clockwise.
    turned = np.unwrap(np.arctan2(corners[:, 1], corners[:, 0]))
    if radius > 0.1:
        assert turned[-1] - turned[0] == pytest.approx(-np.pi / 2 if clockwise else 3 * np.pi / 2, abs=0.01)


def test_a_full_circle_and_many_turns() -> None:
    circle = Path(at=(10, 0, 0)).arc((10, 0, 0), (-10, 0), clockwise=False)
    once = made(circle.segments())
    turns = circle.segments()
    turns.sweep = turns.sweep * 5
    assert once.position.min(axis=1).tolist() == pytest.approx([-10000, -10000, 0], abs=10)
    assert once.position.max(axis=1).tolist() == pytest.approx([10000, 10000, 0], abs=10)
    assert len(made(turns)) == pytest.approx(5 * len(once), abs=10)


def test_a_small_circle_is_still_round() -> None:
    assert len(made(Path(at=(0.01, 0, 0)).arc((0.01, 0, 0), (-0.01, 0), clockwise=True).segments())) == 9


def test_an_arc_that_does_not_close_ends_where_the_block_says() -> None:
    found = made(Path(at=(10, 0, 0)).arc((0, 13, 0), (-10, 0), clockwise=False).segments())
    radii = np.hypot(*found.position[:2].astype(float)) / 1000
    assert places(found)[-1] == (0, 13000, 0)
    assert np.all(np.diff(radii) > -0.002)


def test_an_arc_that_cannot_be_is_a_gap() -> None:
    found = made(Path(at=(0, 0, 0)).to(5, 5, 0, kind=CW, plane=17).to(6, 5, 0).segments())
    assert (found.kind & START).tolist() == [START, START, 0]
    assert places(found)[1] == (5000, 5000, 0)


def test_an_arc_from_nowhere_is_unknown_until_its_end() -> None:
    path = Path(at=(nan, 0, 0)).to(10, 0, 0, kind=CCW, plane=17, centre=(5.0, 0.0), radius=5.0, end_radius=5.0, sweep=1)
    found = made(path.segments())
    assert found.unknown.tolist()[:-1] == [1] * (len(found) - 1)
    assert found.unknown[-1] == 0


def test_one_arc_has_a_limit() -> None:
    path = Path(at=(1e5, 0, 0)).arc((1e5, 0, 0), (-1e5, 0), clockwise=False)
    maker = VertexMaker("XYZ")
    assert len(made(path.segments(), maker=maker)) == v.MOST_CHORDS + 1
    assert maker.coarse


def test_a_program_of_nothing_but_circles_has_one_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(v, "CHORD_BUDGET", 100)
    path = Path(at=(50, 0, 0))
    for _ in range(4):
        path.arc((50, 0, 0), (-50, 0), clockwise=False)
    maker = VertexMaker("XYZ")
    whole = path.segments()
    found = made(*(whole.take(slice(at, at + 1)) for at in range(4)), maker=maker)
    counts = np.bincount(found.line)[1:].tolist()
    assert counts[0] > 100
    assert counts[1:] == [v.COARSE_CHORDS] * 3
    assert maker.coarse


def test_pieces_stay_of_moderate_size_however_many_chords_there_are(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(v, "PIECE_VERTICES", 1000)
    path = Path(at=(500, 0, 0))
    for _ in range(20):
        path.arc((500, 0, 0), (-500, 0), clockwise=False)
    pieces = list(VertexMaker("XYZ").vertices(path.segments()))
    assert len(pieces) >= 10
    assert max(len(piece) for piece in pieces) <= 1000
    points = np.concatenate([piece.position for piece in pieces], axis=1)
    assert np.hypot(*points[:2].astype(float)) == pytest.approx(np.full(points.shape[1], 500_000), abs=1)


def test_finer_chords_by_wish() -> None:
    path = Path(at=(10, 0, 0)).arc((10, 0, 0), (-10, 0), clockwise=False).segments()
    coarse, fine = (len(made(path, maker=VertexMaker("XYZ", chord_tolerance_mm=mm))) for mm in (0.01, 0.0001))
    assert fine == pytest.approx(10 * coarse, rel=0.1)


def test_rounding_never_accumulates() -> None:
    points = np.cumsum(np.full((3, 100_001), 0.0004), axis=1)
    found = made(through(points))
    assert np.all(np.abs(found.position / 1000.0 - points) <= 0.0005 + 1e-9)
    assert hypot(*(found.position[:, -1] / 1000.0 - points[:, -1])) < 0.001


def test_other_columns_go_with_their_row() -> None:
    path = Path(at=(0, 0, 0), feed=nan, tool=-1).to(1, 0, 0)
    path.feed, path.tool, path.frame, path.frames = 250.5, 7, 1, [(0.0,) * 3, (10.0, 0.0, 0.0)]
    path.arc((3, 0, 0), (1, 0), clockwise=True)
    found = made(path.segments())
    assert found.feed.tolist() == [-1, -1] + [250.5] * (len(found) - 2)
    assert found.tool.tolist() == [-1, -1] + [7] * (len(found) - 2)
    assert found.frame.tolist() == [0, 0] + [1] * (len(found) - 2)
    assert made(replace(path.segments(), feed=np.array([inf, 5.0]))).feed[0] == -1
