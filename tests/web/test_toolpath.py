"""web/toolpath.js reads what the encoder writes. Needs node; says so where it is not there."""

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
from tests.harness.toolpathreader import read_toolpath

HERE = Path(__file__).parent
MODULE = HERE.parents[1] / "web" / "toolpath.js"
NODE = shutil.which("node")

pytestmark = [
    pytest.mark.real,
    pytest.mark.skipif(NODE is None, reason="node is not installed: web/toolpath.js was NOT tested here"),
]


def decoded(folder: Path, data: bytes) -> dict[str, Any]:
    assert NODE is not None
    file = folder / "a.toolpath"
    file.write_bytes(data)
    # Node takes a .js without a package.json for CommonJS; a browser never does.
    module = folder / "toolpath.mjs"
    module.write_bytes(MODULE.read_bytes())
    done = subprocess.run([NODE, HERE / "decode.mjs", module, file], capture_output=True, check=True, text=True)
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


def compare(folder: Path, data: bytes) -> dict[str, Any]:
    """The same as the reader in Python, column by column."""
    wanted, found = read_toolpath(data), decoded(folder, data)
    assert (found["lines"], found["kinds"], found["tools"]) == (wanted.line, wanted.kind, wanted.tool)
    assert (found["frames"], found["unknown"]) == (wanted.frame, wanted.unknown)
    feeds = [nan if feed == "NaN" else feed for feed in found["feeds"]]
    assert np.array_equal(feeds, wanted.feed, equal_nan=True)
    assert [at for at, edge in enumerate(found["edges"]) if edge] == wanted.edges()
    axes = wanted.head["axes"]
    assert found["head"]["axes"] == axes
    for offset, letter in enumerate("XYZ"):
        column = np.array(found["positions"][offset::3]) + found["origin"][offset]
        mm = [place[axes.index(letter)] for place in wanted.places] if letter in axes else 0.0
        assert np.abs(column - mm).max() < 0.0005
    return found


def test_all_that_there_is(tmp_path: Path) -> None:
    path = Way(axes="XYZA", frames=[(0.0,) * 4, (10.0, 0.0, -2.0, 0.0)])
    path.to(nan, nan, 5, nan, kind=RAPID).to(1, 2, 5, nan, kind=RAPID)
    path.feed, path.tool = 333.25, 4
    path.to(1, 2, -1, nan).arc((11, 12, -1, nan), (0, 10), clockwise=True)
    path.frame = 1
    path.to(11, 2000, -1, 0).to(11, 2000, -1, 720, line=300).to(-7000, 3, 1, 90, line=2)
    data = files(path.segments())[0]
    found = compare(tmp_path, data)
    assert found["rotary"]["A"][-3:] == [0, 720, 90]
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


def test_no_motion_at_all(tmp_path: Path) -> None:
    assert decoded(tmp_path, toolpath([], "XYZ"))["positions"] == []


def test_anything_else_is_refused(tmp_path: Path) -> None:
    data = files(Way(at=(0, 0, 0)).to(1, 0, 0).segments())[0]
    for wrong in (b"", b"G21\n", data[:4] + b"\x09" + data[5:], data + bytes(4)):
        assert "toolpath" in decoded(tmp_path, wrong)["error"]
