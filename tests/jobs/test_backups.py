"""Backups of a controller's settings: kept, found, compared, bounded."""

import sqlite3
from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st
from sqlite_utils import Database

from jobs import backups
from jobs.backups import MOST_PER_MACHINE, Difference, Stored, Why
from jobs.schema import prepare


@pytest.fixture
def db() -> Iterator[Database]:
    opened = Database(sqlite3.connect(":memory:"))
    prepare(opened)
    yield opened
    opened.close()


def keep(db: Database, value: str, *, machine: str = "router", why: Why = "change") -> int:
    stored = Stored({0: value, 110: "500.000"})
    return backups.keep(db, machine, stored, at="2026-03-01T09:00:00.000Z", why=why, made_by="ann", firmware="1.1h")


def test_a_backup_comes_back_as_it_was_kept(db: Database) -> None:
    stored = Stored({110: "500.000", 0: "10"}, {"G54": {"x": 1.5}}, ("G21", ""), "MYMILL")
    id = backups.keep(db, "router", stored, at="T", why="defaults", made_by="ann", firmware="grbl 1.1h")
    found = backups.find(db, "router", id)
    assert found == (
        {"id": id, "at": "T", "why": "defaults", "made_by": "ann", "firmware": "grbl 1.1h", "settings": 2},
        stored,
    )


def test_a_backup_belongs_to_its_machine(db: Database) -> None:
    id = keep(db, "10")
    assert backups.find(db, "lathe", id) is None
    assert backups.find(db, "router", id + 1) is None
    assert backups.listing(db, "lathe") == []


def test_the_same_content_twice_in_a_row_is_one_backup(db: Database) -> None:
    first = keep(db, "10")
    assert keep(db, "10") == first
    assert keep(db, "10", machine="lathe") != first, "another machine has its own"
    assert keep(db, "11") != first
    assert keep(db, "10") != first, "it came back: that is news"
    assert len(backups.listing(db, "router")) == 3


def test_of_many_the_first_and_the_newest_are_kept(db: Database) -> None:
    other = keep(db, "0", machine="lathe")
    ids = [keep(db, str(number)) for number in range(MOST_PER_MACHINE + 5)]
    kept = [one["id"] for one in backups.listing(db, "router")]
    assert kept == [*reversed(ids[-(MOST_PER_MACHINE - 1) :]), ids[0]]
    assert backups.find(db, "lathe", other) is not None


def test_differences_are_told_by_number_and_by_value() -> None:
    kept = {0: "10", 11: "0.010", 22: "1", 110: "500.000", 341: "0"}
    present = {0: "10", 11: "0.011", 22: "1", 110: "500", 999: "7"}
    assert backups.differences(kept, present) == [
        Difference(11, "0.010", "0.011"),
        Difference(341, "0", None),
        Difference(999, None, "7"),
    ]


@pytest.mark.parametrize(
    ("one", "other", "expected"),
    [
        ("250", "250.000", True),
        ("0.010", "0.011", False),
        ("AP", "AP ", True),
        ("ap", "AP", False),
        ("nan", "nan", True),
    ],
)
def test_what_is_the_same_value(one: str, other: str, expected: bool) -> None:
    assert backups.same(one, other) is expected


@given(
    st.dictionaries(st.integers(0, 999), st.text(max_size=20)),
    st.dictionaries(st.sampled_from(["G54", "G28"]), st.dictionaries(st.sampled_from("xyz"), st.floats(-1e6, 1e6))),
)
def test_read_is_the_inverse_of_text(settings: dict[int, str], offsets: dict[str, dict[str, float]]) -> None:
    stored = Stored(settings, offsets, ("G21",), None)
    assert Stored.read(stored.text()) == stored
    assert backups.differences(settings, settings) == []
