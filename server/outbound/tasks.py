"""Ending tasks for good. Not starting them.

The one rule: it returns when they have ended. Before Python 3.12 `asyncio.wait_for` may swallow a cancellation that
comes in the moment of its answer, so a task is asked again until it has heard.
"""

import asyncio
from collections.abc import Sequence
from contextlib import suppress
from typing import Any

ASKED_AGAIN_S = 0.1


async def end(tasks: Sequence["asyncio.Task[Any]"]) -> None:
    """Cancel them and wait; what they raise is not told."""
    while waiting := [task for task in tasks if not task.done()]:
        for task in waiting:
            task.cancel()
        await asyncio.wait(waiting, timeout=ASKED_AGAIN_S)
    for task in tasks:
        with suppress(asyncio.CancelledError):
            task.exception()
