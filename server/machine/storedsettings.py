"""The settings of one controller: shown with their meaning, changed with a backup before, compared, put back.

Not the `$` lines (enquiries.py), not the rows of backups (jobs/backups.py). The one rule: nothing is written before all
of a change is known to be possible and what stood there is kept; and what was written is told, also when it ends
half-way.
"""

import asyncio
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from jobs import backups
from jobs.backups import Stored, Why
from protocol.events import FirmwareRead
from protocol.grbl.registers import unsendable
from protocol.grbl.settings import SETTINGS, Setting, described, of_grblhal
from protocol.grbl.settings import known as known_setting
from server.background.dbthread import Db
from server.clock import Clock, stamp
from server.machine.controller import Controller
from server.machine.enquiries import READ_SETTINGS, WRITE_SETTING, Enquiries, check_supported
from server.machine.grblviews import settings_view
from server.problems import ProblemError

SOFT_LIMITS: Final = 20
HOMING: Final = 22

Json = dict[str, Any]


@dataclass(slots=True)
class _Write:
    """One setting of a change. `status`: unchanged, waiting, written, failed, not_written."""

    number: int
    asked: str
    before: str
    value: str
    status: str = "waiting"

    def view(self) -> Json:
        setting = SETTINGS.get(self.number)
        return {
            "number": self.number,
            "name": None if setting is None else setting.name,
            "asked": self.asked,
            "before": self.before,
            "value": self.value,
            "status": self.status,
        }


class StoredSettings:
    """Of one controller. Every method but `keep` raises ProblemError for what the controller or the user cannot."""

    def __init__(self, controller: Controller, enquiries: Enquiries, *, db: Db, clock: Clock) -> None:
        self._controller = controller
        self._name = controller.name
        self._enquiries = enquiries
        self._db = db
        self._clock = clock
        self._alone = asyncio.Lock()
        """A change reads, keeps and writes: two at once would each keep half of the other's."""
        self._described: tuple[frozenset[int], Mapping[int, Setting]] = (frozenset(), {})
        """What a grblHAL with these numbers says of its settings: a second of the wire, and never another answer."""

    # --- reading ------------------------------------------------------------------------------------------------

    async def all(self) -> Json:
        """Every setting with what it means (api.md)."""
        values = await self._enquiries.settings()
        return settings_view(self._name, values, await self._known(values))

    async def backups(self) -> list[Json]:
        """The newest first."""
        check_supported(self._controller, READ_SETTINGS.capability)
        return await self._db.read(backups.listing, self._name)

    async def backup(self, id: int) -> Json:
        """One backup, compared with what the controller has now where that can be asked."""
        head, stored = await self._find(id)
        view = {
            **head,
            "values": {str(number): value for number, value in stored.settings.items()},
            "offsets": {name: dict(axes) for name, axes in stored.offsets.items()},
            "startup_blocks": list(stored.startup_blocks),
            "info": stored.info,
        }
        try:
            present = await self._enquiries.settings()
        except ProblemError as problem:
            return {**view, "differences": None, "not_compared": problem.detail}
        return {**view, "differences": _differences(stored.settings, present), "not_compared": None}

    # --- changing -----------------------------------------------------------------------------------------------

    async def change(self, values: Mapping[int, str], *, by: str) -> Json:
        """Write settings; all are judged before the first is written. Ends at the first that fails (`_failed`)."""
        async with self._alone:
            self._enquiries.check(WRITE_SETTING)
            present = await self._enquiries.settings()
            _judge(self._name, values, present, await self._known(present))
            return await self._write(values, present, why="change", by=by)

    async def restore(self, id: int, *, by: str) -> Json:
        """Write what a backup has and the controller has otherwise; numbers that it does not know are left out."""
        async with self._alone:
            self._enquiries.check(WRITE_SETTING)
            _, stored = await self._find(id)
            present = await self._enquiries.settings()
            wanted = {number: value for number, value in stored.settings.items() if number in present}
            done = await self._write(wanted, present, why="restore", by=by)
            return {
                **done,
                "results": [one for one in done["results"] if one["status"] != "unchanged"],
                "left_out": sorted({*stored.settings} - {*present}),
            }

    async def keep(self, why: Why, *, by: str, everything: bool = False) -> int:
        """Keep a backup of what is stored now; `everything`: offsets, start-up blocks and info text too. Its number."""
        enquiries = self._enquiries
        settings = await enquiries.settings()
        firmware = await enquiries.firmware()
        if not everything:
            return await self._keep(Stored(settings), firmware, why, by)
        offsets = (await enquiries.offsets()).offsets
        stored = Stored(settings, offsets, await enquiries.startup_blocks(), firmware.info)
        return await self._keep(stored, firmware, why, by)

    async def _keep(self, stored: Stored, firmware: FirmwareRead, why: Why, by: str) -> int:
        return await self._db.run(
            backups.keep,
            self._name,
            stored,
            at=stamp(self._clock),
            why=why,
            made_by=by,
            firmware=f"{firmware.flavour} {firmware.version} {firmware.build}".strip(),
        )

    async def _known(self, values: Mapping[int, str]) -> Mapping[int, Setting]:
        """What is known of these settings: the tables', and before them what the controller says itself."""
        grblhal = of_grblhal(values)
        table = {number: known for number in values if (known := known_setting(number, grblhal=grblhal)) is not None}
        if not grblhal:
            return table
        numbers = frozenset(values)
        if self._described[0] != numbers:
            try:
                said = await self._enquiries.descriptions()
            except ProblemError as problem:
                if problem.code != "command_failed":
                    return table
                said = ()  # built without them
            self._described = (numbers, {one.number: described(one) for one in said})
        return {**table, **self._described[1]}

    async def _find(self, id: int) -> tuple[Json, Stored]:
        check_supported(self._controller, READ_SETTINGS.capability)
        found = await self._db.read(backups.find, self._name, id)
        if found is None:
            raise ProblemError(
                "unknown_backup",
                f"{self._name} has no backup {id}; GET /api/v1/machines/{self._name}/settings/backups lists them.",
            )
        return found

    async def _write(self, values: Mapping[int, str], present: Mapping[int, str], *, why: Why, by: str) -> Json:
        writes = [_Write(number, values[number], present[number], present[number]) for number in _in_order(values)]
        for write in writes:
            if backups.same(write.asked, write.before):
                write.status = "unchanged"
        waiting = [write for write in writes if write.status == "waiting"]
        if not waiting:
            return {"machine": self._name, "backup": None, "results": _views(writes), "also_changed": []}
        firmware = await self._enquiries.firmware()
        backup = await self._keep(Stored(present), firmware, why, by)
        after = present
        for write in waiting:
            try:
                after = await self._enquiries.write_setting(write.number, write.asked)
            except ProblemError as problem:
                raise self._failed(problem, write, writes, backup, by) from problem
            write.value, write.status = after[write.number], "written"
        self._note(writes, backup, by)
        written = {write.number for write in waiting}
        return {
            "machine": self._name,
            "backup": backup,
            "results": _views(writes),
            "also_changed": [one for one in _differences(present, after) if one["number"] not in written],
        }

    def _failed(self, problem: ProblemError, write: _Write, writes: list[_Write], backup: int, by: str) -> ProblemError:
        """What was refused, and what was and what was not written before and behind it."""
        write.status = "failed"
        for other in writes:
            if other.status == "waiting":
                other.status = "not_written"
        self._note(writes, backup, by)
        written = [f"${other.number}" for other in writes if other.status == "written"]
        so_far = f"Written before it: {', '.join(written)}." if written else "Nothing was written before it."
        return ProblemError(
            problem.code,
            f"${write.number}={write.asked}: {problem.detail} {so_far} Backup {backup} has everything as it was.",
            **{**problem.extra, "results": _views(writes), "backup": backup},
        )

    def _note(self, writes: list[_Write], backup: int, by: str) -> None:
        """Who changed what is in the history, also when it ended half-way."""
        values = {str(one.number): [one.before, one.value] for one in writes if one.status == "written"}
        failed = [one.number for one in writes if one.status == "failed"]
        self._controller.stream.note("settings_changed", by=by, values=values, failed=failed, backup=backup)


