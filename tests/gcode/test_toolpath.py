"""The binary drawing: what is written is what a reader of docs/toolpath.md reads, to the byte."""

from math import isnan, nan
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcode import toolpath as t
from gcode.segments import CCW, CW, DWELL, FEED, HOMING, PROBE, RAPID, Segments
from gcode.toolpath import HEAD, for_level, head_bytes, levels_in, toolpath
from tests.harness.segmentrows import Path, through
from tests.harness.toolpathreader import START, Drawing, read_toolpath


def file(data: bytes, level: int = 0) -> bytes:
    """The answer of the route: the head for this level, and its blocks."""
    length = head_bytes(data[: HEAD.size])
    sizes = [found.bytes for found in levels_in(data[:length])]
    begin = length + sum(sizes[:level])
    assert length + sum(sizes) == len(data)
    return for_level(data[:length], level) + data[begin : begin + sizes[level]]


def drawn(*parts: Segments, level: int = 0) -> Drawing:
    return read_toolpath(file(toolpath(parts, parts[0].axes), level))


def near(found: tuple[float, ...], place: tuple[float, ...]) -> bool:
    return all(abs(a - b) <= 0.000501 for a, b in zip(found, place, strict=True) if not isnan(b))


coordinate = st.one_of(
    st.floats(-3000, 3000), st.sampled_from([0.0, nan, 32.767, 32.768, -32.768, 8388.607, 8388.608, -2.1e6])
)
ways = st.tuples(
    st.tuples(*[coordinate] * 4),
    st.sampled_from([RAPID, FEED, HOMING, PROBE, DWELL]),
    st.one_of(st.just(nan), st.floats(0.125, 65536, width=32)),
    st.integers(-1, 3),
    st.integers(1, 2**31 - 1),
)


@settings(max_examples=150, deadline=None)
@given(st.lists(ways, min_size=1, max_size=40), st.integers(1, 40))
def test_what_is_read_is_what_was_written(rows: list[Any], cut: int) -> None:
    path = Path(axes="XYZA")
    for place, kind, path.feed, path.tool, line in rows:
        path.to(*(path.at if kind == DWELL else place), kind=kind, line=line)
    whole = path.segments()
    data = toolpath((whole.take(slice(at, at + cut)) for at in range(0, len(whole), cut)), "XYZA")
    wanted = [row for row in path.rows if row["kind"] != DWELL]
    if not wanted:
        return
    found = read_toolpath(file(data))
    # The ways are one after the other, so there is one start, and then one vertex a way.
    assert len(found.line) == len(wanted) + 1
    assert found.kind[0] == START | wanted[0]["kind"]
    assert found.unknown[0] == 0b1111
    for at, row in enumerate(wanted, 1):
        end: Any = row["end"]
        assert near(found.places[at], end)
        assert found.unknown[at] == sum(1 << axis for axis, value in enumerate(end) if isnan(value))
        assert (found.line[at], found.kind[at], found.tool[at]) == (row["line"], row["kind"], row["tool"])
        assert found.feed[at] == row["feed"] or (isnan(found.feed[at]) and row["feed"] != row["feed"])
    assert found.head["last_line"] == max(row["line"] for row in wanted)
    assert found.head["segments"] == len(wanted)


def test_cutting_the_program_into_pieces_changes_nothing() -> None:
    rng = np.random.default_rng(5)
    whole = through(np.cumsum(rng.normal(0, 0.3, (3, 5001)), axis=1))
    pieces = [whole.take(slice(at, at + 617)) for at in range(0, 5000, 617)]
    assert toolpath(pieces, "XYZ") == toolpath([whole], "XYZ")


