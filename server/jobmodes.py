"""How a job is run where a protocol gives a choice: for real or through the controller's own check; after a refusal.

Not the running (jobs/runner.py). The one rule: a machine that was put into check mode for a job is taken out of it
when the job ends, however it ends, as long as it can be reached.
"""

import asyncio
import logging
from collections.abc import Sequence
from functools import partial
from typing import Any

from jobs.delivery import Policy
from jobs.store import Row
from protocol.commands import CheckMode, OnError
from protocol.events import CommandFailed
from server.controller import Controller
from server.problems import ProblemError

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


async def enter(controller: Controller, row: Row) -> None:
    """Before the first line of a check goes out. Raises ProblemError."""
    if Policy.of(row).check:
        answer = await controller.ask(partial(CheckMode, on=True))
        if isinstance(answer.end, CommandFailed):
            raise ProblemError("command_failed", f"{controller.name} cannot check: {answer.end.message}.")


async def leave(controller: Controller) -> None:
    """After the last one. A reset, which is what a stop is, has left it already."""
    if not _in_check(controller):
        return
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
            return
        await asyncio.sleep(LOOK_EVERY_S)


def _in_check(controller: Controller) -> bool:
    return controller.state.status == "check"
