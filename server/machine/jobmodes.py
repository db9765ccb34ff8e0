"""How a job is run where a protocol gives a choice: for real or through the controller's own check; after a refusal.

Not the running (jobs/runner.py). The one rule: a machine that was put into check mode for a job is taken out of it
when the job ends, however it ends, as long as it can be reached; and by the next daemon where this one dies, unless a
start-up block would move the machine behind the reset.
"""

import asyncio
import logging
from collections.abc import Sequence
from functools import partial
from typing import Any

from jobs import history, store
from jobs.delivery import Policy
from jobs.store import Row
from protocol.commands import CheckMode, OnError, ReadStartupBlocks
from protocol.events import CommandFailed, StartupBlocksRead
from protocol.grbl.registers import dangers
from server.background.dbthread import Db
from server.clock import Clock, stamp
from server.live.hub import Hub
from server.machine.controller import Controller
from server.problems import ProblemError

ENTERED, LEFT = "check_mode_entered", "check_mode_left"
"""The events of a job's history that say whose the check mode is."""
LEFT_WITHIN_S = 10.0
LOOK_EVERY_S = 0.05

log = logging.getLogger(__name__)


def columns(
    controller: Controller, mode: str = "run", on_error: OnError | None = None, ignored: Sequence[int] | None = None
) -> dict[str, Any]:
    """What a new job's row says of it. Raises ProblemError where the machine knows no such choice."""
    dialect = controller.config.dialect
    if "check_mode" not in controller.verbs.capabilities:
        if mode != "run" or on_error is not None or ignored:
            protocol = controller.config.protocol
            raise ProblemError(
                "not_supported",
                f"{controller.name} speaks {protocol}: a job has no mode, on_error or ignored_errors there.",
            )
        return {"mode": mode, "on_error": None, "ignored_errors": None}
    codes = None if not ignored else ",".join(str(code) for code in sorted(set(ignored)))
    return {"mode": mode, "on_error": on_error or getattr(dialect, "on_error", None), "ignored_errors": codes}


async def enter(controller: Controller, row: Row, db: Db, clock: Clock) -> None:
    """Before the first line of a check goes out. Raises ProblemError."""
    if not Policy.of(row).check:
        return
    # Durable before `$C` goes out: a daemon after this one must know whose check mode it is, and cannot ask for the
    # start-up blocks any more (grbl II.6).
    data = await _startup(controller)
    write = partial(history.append, at=stamp(clock), kind=ENTERED, data=data, machine=controller.name, job=row["id"])
    await db.run(write)
    controller.checking_for = row["id"]
    answer = await controller.ask(partial(CheckMode, on=True))
    if isinstance(answer.end, CommandFailed):
        raise ProblemError("command_failed", f"{controller.name} cannot check: {answer.end.message}.")


async def _startup(controller: Controller) -> dict[str, list[str]]:
    """Its start-up blocks, and what they do behind the reset at the end of the check, beside setting modes."""
    answer = await controller.ask(ReadStartupBlocks)
    if isinstance(answer.end, CommandFailed):
        return {"blocks": [], "dangers": [f"what they do is not known ({answer.end.message})"]}
    blocks = [block for block in answer.only(StartupBlocksRead).blocks if block]
    return {"blocks": blocks, "dangers": [danger for block in blocks for danger in dangers(block)]}


async def warnings(db: Db, row: Row) -> list[dict[str, str]]:
    """What somebody who has queued a check should know: what runs behind it. Empty where nothing does."""
    if not Policy.of(row).check:
        return []
    entered = await db.run(history.newest, row["id"], ENTERED)
    if entered is None:
        text = "Whether it has start-up blocks is asked when the check begins; those run when it has ended."
    elif entered["blocks"] or entered["dangers"]:
        told = ", ".join(entered["blocks"]) or "not known"
        does = f" Beside setting modes: {'; '.join(entered['dangers'])}." if entered["dangers"] else ""
        text = f"The controller resets itself behind the check, and then runs its start-up blocks: {told}.{does}"
    else:
        return []
    return [{"code": "startup_blocks", "message": text}]


async def leave(controller: Controller) -> None:
    """After the last one. A reset, which is what a stop is, has left it already."""
    if _in_check(controller):
        try:
            answer = await controller.ask(partial(CheckMode, on=False))
        except ProblemError as problem:
            log.warning("%s: the check mode is not left: %s", controller.name, problem)
            return
        if isinstance(answer.end, CommandFailed):
            controller.stream.note("check_mode_stays", message=answer.end.message)
            return
        # The controller resets itself behind its ok; until it says so the next job would find it in check mode.
        for _ in range(round(LEFT_WITHIN_S / LOOK_EVERY_S)):
            if not _in_check(controller):
                break
            await asyncio.sleep(LOOK_EVERY_S)
    forget(controller)


def forget(controller: Controller) -> None:
    """The check mode that a job switched on is over, or is somebody else's from now on."""
    job, controller.checking_for = controller.checking_for, None
    if job is not None and controller.link_status == "connected":
        controller.stream.note(LEFT, job=job)


async def left_behind(controller: Controller, db: Db) -> int | None:
    """The job for which a daemon before this one has switched the check mode on, and not off again."""
    row = await db.run(store.last_check, controller.name)
    if row is None or await db.run(history.latest_of, row["id"], ENTERED, LEFT) != ENTERED:
        return None
    job: int = row["id"]
    return job


async def clear_up(controller: Controller, hub: Hub, db: Db) -> None:
    """The machine has answered: leave a check mode that was left behind. Nothing moves by it: the controller stands in
    check mode, and resets itself; where a start-up block would move it then, or may, that is left to people. A check
    that was interrupted keeps it until somebody cancels that job."""
    job = controller.checking_for
    entered = None if job is None else await db.run(history.newest, job, ENTERED)
    if job is None or controller.checking_for != job or controller.stream.active_job is not None:
        return
    found = (entered or {}).get("dangers", ["what they do is not known"])
    if _in_check(controller):
        message = f"{controller.name} is in check mode: for job {job} it was switched on, and the daemon ended before "
        message += "it was switched off."
        if found:
            message += f" Switch it off when nothing is in the way: its start-up blocks run then: {'; '.join(found)}."
        else:
            message += " It is switched off now, and the controller resets itself; G92 and the tool length are gone."
        hub.publish("log", controller.name, {"level": "warning", "kind": "check_mode", "message": message})
        controller.stream.note("check_mode_found", job=job, left=not found)
        if found:
            return
    await leave(controller)


def _in_check(controller: Controller) -> bool:
    return controller.state.status == "check"