def test_arcs_between_lines() -> None:
    path = Path(at=(0, 0, 0), feed=500).to(10, 0, 0).arc((20, 10, -1), (0, 10), clockwise=False).to(20, 30, -1)
    found = drawn(path.segments())
    assert [found.kind.index(kind) for kind in (FEED, CCW)] == [1, 2]
    assert found.line == sorted(found.line)
    assert len(found.edges()) == len(found.line) - 1
    arc = list(found.along(2, 60))
    assert arc[-1] == pytest.approx((20, 10, -1))
    assert [np.hypot(x - 10, y - 10) for x, y, _ in arc] == pytest.approx([10.0] * len(arc), abs=0.001)
    assert arc[29] == pytest.approx((10 + 10 * 0.5**0.5, 10 - 10 * 0.5**0.5, -0.5), abs=0.001)
    assert found.kind == [START | FEED, FEED, CCW, FEED]
    assert CW not in found.kind


@pytest.mark.parametrize("step", [0.1, 30.0, 40.0, 8000.0, 9000.0])
def test_each_width_of_a_difference(step: float) -> None:
    rng = np.random.default_rng(3)
    points = rng.choice([-step, step, step / 3], (3, 3000))
    found = drawn(through(points))
    assert np.abs(np.array(found.places).T - points).max() <= 0.000501


def test_differences_beyond_32_bits() -> None:
    points = np.array([[-2.1e6, 2.1e6, -2.1e6, 2.1e6]] * 3)
    assert np.abs(np.array(drawn(through(points)).places).T - points).max() < 1e-6


def test_lines_that_jump_back_and_forth() -> None:
    path = Path(at=(0, 0, 0))
    lines = [1, 2, 3, 2, 3, 70_000, 5, 2**31 - 1, 1]
    for at, line in enumerate(lines):
        path.to(at, 0, 0, line=line)
    assert drawn(path.segments()).line[1:] == lines


def test_many_tools_and_frames() -> None:
    path = Path(at=(0, 0, 0), frames=[(float(at), 0.0, -1.5) for at in range(300)])
    for at in range(2000):
        path.tool, path.frame = at * 7 % 700 - 1, at % 300
        path.to(at % 5, 0, 0)
    found = drawn(path.segments())
    assert found.tool[1:] == [at * 7 % 700 - 1 for at in range(2000)]
    assert found.frame[1:] == [at % 300 for at in range(2000)]
    assert found.head["frames"][299] == (299.0, 0.0, -1.5)


def test_more_feeds_than_the_table_takes_are_rounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(t, "EXACT_FEEDS", 100)
    monkeypatch.setattr(t, "GATHERED_VERTICES", 50)
    feeds = np.linspace(0, 4000, 1000)
    segments = through(np.arange(3003.0).reshape(3, 1001))
    segments.feed = feeds
    found = drawn(*(segments.take(slice(at, at + 50)) for at in range(0, 1000, 50)))
    assert found.head["flags"] == t.ROUNDED_FEEDS
    assert found.feed[1:50] == pytest.approx(feeds[:49], rel=1e-6)
    assert found.feed[1:] == pytest.approx(feeds, rel=0.005)
    assert len(found.head["feeds"]) < 600


def test_the_head_tells_what_there_is() -> None:
    path = Path(axes="XYZA", at=(0, 0, 5, nan), feed=900, tool=2).to(10, 0, 5, nan, kind=RAPID).to(10, 5, -1, nan)
    head = drawn(path.segments()).head
    assert (head["axes"], head["known_axes"], head["level"], head["flags"]) == ("XYZA", 7, 0, 0)
    assert head["unit"] == 0.001
    assert head["bounds"][2] == pytest.approx((-1, 5, -1, -1))
    assert all(isnan(bound) for bound in head["bounds"][3])
    assert head["tools"] == (2,)
    assert head["feeds"][1:] == (900.0,)
    assert isnan(head["feeds"][0])


def test_a_program_without_motion() -> None:
    for parts in ([], [Path(at=(0, 0, 0)).to(0, 0, 0, kind=DWELL).segments()]):
        found = read_toolpath(file(toolpath(parts, "XYZ")))
        assert (found.line, found.head["segments"]) == ([], 0)
        assert len(found.head["levels"]) == 1


