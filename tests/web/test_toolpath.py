"""web/toolpath.js reads what the encoder writes. Needs node; says so where it is not there."""

import itertools
import json
import shutil
import subprocess
from math import isnan, nan
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gcode.segments import RAPID, Segments
from gcode.toolpath import for_level, head_bytes, levels_in, toolpath
from tests.harness.segmentrows import Path as Way
from tests.harness.segmentrows import through
from tests.harness.toolpathreader import START, Drawing, read_toolpath

HERE = Path(__file__).parent
MODULE = HERE.parents[1] / "web" / "toolpath.js"
NODE = shutil.which("node")

pytestmark = [
    pytest.mark.real,
    pytest.mark.skipif(NODE is None, reason="node is not installed: web/toolpath.js was NOT tested here"),
]


def decoded(folder: Path, data: bytes, **options: float) -> dict[str, Any]:
    assert NODE is not None
    file = folder / "a.toolpath"
    file.write_bytes(data)
    # Node takes a .js without a package.json for CommonJS; a browser never does.
    module = folder / "toolpath.mjs"
    module.write_bytes(MODULE.read_bytes())
    command = [NODE, HERE / "decode.mjs", module, file, json.dumps(options)]
    done = subprocess.run(command, capture_output=True, check=True, text=True)
    answer: dict[str, Any] = json.loads(done.stdout)
    return answer


def files(*parts: Segments) -> list[bytes]:
    data = toolpath(parts, parts[0].axes)
    length = head_bytes(data)
    found, at = [], length
    for number, level in enumerate(levels_in(data[:length])):
        found.append(for_level(data[:length], number) + data[at : at + level.bytes])
        at += level.bytes
    return found


def compare(folder: Path, data: bytes, **options: float) -> dict[str, Any]:
    """The same as the reader in Python, column by column, with as many corners on each edge."""
    wanted, found = read_toolpath(data), decoded(folder, data, **options)
    parts = parts_of(wanted, found["lines"])
    source = np.repeat(np.arange(len(parts)), parts).tolist()
    for name, column in (
        ("lines", wanted.line), ("kinds", wanted.kind), ("tools", wanted.tool), ("frames", wanted.frame),
        ("unknown", wanted.unknown),
    ):  # fmt: skip
        assert found[name] == [column[at] for at in source], name
    feeds = [nan if feed == "NaN" else feed for feed in found["feeds"]]
    assert np.array_equal(feeds, [wanted.feed[at] for at in source], equal_nan=True)
    edges = set(wanted.edges())
    assert found["edges"] == [int(at in edges) for at in source]
    axes = wanted.head["axes"]
    assert found["head"]["axes"] == axes
    places = [wanted.places[:1], *(wanted.along(at, count) for at, count in enumerate(parts) if at)]
    corners = np.array([corner for some in places for corner in some])
    for offset, letter in enumerate("XYZ"):
        column = np.array(found["positions"][offset::3]) + found["origin"][offset]
        assert np.abs(column - (corners[:, axes.index(letter)] if letter in axes else 0.0)).max() < 0.0005
    for letter, degrees in found["rotary"].items():
        assert np.allclose(degrees, corners[:, axes.index(letter)], atol=1e-9)
    return found


def parts_of(drawing: Drawing, lines: list[int]) -> list[int]:
    """How many corners the reader made of each vertex. Neighbours with one line are told apart: none was divided."""
    counts = {line: len(list(run)) for line, run in itertools.groupby(lines)}
    shared = {line: len(list(run)) for line, run in itertools.groupby(drawing.line)}
    found = [1 if counts[line] == shared[line] else counts[line] - shared[line] + 1 for line in drawing.line]
    # The first of the vertices of one line is its start.
    return [1 if at == 0 or START & drawing.kind[at] else count for at, count in enumerate(found)]


def test_all_that_there_is(tmp_path: Path) -> None:
    path = Way(axes="XYZA", frames=[(0.0,) * 4, (10.0, 0.0, -2.0, 0.0)])
    path.to(nan, nan, 5, nan, kind=RAPID).to(1, 2, 5, nan, kind=RAPID)
    path.feed, path.tool = 333.25, 4
    path.to(1, 2, -1, nan).arc((11, 12, -1, nan), (0, 10), clockwise=True)
    path.frame = 1
    path.to(11, 2000, -1, 0).to(11, 2000, -1, 720, line=300).to(-7000, 3, 1, 90, line=40)
    data = files(path.segments())[0]
    found = compare(tmp_path, data)
    assert found["rotary"]["A"][-1] == 90
    assert isnan(read_toolpath(data).feed[0])
    assert found["feeds"][-1] == 333.25


def test_many_blocks_and_every_level(tmp_path: Path) -> None:
    angle = np.linspace(0, 300, 20_000)
    spiral = through(np.array([angle * np.cos(angle), angle * np.sin(angle), np.round(angle / 10) * 0.1]))
    levels = files(spiral)
    assert len(levels) > 1
    for number, data in enumerate(levels):
        assert compare(tmp_path, data)["head"]["level"] == number


