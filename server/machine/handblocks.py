"""Blocks by hand, one after the other: what may be typed, and what ends the rest of a request.

Not the waiting and the answers (manual.py). The one rule: between two blocks everything is looked at again; after a
stop, or once somebody else has the control of the machine, the rest of a request is not sent.
"""

import re
from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

from protocol.commands import RunBlock
from protocol.events import CommandFailed
from server.machine.manual import Make
from server.problems import ProblemError

if TYPE_CHECKING:
    from server.machine.controller import Controller

Result = dict[str, Any]

_COMMENT = re.compile(r"\([^)]*\)|;.*")


async def run(controller: "Controller", blocks: Sequence[str]) -> list[Result]:
    """Run blocks; a result for each that was sent. Raises ProblemError, with the `results` so far."""
    controller.check_by_hand()
    for block in blocks:
        _check(controller, block)
    results: list[Result] = []
    with controller.manual.row() as row:
        control = controller.control

        def go_on() -> None:
            row.check()
            controller.check_by_hand()
            if controller.control is not control and (holder := controller.control) is not None:
                raise ProblemError(
                    "control_held", f"{holder['name']} has taken the control of {controller.name}.", holder=holder
                )

        for block in blocks:
            try:
                error = await _run_one(controller, block, go_on)
            except ProblemError as problem:
                told = f"{problem.detail} {len(results)} of {len(blocks)} blocks were executed for certain."
                raise ProblemError(problem.code, told, **{**problem.extra, "results": results}) from problem
            results.append({"block": block, "ok": error is None, "error": error})
            if error is not None:
                break
    return results


def _check(controller: "Controller", block: str) -> None:
    """Raises ProblemError."""
    verbs = controller.verbs
    if not block.strip() or not block.isprintable() or verbs.forbidden & set(block):
        raise ProblemError("invalid_request", f"{block!r} is not one block of G-code.")
    # Digits of other scripts look like digits to people, and to some readers; a controller has never heard of them.
    if not _COMMENT.sub("", block).isascii():
        raise ProblemError("invalid_request", f"{block!a} has characters outside a comment that are no G-code.")
    if verbs.system is not None and block.lstrip().startswith(verbs.system):
        advice = "the settings, the offsets, homing and the rest have addresses of their own."
        raise ProblemError("invalid_request", f"{block!r} is a system command and no G-code: {advice}")


async def _run_one(controller: "Controller", block: str, go_on: Callable[[], None]) -> Result | None:
    """What was wrong with it, or None. Raises ProblemError."""
    go_on()
    makes: list[Make] = [partial(RunBlock, blocks=(block.strip(),))]
    if controller.hand is not None:
        try:
            makes = controller.hand.commands(block, controller.program_position)
        except ProblemError as problem:
            return {"code": None, "message": problem.detail}
    for make in makes:
        go_on()
        end = (await controller.ask(make)).end
        if isinstance(end, CommandFailed):
            return {"code": end.code, "message": end.message}
    controller.tools.typed(block, turret=controller.hand is not None)
    return None
