"""What a controller holds at this moment: its modes, its offsets, where it stands; asked for before a job is planned.

Not what a program makes of it (gcode/held.py). The one rule: what it does not answer is not known, and that is no
fault: whoever plans with it leaves nothing out then.
"""

import asyncio
import logging
from dataclasses import replace
from typing import TypeVar

from gcode.held import Held, Offsets
from jobs import history
from jobs.store import Row
from protocol.commands import ReadModal, ReadOffsets
from protocol.events import CommandFailed, Event, ModalRead, OffsetsRead
from server.background.dbthread import Db
from server.machine.controller import Controller
from server.machine.manual import Make
from server.problems import ProblemError

log = logging.getLogger(__name__)

ANSWERED_WITHIN_S = 5.0
"""Both questions take some 50 ms; a controller that is busy with something else is not waited for."""
ANSWERS_IN = frozenset({"idle", "alarm"})
"""Elsewhere `$#` is refused, or waits (grbl II.6)."""

STARTED_IN = "modes_at_start"
"""The event of a job's history that says what the controller held when it began."""

E = TypeVar("E", bound=Event)


async def held_by(controller: Controller) -> Held | None:
    """None where the protocol has no such questions. Of a machine that has no modes, where it stands."""
    if controller.hand is not None:
        return Held((), None, dict(controller.program_position))
    if "modal" not in controller.verbs.capabilities:
        return None
    modal: tuple[str, ...] = ()
    offsets: Offsets | None = None
    if controller.link_status == "connected" and controller.state.status in ANSWERS_IN:
        read = await _ask(controller, ReadModal, ModalRead)
        told = await _ask(controller, ReadOffsets, OffsetsRead)
        modal = () if read is None else read.words
        offsets = None if told is None else told.offsets
    return Held(modal, offsets, dict(controller.program_position))


async def began_in(db: Db, row: Row) -> Held | None:
    """What the controller held when a job began, and where it stood if that was at the first line; None: not known."""
    data = await db.run(history.newest, row["id"], STARTED_IN)
    if data is None:
        return None
    held = Held.from_json(data)
    return held if row["start_line"] == 1 else replace(held, position={})


async def _ask(controller: Controller, make: Make, kind: type[E]) -> E | None:
    try:
        answer = await asyncio.wait_for(controller.ask(make), ANSWERED_WITHIN_S)
    except (ProblemError, TimeoutError) as error:
        log.info("%s: not told what it holds: %s", controller.name, str(error) or "no answer in time")
        return None
    return None if isinstance(answer.end, CommandFailed) else answer.only(kind)