def relief(side: int) -> Segments:
    x, y = np.meshgrid(np.arange(side) * 0.4, np.arange(side) * 0.4)
    x[1::2] = x[1::2, ::-1]
    z = np.round(np.sin(x * 0.21 + y * 0.13) * 2 - 3, 3)
    return through(np.array([x.ravel(), y.ravel(), z.ravel()]))


def test_levels_are_some_of_the_vertices_and_keep_their_bound() -> None:
    data = toolpath([relief(150)], "XYZ")
    finest = read_toolpath(file(data))
    levels = finest.head["levels"]
    assert len(levels) >= 2
    for number, level in list(enumerate(levels))[1:]:
        found = read_toolpath(file(data, number))
        assert found.head["level"] == number
        assert len(found.line) * t.LEVEL_SHARE <= levels[number - 1]["vertices"]
        at = dict(zip(found.line[1:], found.places[1:], strict=True))
        full = np.array(finest.places)
        assert all(np.allclose(full[line], place) for line, place in at.items())
        corners = np.array([0, *at])
        which = np.searchsorted(corners, np.arange(len(full)), "left").clip(1)
        a, b = full[corners[which - 1]], full[corners[which]]
        share = np.sum((full - a) * (b - a), axis=1) / np.maximum(np.sum((b - a) ** 2, axis=1), 1e-12)
        off = np.linalg.norm(full - a - (b - a) * share.clip(0, 1)[:, None], axis=1)
        assert off.max() <= level["tolerance"] + 1e-9


def arcs(count: int, *, largest_mm: float = 60.0) -> Segments:
    """One after the other, in all planes, rising, of all sweeps; sizes and ways as they come."""
    rng = np.random.default_rng(11)
    path = Path(at=(0.0, 0.0, 0.0))
    for _ in range(count):
        radius, begin, end = rng.uniform(0.01, largest_mm), *rng.uniform(0, 2 * np.pi, 2)
        plane = int(rng.choice([17, 18, 19]))
        first, second, along = {17: (0, 1, 2), 18: (2, 0, 1), 19: (1, 2, 0)}[plane]
        centre = (-radius * np.cos(begin), -radius * np.sin(begin))
        place = list(path.at)
        place[first] += centre[0] + radius * np.cos(end)
        place[second] += centre[1] + radius * np.sin(end)
        place[along] += rng.uniform(-1, 1)
        path.arc(tuple(place), centre, clockwise=bool(rng.integers(2)), plane=plane)
    return path.segments()


def pockets(count: int) -> Segments:
    rng = np.random.default_rng(8)
    path = Path(at=(0.0, 0.0, 0.0))
    for _ in range(count):
        x, y, z = rng.uniform(0, 500, 3).round(3)
        path.to(x, y, 5, kind=RAPID).to(x, y, -z / 100)
        for turn in range(4):
            way = np.exp(0.5j * np.pi * turn)
            x, y = x + 40 * way.real, y + 40 * way.imag
            path.to(x, y, -z / 100)
            x, y = x + 5 * (way + 1j * way).real, y + 5 * (way + 1j * way).imag
            path.arc((x, y, -z / 100), ((5j * way).real, (5j * way).imag), clockwise=False)
    return path.segments()


def test_every_arc_is_read_as_it_was_written_in_every_width() -> None:
    for largest_mm in (0.1, 30.0, 8000.0, 100_000.0):
        whole = arcs(3000, largest_mm=largest_mm)
        found = drawn(whole)
        assert list(found.arcs) == list(range(1, 3001))
        for row, arc in enumerate(found.arcs.values()):
            assert arc.plane == whole.plane[row]
            assert arc.sweep == pytest.approx(whole.sweep[row], rel=1e-6)
            assert arc.centre == pytest.approx(whole.centre[:, row], abs=0.000501)


def test_arcs_among_lines_are_found_in_their_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(t, "GATHERED_VERTICES", 3000)
    path = Path(at=(0, 0, 0))
    for at in range(9000):
        if at % 700 == 3 or 4200 < at < 4300:
            path.arc((at + 1, 0, 0), (0.5, float(at % 3)), clockwise=True)
        else:
            path.to(at + 1, 0, 0)
    whole = path.segments()
    found = drawn(*(whole.take(slice(at, at + 1001)) for at in range(0, 9000, 1001)))
    assert {vertex - 1: arc.centre[1] for vertex, arc in found.arcs.items()} == {
        row: row % 3 for row in np.flatnonzero(whole.is_arc).tolist()
    }


