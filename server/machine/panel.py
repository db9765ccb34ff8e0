"""All that people read, write and press at one controller beside its jobs, put together for the API.

Not the machine's verbs (controller.py). The one rule: on a machine whose protocol has nothing of the kind everything
here is refused by name (`not_supported`) before anything is sent.
"""

from typing import Any, Literal

from protocol.grbl import registers
from server.background.dbthread import Db
from server.clock import Clock
from server.machine import grblviews, jobmodes
from server.machine.controller import Controller
from server.machine.enquiries import RESTORE, WRITE_INFO, WRITE_OFFSET, WRITE_STARTUP, Enquiries
from server.machine.storedsettings import StoredSettings
from server.machine.switches import Switches
from server.problems import ProblemError

Json = dict[str, Any]


class Panel:
    """Of one machine. Made on the loop. Every method raises ProblemError."""

    def __init__(self, controller: Controller, *, db: Db, clock: Clock) -> None:
        self._controller = controller
        self._name = controller.name
        self._enquiries = Enquiries(controller)
        self.settings = StoredSettings(controller, self._enquiries, db=db, clock=clock)
        self.switches = Switches(controller)

    # --- firmware -----------------------------------------------------------------------------------------------

    async def firmware(self) -> Json:
        """What the controller is (api.md)."""
        return grblviews.firmware_view(self._name, await self._enquiries.firmware())

    async def write_info(self, text: str, *, by: str) -> Json:
        """Store the info text; the firmware as it is read back, with a warning where the text was changed."""
        self._enquiries.check(WRITE_INFO)
        wrong = registers.unsendable("$I=", text)
        if wrong is not None:
            raise ProblemError("invalid_request", f"The info text cannot be stored: {wrong}.")
        await self._enquiries.write_info(text)
        self._controller.stream.note("info_changed", by=by, text=text)
        view = await self.firmware()
        return {**view, "warnings": [*grblviews.info_warnings(text, view["info"]), *view["warnings"]]}

    # --- modal state and offsets --------------------------------------------------------------------------------

    async def modal(self) -> Json:
        """Every modal group by name."""
        return grblviews.modal_view(self._name, await self._enquiries.modal())

    async def offsets(self) -> Json:
        """Offsets by name, and the last probing."""
        return grblviews.offsets_view(self._name, await self._enquiries.offsets())

    async def set_offset(
        self, system: str, mode: Literal["here", "absolute"], axes: dict[str, float], *, by: str
    ) -> Json:
        """Set a work offset, or store a place (G28, G30) where the machine stands; the offsets as they are then."""
        self._enquiries.check(WRITE_OFFSET)
        if system in registers.PLACES:
            block = registers.PLACES[system]
        else:
            words = (await self._enquiries.modal()).words
            block = registers.offset_block(system, mode, axes, inches="G20" in words)
        return await self._run(block, by)

    async def clear_offset(self, name: str, *, by: str) -> Json:
        """Clear G92 or the tool length; the offsets as they are then."""
        return await self._run(registers.CLEARS[name], by)

    async def _run(self, block: str, by: str) -> Json:
        await self._enquiries.run_offset_block(block)
        self._controller.stream.note("offset_changed", by=by, block=block)
        return await self.offsets()

    # --- start-up blocks ----------------------------------------------------------------------------------------

    async def startup_blocks(self) -> Json:
        """In their order; an empty one is there and does nothing."""
        return _startup_view(self._name, await self._enquiries.startup_blocks(), [])

    async def write_startup_blocks(self, blocks: list[str], *, force: bool, by: str) -> Json:
        """Store all start-up blocks; those that are not named are emptied. Only what differs is written, one by one."""
        self._enquiries.check(WRITE_STARTUP)
        before = await self._enquiries.startup_blocks()
        wanted = _judged(self._name, blocks, len(before))
        warnings = _dangers(wanted)
        if warnings and not force:
            raise ProblemError(
                "needs_force",
                f"Nothing was written. {'; '.join(warnings)}: after every reset, and at once when it is written. "
                "With force it is written all the same.",
                warnings=warnings,
            )
        kept = registers.kept_text
        changed = [index for index, block in enumerate(wanted) if kept(block) != kept(before[index])]
        for index in changed:
            await self._enquiries.write_startup_block(index, wanted[index])
        if changed:
            warnings.append(f"executed once while written: {', '.join(map(_name, changed))}")
        stored = await self._enquiries.startup_blocks()
        self._controller.stream.note("startup_blocks_changed", by=by, before=list(before), after=list(stored))
        return _startup_view(self._name, stored, warnings)

    # --- modes --------------------------------------------------------------------------------------------------

    async def check_mode(self, *, on: bool) -> None:
        """The controller's parser without motion."""
        await self._enquiries.check_mode(on=on)
        jobmodes.forget(self._controller)

    async def sleep(self, *, by: str) -> None:
        """Motors and spindle off."""
        await self._enquiries.sleep()
        self._controller.stream.note("sent_to_sleep", by=by)

    async def restore(self, what: Literal["settings", "offsets", "all"], confirm: str, *, by: str) -> Json:
        """The firmware's defaults; what was stored is kept first."""
        self._enquiries.check(RESTORE)
        if confirm != self._name:
            raise ProblemError(
                "invalid_request", f"`confirm` must be the machine's name, {self._name!r}; nothing was restored."
            )
        backup = await self.settings.keep("defaults", by=by, everything=True)
        await self._enquiries.restore(what)
        self._controller.stream.note("defaults_restored", by=by, what=what, backup=backup)
        return {"machine": self._name, "restored": what, "backup": backup}


def _name(index: int) -> str:
    return f"N{index}"


def _dangers(blocks: list[str]) -> list[str]:
    return [f"{_name(index)}: {danger}" for index, block in enumerate(blocks) for danger in registers.dangers(block)]


def _startup_view(machine: str, blocks: tuple[str, ...], warnings: list[str]) -> Json:
    return {"machine": machine, "blocks": list(blocks), "warnings": warnings}


def _judged(machine: str, blocks: list[str], room: int) -> list[str]:
    """The blocks for every place of the controller. Raises ProblemError."""
    if len(blocks) > room:
        raise ProblemError("invalid_request", f"{machine} keeps {room} start-up blocks; {len(blocks)} were given.")
    wanted = [*blocks, *[""] * (room - len(blocks))]
    for index, block in enumerate(wanted):
        wrong = registers.unsendable(f"$N{index}=", block)
        if wrong is not None:
            raise ProblemError("invalid_request", f"Start-up block {index + 1} cannot be stored: {wrong}.")
    return wanted