def _views(writes: list[_Write]) -> list[Json]:
    return [write.view() for write in writes]


def _in_order(values: Mapping[int, str]) -> list[int]:
    """As they were given, but homing goes first: soft limits cannot be switched on before it (error:10)."""
    return sorted(values, key=lambda number: number != HOMING)


def _differences(kept: Mapping[int, str], present: Mapping[int, str]) -> list[Json]:
    found = []
    for one in backups.differences(kept, present):
        setting = SETTINGS.get(one.number)
        names = {"name": None, "unit": None} if setting is None else {"name": setting.name, "unit": setting.unit}
        found.append({"number": one.number, **names, "before": one.kept, "value": one.present})
    return found


def _judge(machine: str, values: Mapping[int, str], present: Mapping[int, str], known: Mapping[int, Setting]) -> None:
    """Raises ProblemError with everything that is wrong with a change."""
    errors = [
        {"field": f"values.{number}", "message": wrong}
        for number, value in values.items()
        if (wrong := _wrong(number, value, present, known.get(number))) is not None
    ]
    after = {**present, **values}
    if not errors and SOFT_LIMITS in values and _is_on(after, SOFT_LIMITS) and not _is_on(after, HOMING):
        message = f"soft limits need homing: switch ${HOMING} on with it or before"
        errors.append({"field": f"values.{SOFT_LIMITS}", "message": message})
    if errors:
        named = "; ".join(f"${one['field'].removeprefix('values.')}: {one['message']}" for one in errors)
        raise ProblemError("invalid_request", f"Nothing was written to {machine}. {named}.", errors=errors)


def _wrong(number: int, value: str, present: Mapping[int, str], setting: Setting | None) -> str | None:
    if number not in present:
        return "this controller has no such setting"
    return (None if setting is None else setting.valid(value)) or unsendable(f"${number}=", value)


def _is_on(values: Mapping[int, str], number: int) -> bool:
    try:
        return float(values.get(number, "0")) != 0
    except ValueError:
        return False
