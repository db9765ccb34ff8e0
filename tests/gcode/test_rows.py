"""The builder of segments: frames that stay true, arcs that are worked out when they are taken."""

from math import nan, pi

import numpy as np
import pytest

from gcode.rows import ArcWords, Row, Rows
from gcode.segments import CCW, CW, FEED, joined


def line(number: int, start: list[float], end: list[float], frame: int = 0, **more: object) -> Row:
    return Row(number, FEED, start, end, 100.0, 0.0, -1, False, frame)._replace(**more)


def test_taking_empties_the_builder() -> None:
    rows = Rows("XYZ")
    assert len(rows.take()) == 0
    rows.add(line(3, [0, 0, 0], [1, 2, 3]))
    assert len(rows) == 1
    segments = rows.take()
    assert (segments.axes, list(segments.line), segments.end[:, 0].tolist()) == ("XYZ", [3], [1, 2, 3])
    assert np.isnan(segments.sweep).all()
    assert len(rows) == len(rows.take()) == 0


def test_frames_are_counted_once_and_go_on() -> None:
    rows = Rows("XY")
    assert [rows.frame_of(frame) for frame in ((0.0, 0.0), (1.0, 0.0), (0.0, 0.0))] == [0, 1, 0]
    rows.add(line(1, [0, 0], [1, 0], frame=1))
    first = rows.take()
    assert rows.frame_of((5.0, 5.0)) == 2
    rows.add(line(2, [1, 0], [2, 0], frame=2))
    both = joined([first, rows.take()])
    assert [both.frames[row] for row in both.frame] == [(1.0, 0.0), (5.0, 5.0)]


def test_arcs_by_centre_radius_and_turns() -> None:
    rows = Rows("XYZ")
    words = ArcWords(17, (10.0, 10.0), (0.0, 10.0), None, 1)
    rows.add(line(1, [0, 0, 0], [10, 10, 0], kind=CCW, arc=words))
    rows.add(line(2, [0, 0, 0], [10, 10, 0], kind=CW, arc=words._replace(centre=(nan, nan), radius=10.0)))
    rows.add(line(3, [0, 0, 0], [10, 10, 0], kind=CCW, arc=words._replace(turns=3)))
    rows.add(line(4, [0, 0, 0], [10, 10, 0], kind=CW, arc=words._replace(centre=(nan, nan), radius=1.0)))
    rows.add(line(5, [0, 0, 0], [10, 10, 0], kind=CW, arc=None))
    segments = rows.take()
    assert segments.sweep == pytest.approx([pi / 2, -pi / 2, pi / 2 + 4 * pi, nan, nan], nan_ok=True)
    assert segments.radius == pytest.approx([10, 10, 10, nan, nan], nan_ok=True)
    assert list(segments.plane) == [17, 17, 17, 17, 0]
    assert words.at(clockwise=True) == (0.0, 10.0)
    assert words._replace(radius=10.0).at(clockwise=True) == pytest.approx((10.0, 0.0))
    assert words._replace(radius=1.0).at(clockwise=True) is None


def test_inverse_time_becomes_a_feed_by_the_length() -> None:
    rows = Rows("XYZ")
    rows.add(line(1, [0, 0, 0], [3, 4, 0], feed=2.0, inverse=True))
    rows.add(line(2, [3, 4, 0], [0, 0, 0], feed=2.0))
    assert rows.take().feed.tolist() == [10.0, 2.0]
