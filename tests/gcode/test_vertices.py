"""Corners of the drawing: where they are, and where nothing is drawn."""

from dataclasses import replace
from math import hypot, inf, nan, pi

import numpy as np
import pytest

from gcode import vertices as v
from gcode.segments import CCW, CW, DWELL, FEED, HOMING, RAPID, Segments
from gcode.vertices import START, VertexMaker, Vertices, joined
from tests.harness.segmentrows import Path, through


def made(*parts: Segments, maker: VertexMaker | None = None) -> Vertices:
    maker = maker or VertexMaker(parts[0].axes)
    pieces = [piece for part in parts for piece in maker.vertices(part)]
    assert pieces
    return joined(pieces)


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
def test_an_arc_is_one_vertex_with_its_centre(plane: int, clockwise: bool, radius: float) -> None:
    first, second, along = {17: (0, 1, 2), 18: (2, 0, 1), 19: (1, 2, 0)}[plane]
    at, end = [7.0, 8.0, 9.0], [7.0, 8.0, 9.0]
    end[first] += radius
    end[second] += radius
    end[along] += 4.0
    path = Path(at=tuple(at)).arc(tuple(end), (radius, 0.0), clockwise=clockwise, plane=plane)
    found = made(path.segments())
    kind = CW if clockwise else CCW
    assert found.kind.tolist() == [START | kind, kind]
    assert places(found) == [tuple(round(1000 * mm) for mm in place) for place in (at, end)]
    arcs = found.arcs
    assert (arcs.at.tolist(), arcs.plane.tolist()) == ([1], [plane])
    assert arcs.centre[:, 0].tolist() == [round(radius * 1000), 0]
    # From (-r, 0) of its centre to (0, r): three quarters counter-clockwise, one quarter clockwise.
    assert arcs.sweep[0] == pytest.approx(-pi / 2 if clockwise else 3 * pi / 2)


def test_the_bounds_take_in_the_bulge_of_an_arc() -> None:
    path = Path(at=(10, 0, 5)).to(10, 0, 0, kind=RAPID).arc((0, 10, -1), (-10, 0), clockwise=True)
    maker = VertexMaker("XYZ")
    made(path.segments(), maker=maker)
    assert (maker.box.low.tolist(), maker.box.high.tolist()) == ([-10000, -10000, -1000], [10000, 10000, 5000])
    assert (maker.cuts.low.tolist(), maker.cuts.high.tolist()) == ([-10000, -10000, -1000], [10000, 10000, 0])


def test_the_bulge_is_no_less_than_any_point_of_the_arc_is_off() -> None:
    rng = np.random.default_rng(6)
    for _ in range(300):
        radius, begin, grown = rng.uniform(0.01, 50), rng.uniform(0, 2 * pi), rng.choice([0.0, 0.002, 3.0])
        sweep, rise = rng.uniform(0.01, 3 * pi), rng.choice([0.0, 7.0])
        share = np.linspace(0, 1, 200)
        angle, radii = begin + sweep * share, radius + grown * share
        points = np.array([radii * np.cos(angle), radii * np.sin(angle), rise * share])
        path = Path(at=tuple(points[:, 0])).arc(tuple(points[:, -1]), tuple(-points[:2, 0]), clockwise=False)
        whole = replace(path.segments(), sweep=np.array([sweep]))
        way = points[:, -1:] - points[:, :1]
        along = np.sum((points - points[:, :1]) * way, axis=0) / max(float(np.sum(way * way)), 1e-12)
        off = np.linalg.norm(points - points[:, :1] - way * along.clip(0, 1), axis=0).max() * 1000
        assert off <= made(whole).arcs.bulge[0]


def test_a_flat_arc_has_a_small_bulge() -> None:
    # The sagitta of 10 mm on a radius of 1 m is 12.5 microns.
    path = Path(at=(-5.0, 0, 0)).arc((5.0, 0, 0), (5.0, -((1000**2 - 25) ** 0.5)), clockwise=True)
    assert made(path.segments()).arcs.bulge[0] == pytest.approx(12.5, abs=3.1)


def test_arcs_behind_starts_of_their_own_lead_to_the_right_vertex() -> None:
    path = Path(at=(0, 0, 0)).arc((2, 0, 0), (1, 0), clockwise=True)
    path.at = (5, 5, 0)
    path.arc((7, 5, 0), (1, 0), clockwise=True).to(9, 9, 9).arc((11, 9, 9), (1, 0), clockwise=False)
    found = made(path.segments())
    assert found.kind.tolist() == [START | CW, CW, START | CW, CW, FEED, CCW]
    assert found.arcs.at.tolist() == [1, 3, 5]


def test_an_arc_that_cannot_be_is_a_gap() -> None:
    found = made(Path(at=(0, 0, 0)).to(5, 5, 0, kind=CW, plane=17).to(6, 5, 0).segments())
    assert (found.kind & START).tolist() == [START, START, 0]
    assert places(found)[1] == (5000, 5000, 0)
    assert len(found.arcs) == 0


def test_an_arc_from_nowhere_is_unknown_until_its_end() -> None:
    path = Path(at=(nan, 0, 0)).to(10, 0, 0, kind=CCW, plane=17, centre=(5.0, 0.0), radius=5.0, end_radius=5.0, sweep=1)
    assert made(path.segments()).unknown.tolist() == [1, 0]


def test_an_arc_around_a_centre_beyond_all_machines_is_straight() -> None:
    far = 3e6
    path = Path(at=(0, 0, 0)).arc((1, 0, 0), (0.5, far), clockwise=False)
    maker = VertexMaker("XYZ")
    found = made(path.segments(), maker=maker)
    assert (found.kind.tolist(), len(found.arcs), maker.straightened) == ([START | CCW, FEED], 0, True)
    assert not maker.out_of_range


def test_pieces_stay_of_moderate_size(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(v, "PIECE_SEGMENTS", 10)
    path = Path(at=(0, 0, 0))
    for at in range(35):
        path.arc((at + 1, 0, 0), (0.5, 0), clockwise=True)
    pieces = list(VertexMaker("XYZ").vertices(path.segments()))
    assert [len(piece) for piece in pieces] == [11, 10, 10, 5]
    whole = joined(pieces)
    assert whole.position[0].tolist() == list(range(0, 36_000, 1000))
    assert whole.arcs.at.tolist() == list(range(1, 36))


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