def test_arcs_keep_the_bound_of_a_level() -> None:
    whole = arcs(3000, largest_mm=0.4)
    data = toolpath([whole], "XYZ")
    finest = read_toolpath(file(data))
    count = len(finest.head["levels"])
    assert count >= 2
    for number in range(1, count):
        found = read_toolpath(file(data, number))
        at = [0, *found.line[1:]]
        for vertex in range(1, len(at)):
            points = np.array(
                [place for row in range(at[vertex - 1], at[vertex]) for place in finest.along(row + 1, 9)]
            )
            if vertex in found.arcs:
                assert found.arcs[vertex] == finest.arcs[at[vertex]]
                continue
            a, b = np.array(found.places[vertex - 1]), np.array(found.places[vertex])
            share = ((points - a) @ (b - a) / max((b - a) @ (b - a), 1e-12)).clip(0, 1)
            off = np.linalg.norm(points - a - share[:, None] * (b - a), axis=1).max()
            assert off <= found.head["levels"][number]["tolerance"] + 1e-9


def test_a_rung_that_is_hopeless_after_a_good_part_is_not_packed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(t, "GATHERED_VERTICES", 1000)
    monkeypatch.setattr(t, "JUDGED_VERTICES", 2000)
    rng = np.random.default_rng(4)
    points = rng.uniform(0, 100, (3, 9001))
    points[:, 3500:] = np.linspace(points[:, 3500], points[:, 3500] + 50, 5501).T
    whole = through(points)
    encoder = t.ToolpathEncoder("XYZ")
    rungs = [{rung for rung, _ in encoder.add(whole.take(slice(at, at + 1000)))} for at in range(0, 9000, 1000)]
    assert rungs[0] == {0, 1, 2, 3, 4}
    assert rungs[-1] == {0, 4}
    assert encoder.rungs() in ([0], [0, 4])


def test_a_level_that_would_save_little_is_not_kept() -> None:
    rng = np.random.default_rng(9)
    noise = through(rng.uniform(0, 100, (3, 5001)))
    assert len(levels_in(toolpath([noise], "XYZ"))) == 1


def test_size_stays_below_twelve_bytes_a_segment() -> None:
    rng = np.random.default_rng(7)
    count = 20_000
    programs = {
        "relief": relief(142),
        "long strokes": through(rng.uniform(0, 800, (3, count + 1))),
        "pockets with round corners": pockets(2000),
        "short steps": through(np.cumsum(rng.normal(0, 1, (3, count + 1)), axis=1)),
    }
    programs["a feed and a kind for each"] = restless = through(rng.uniform(0, 30, (3, count + 1)))
    restless.feed = rng.uniform(1, 5000, count)
    restless.kind = rng.integers(0, 2, count).astype(np.uint8)
    for name, segments in programs.items():
        data = toolpath([segments], "XYZ")
        head = head_bytes(data)
        tables = 4 * (len(read_toolpath(file(data)).head["feeds"]) - 1)
        # The tables are shared by all: for a million segments they are small change.
        assert (len(data) - min(head, tables)) / len(segments) < 12, name
    # The worst that arcs can be: each in a plane of its own, none like another.
    assert len(toolpath([arcs(5000)], "XYZ")) / 5000 < 24


def test_too_long_a_program_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(t, "MAX_VERTICES", 1000)
    with pytest.raises(t.ToolpathTooLongError, match="line"):
        toolpath([relief(40)], "XYZ")


@pytest.mark.parametrize("start", [b"MSTQ", b"MSTP\x01"])
def test_another_format_is_not_read(start: bytes) -> None:
    with pytest.raises(ValueError, match="no toolpath"):
        head_bytes(start.ljust(HEAD.size, b"\0"))
