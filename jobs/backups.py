"""Backups of what a controller has stored: kept before each change, compared, put back. Runs inside the db thread.

Not the writing to the controller (server/machine/storedsettings.py). The one rule: a backup is never edited; the same
content twice in a row is one backup, and of many the first is kept for ever, for it is the machine as it was delivered.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, TypeAlias

from sqlite_utils import Database

MOST_PER_MACHINE = 200
"""A backup of grblHAL's 300 settings has 10 KB. At the next one the oldest but the first goes."""
SAME = 0.0005
"""Controllers print at most three decimals."""

Why: TypeAlias = Literal["change", "restore", "defaults"]
"""Before a change by hand, before a backup was put back, before the firmware's own defaults were."""


@dataclass(frozen=True, slots=True)
class Stored:
    """What a controller has stored: settings by number as it prints them. Offsets in mm by name and axis, start-up
    blocks and info text are kept too where the firmware's defaults are about to take their place."""

    settings: Mapping[int, str]
    offsets: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    startup_blocks: tuple[str, ...] = ()
    info: str | None = None

    def text(self) -> str:
        """As JSON, the same for the same content."""
        content = {
            "settings": {str(number): self.settings[number] for number in sorted(self.settings)},
            "offsets": {name: dict(self.offsets[name]) for name in sorted(self.offsets)},
            "startup_blocks": list(self.startup_blocks),
            "info": self.info,
        }
        return json.dumps(content)

    @classmethod
    def read(cls, text: str) -> "Stored":
        """From that JSON."""
        content = json.loads(text)
        settings = {int(number): value for number, value in content["settings"].items()}
        return cls(settings, content["offsets"], tuple(content["startup_blocks"]), content["info"])


@dataclass(frozen=True, slots=True)
class Difference:
    """A setting that is not as in the backup; None: one side does not have it."""

    number: int
    kept: str | None
    present: str | None


def keep(db: Database, machine: str, stored: Stored, *, at: str, why: Why, made_by: str, firmware: str) -> int:
    """Keep a backup, unless the newest one of this machine is the same; its number."""
    text = stored.text()
    newest = next(_of(db, machine, "order by id desc limit 1"), None)
    if newest is not None and newest["content"] == text:
        return int(newest["id"])
    cursor = db.execute(
        """insert into settings_backups (machine, at, why, made_by, firmware, settings, content)
           values (?, ?, ?, ?, ?, ?, ?)""",
        [machine, at, why, made_by, firmware, len(stored.settings), text],
    )
    _prune(db, machine)
    assert cursor.lastrowid is not None
    return cursor.lastrowid


def listing(db: Database, machine: str) -> list[dict[str, Any]]:
    """The backups of a machine without their content, the newest first."""
    return [_head(row) for row in _of(db, machine, "order by id desc")]


def find(db: Database, machine: str, id: int) -> tuple[dict[str, Any], Stored] | None:
    """One backup of this machine and what is in it, or None."""
    row = next(_of(db, machine, "and id = ?", id), None)
    return None if row is None else (_head(row), Stored.read(row["content"]))


def differences(kept: Mapping[int, str], present: Mapping[int, str]) -> list[Difference]:
    """The settings that differ, by number."""
    found = (Difference(number, kept.get(number), present.get(number)) for number in sorted({*kept, *present}))
    return [one for one in found if not same(one.kept, one.present)]


def same(one: str | None, other: str | None) -> bool:
    """Whether two values mean the same: 250 and 250.000 do."""
    if one is None or other is None:
        return one is other
    try:
        return one.strip() == other.strip() or abs(float(one) - float(other)) < SAME
    except ValueError:
        return False


def _of(db: Database, machine: str, rest: str, *values: object) -> Any:
    return db.query(f"select * from settings_backups where machine = ? {rest}", [machine, *values])  # noqa: S608


def _head(row: Mapping[str, Any]) -> dict[str, Any]:
    return {key: row[key] for key in ("id", "at", "why", "made_by", "firmware", "settings")}


def _prune(db: Database, machine: str) -> None:
    db.execute(
        """delete from settings_backups where machine = :machine and id in (
               select id from settings_backups where machine = :machine
               and id > (select min(id) from settings_backups where machine = :machine)
               order by id desc limit -1 offset :kept)""",
        {"machine": machine, "kept": MOST_PER_MACHINE - 1},
    )
