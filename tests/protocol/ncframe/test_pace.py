"""Run times and places by hand-worked numbers."""

import math

import pytest

from protocol.ncframe.codec import Frame
from protocol.ncframe.dialect import Dialect
from protocol.ncframe.pace import Pace


def seconds(dialect: Dialect, *frames: str) -> float | None:
    pace = Pace(dialect)
    took: float | None = None
    for text in frames:
        took = pace.take(Frame.from_text(text))
    return took


@pytest.mark.parametrize(
    ("frames", "expected"),
    [
        (["G0 X50000"], 1.0),  # 50 mm at 3000 mm/min
        (["G1 X3000 Z4000 F100"], 3.0),
        (["G1 X1 F60", "Z-2000"], 2.0),  # modes stay
        (["G1 X1 F60", "F120", "Z-2000"], 1.0),
        (["G2 X2000 R1000 F60"], math.pi),  # half a circle
        (["G3 X1000 Z1000 R1000 F60"], math.pi / 2),
        (["G3 X1000 Z1000 R-1000 F60"], 3 * math.pi / 2),
        (["G4 X1500"], 1.5),
        (["G4"], 0.0),
        (["M3 S7"], 0.0),
        (["X1000"], None),  # at what feed?
        (["G1 X1000"], None),
        (["G1 X1000 F0"], None),
        (["G28 X1000"], None),
    ],
)
def test_run_times(frames: list[str], expected: float | None) -> None:
    assert seconds(Dialect(), *frames) == pytest.approx(expected)


def test_feeds_from_a_table() -> None:
    dialect = Dialect(feed_table=(10.0, 60.0))
    assert seconds(dialect, "G1 X1000 F1") == pytest.approx(1.0)
    assert seconds(dialect, "G1 X1000 F2") is None


def test_after_a_restart_nothing_is_known() -> None:
    pace = Pace(Dialect())
    pace.take(Frame(g=1, f=60))
    pace.forget()
    assert pace.take(Frame(x=1000)) is None


def test_places() -> None:
    pace = Pace(Dialect(diameter=True))
    assert pace.moved(Frame(x=1500, z=-2), {"x": 10.0, "z": 1.0}) == {"x": 13.0, "z": 0.998}
    assert pace.moved(Frame(x=1500), {"z": 1.0}) == {"z": 1.0}
    assert pace.moved(Frame(g=4, x=1500), {"x": 1.0}) == {"x": 1.0}


@pytest.mark.parametrize(
    "wrong",
    [
        {"ack_timeout_s": 0},
        {"enq_tries": 0},
        {"poll_interval_s": -1},
        {"feed_table": (1.0, 0.0)},
        {"feed_table": (1.0,) * 257},
    ],
)
def test_no_machine_is_like_that(wrong: dict[str, object]) -> None:
    with pytest.raises(ValueError, match=r"must be|must not"):
        Dialect(**wrong)  # type: ignore[arg-type]
