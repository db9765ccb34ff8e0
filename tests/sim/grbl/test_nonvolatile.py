"""The EEPROM (grbl II.10)."""

import pytest

from sim.grbl.errors import Refused
from sim.grbl.nonvolatile import COORD_BYTES, FLOAT_BYTES, HAL_TABLE, TABLE, Nonvolatile
from sim.grbl.simsettings import SimSettings


@pytest.fixture
def memory() -> Nonvolatile:
    return Nonvolatile(SimSettings())


def test_the_table_has_a_name_a_unit_and_a_default_for_each(memory: Nonvolatile) -> None:
    assert len(TABLE) == 34
    for number, row in TABLE.items():
        assert row.number == number
        assert row.name
        assert memory[number] == row.default
    assert {row.unit for row in TABLE.values()} == {"us", "ms", "mask", "", "mm", "mm/min", "rpm", "step/mm", "mm/s2"}


@pytest.mark.parametrize(
    ("number", "value", "shown"),
    [
        (11, 0.02, "0.020"),
        (0, 5.7, "5"),
        (13, 3.0, "1"),
        (110, 8000.0, "8000.000"),
        (30, 12000.0, "12000"),
        (23, 7.0, "7"),
    ],
)
def test_how_values_are_kept_and_shown(memory: Nonvolatile, number: int, value: float, shown: str) -> None:
    assert memory.store(number, value) == FLOAT_BYTES
    assert memory.show(number) == shown
    assert memory.store(number, value) == 0


@pytest.mark.parametrize(("number", "value", "code"), [(7, 1, 3), (0, 2.9, 6), (20, 1, 10), (11, -0.1, 4), (7, -1, 4)])
def test_refusals(memory: Nonvolatile, number: int, value: float, code: int) -> None:
    with pytest.raises(Refused) as refused:
        memory.store(number, value)
    assert refused.value.code == code


def test_offsets_and_lines(memory: Nonvolatile) -> None:
    assert memory.store_coord("G54", (1.0, 2.0, 3.0)) == COORD_BYTES
    assert memory.store_coord("G54", (1.0, 2.0, 3.0)) == 0
    assert memory.store_startup(1, "G21") == 5
    assert memory.store_build_info("MINE") == 6
    with pytest.raises(Refused):
        memory.store_startup(2, "G21")
    assert memory.restore("*") > 100
    assert (memory.coords["G54"], memory.startup, memory.build_info) == ((0.0, 0.0, 0.0), ["", ""], "")


def test_grblhal_has_more_of_them() -> None:
    memory = Nonvolatile(SimSettings(flavour="grblHAL"))
    assert memory.table is HAL_TABLE
    assert memory.show(0) == "10.0"
    assert memory[10] == 511
    assert "G59.3" in memory.coords
    with pytest.raises(Refused) as refused:
        memory.store(110, 0.0)
    assert refused.value.code == 19
