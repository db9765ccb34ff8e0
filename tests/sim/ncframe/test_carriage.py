"""Ways and times of blocks, by hand-worked numbers."""

import math

import pytest

from sim.ncframe.carriage import Carriage, Impossible
from sim.ncframe.codec import Block
from sim.ncframe.settings import SimSettings


def block(text: str) -> Block:
    return Block(tuple((word[0], int(word[1:])) for word in text.split()))


def took(*texts: str, settings: SimSettings | None = None) -> float:
    carriage = Carriage(settings or SimSettings(auxiliary_s=0.5))
    seconds = 0.0
    for text in texts:
        carriage.x, carriage.z, seconds = carriage.take(block(text))
    return seconds


@pytest.mark.parametrize(
    ("texts", "seconds"),
    [
        (["G0 X50000"], 1.0),
        (["G1 X3000 Z4000 F100"], 3.0),
        (["G1 X3000 Z4000"], 3.0),  # the default feed
        (["G1 X1 F60", "Z2000"], 2.0),
        (["G2 X2000 R1000 F60"], math.pi),
        (["G3 X1000 Z1000 R-1000 F60"], 3 * math.pi / 2),
        (["G2 X0 F60"], 0.0),
        (["G4 X1500"], 1.5),
        (["M3 S5"], 0.5),
        (["T7"], 0.5),
    ],
)
def test_times(texts: list[str], seconds: float) -> None:
    assert took(*texts) == pytest.approx(seconds)


def test_increments_add_up_in_whole_numbers() -> None:
    carriage = Carriage(SimSettings())
    for _ in range(100_000):
        carriage.x, carriage.z, _ = carriage.take(block("X1 Z-3"))
    assert (carriage.x, carriage.z) == (100_000, -300_000)


def test_a_dwell_leads_nowhere() -> None:
    carriage = Carriage(SimSettings())
    assert carriage.take(block("G4 X1500"))[:2] == (0, 0)


@pytest.mark.parametrize("text", ["G2 X3000 R1000", "G2 X3000"])
def test_an_arc_that_does_not_close(text: str) -> None:
    with pytest.raises(Impossible):
        took(text)


def test_limit_switches() -> None:
    carriage = Carriage(SimSettings(travel_x_mm=1.0))
    assert carriage.within(1000, 10**6)
    assert not carriage.within(-1001, 0)


@pytest.mark.parametrize(
    ("setting", "said"),
    [
        ({"check": "crc16"}, "none, xor, crc8"),
        ({"framing": "x"}, "length, gap"),
        ({"gap_s": 0}, "more than 0"),
        ({"boot_s": -1}, "not be negative"),
        ({"rx_bytes": 3}, "at least 16"),
        ({"start_count": -1}, "start_count"),
    ],
)
def test_settings_that_no_machine_has(setting: dict[str, object], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        SimSettings(**setting)  # type: ignore[arg-type]
