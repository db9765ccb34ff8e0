"""What real programs have that trips readers: a small file of our own for each, with what is to be said of it."""

import pytest

from gcode.profile import profile_names
from tests.gcode.trap_findings import HEAD, TABLE, TRAPS, features, rows

EXPECTED = TABLE.read_text(encoding="utf-8").splitlines(keepends=True)


def test_every_file_is_a_trap_for_something() -> None:
    assert {path.name for path in TRAPS.glob("*.nc")} == set(features())


@pytest.fixture(scope="module")
def said() -> list[str]:
    return list(rows())


@pytest.mark.parametrize("name", sorted(features()))
def test_trap(name: str, said: list[str]) -> None:
    expected = [row for row in EXPECTED[1:] if row.split("\t")[1] == name]
    assert [row for row in said if row.split("\t")[1] == name] == expected
    assert sorted(profile for row in expected for profile in row.split("\t")[2].split()) == sorted(profile_names())


def test_the_table_has_nothing_else(said: list[str]) -> None:
    assert [HEAD, *said] == EXPECTED