@pytest.mark.parametrize("step", [0.05, 20.0, 5000.0, 2e6])
def test_each_width(tmp_path: Path, step: float) -> None:
    rng = np.random.default_rng(2)
    data = files(through(rng.choice([-step, step, step / 3], (3, 1500))))[0]
    if step < 1e6:
        compare(tmp_path, data)
    else:
        # Kilometres away float32 has no microns left; near the middle of the bounds it would.
        assert decoded(tmp_path, data)["lines"][-1] == 1499


def test_far_from_zero_the_origin_saves_the_microns(tmp_path: Path) -> None:
    points = np.array([[100_000.001, 100_000.002, 100_001.003], [0.0, 0.001, 5.0], [0.0, 0.0, 0.0]])
    data = files(through(points))[0]
    assert compare(tmp_path, data)["origin"] in ([100_000, 0, 0], [100_001, 0, 0])


@pytest.mark.parametrize("plane", [17, 18, 19])
def test_arcs_become_chords_within_the_tolerance(tmp_path: Path, plane: int) -> None:
    path = Way(at=(1.0, 2.0, 3.0))
    first, second, along = {17: (0, 1, 2), 18: (2, 0, 1), 19: (1, 2, 0)}[plane]
    place = [1.0, 2.0, 3.0]
    for radius, clockwise in ((0.004, False), (0.5, True), (20.0, False), (300.0, True)):
        place[first] += radius
        place[second] += radius
        place[along] += 1
        path.arc(tuple(place), (radius, 0.0), clockwise=clockwise, plane=plane)
        path.arc(tuple(place), (0.0, -radius), clockwise=not clockwise, plane=plane)  # a whole turn
        place[first] += 1
        path.to(*place)
    data = files(path.segments())[0]
    counts = []
    for chord_mm in (0.02, 0.2):
        found = compare(tmp_path, data, chordMm=chord_mm)
        counts.append(len(found["lines"]))
        corners = np.array(found["positions"]).reshape(-1, 3)
        lines = np.array(found["lines"])
        for line, radius in ((2, 0.004), (5, 0.5), (8, 20.0), (11, 300.0)):
            turn = corners[np.flatnonzero(lines == line)[0] - 1 : np.flatnonzero(lines == line)[-1] + 1]
            assert len(turn) >= 9, "a circle stays one"
            middles = (turn[1:] + turn[:-1]) / 2
            centre = turn[:-1].mean(axis=0)
            assert radius - np.linalg.norm(middles - centre, axis=1).min() < chord_mm + 0.002
    assert counts[1] < counts[0] < 1000


def test_an_arc_that_does_not_close_is_a_spiral(tmp_path: Path) -> None:
    data = files(Way(at=(10, 0, 0)).arc((0, 13, 0), (-10, 0), clockwise=False).segments())[0]
    radii = np.hypot(*np.array(compare(tmp_path, data)["positions"]).reshape(-1, 3)[:, :2].T)
    assert np.all(np.diff(radii) > 0)
    assert radii[-1] == pytest.approx(13)


def test_a_turn_of_a_rotary_axis_is_divided(tmp_path: Path) -> None:
    path = Way(axes="XYZA", at=(0, 0, 5, 0)).to(10, 0, 5, 90).to(10, 0, 5, -630)
    data = files(path.segments())[0]
    found = compare(tmp_path, data)
    assert found["rotary"]["A"] == pytest.approx([*range(0, 90, 5), *range(90, -635, -5)])
    assert found["positions"][3 * 9] == pytest.approx(5.0), "half of the way at half of the turn"
    assert len(decoded(tmp_path, data, turnDegrees=30)["lines"]) == 1 + 3 + 24


def test_arcs_among_lines_in_many_blocks(tmp_path: Path) -> None:
    path = Way(at=(0, 0, 0))
    for at in range(5000):
        if at % 700 == 3 or 2200 < at < 2300:
            path.arc((at + 1, 0, at % 9), (0.5, float(at % 3) * 100), clockwise=True)
        else:
            path.to(at + 1, 0, at % 9)
    for data in files(path.segments()):
        compare(tmp_path, data)


def test_so_many_arcs_that_all_get_coarser(tmp_path: Path) -> None:
    path = Way(at=(500, 0, 0))
    for _ in range(6000):
        path.arc((500, 0, 0), (-500, 0), clockwise=False)
    found = decoded(tmp_path, files(path.segments())[0], chordMm=0.00005, onlyCount=1)
    assert 6000 * 8 < found["corners"] <= 4_100_000
    assert found["chordMm"] > 0.00005


def test_no_motion_at_all(tmp_path: Path) -> None:
    assert decoded(tmp_path, toolpath([], "XYZ"))["positions"] == []


def test_anything_else_is_refused(tmp_path: Path) -> None:
    data = files(Way(at=(0, 0, 0)).to(1, 0, 0).segments())[0]
    for wrong in (b"", b"G21\n", data[:4] + b"\x09" + data[5:], data + bytes(4)):
        assert "toolpath" in decoded(tmp_path, wrong)["error"]
