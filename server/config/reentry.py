"""`[machine.reentry]` as a model: how a program is taken up in the middle after the controller has forgotten its modes.

Not the plan itself (gcode/resume.py). Keys are what users write; `way()` hands them on under the names of the core. The
one rule: where the machine may move freely is never guessed. Without `clearance` here a request has to say it.
"""

from dataclasses import dataclass
from typing import Annotated

from pydantic import Field

from gcode.reentry import Way
from server.config.section import Section

MAX_CLEARANCE_MM = 10_000
MAX_FEED_MM_MIN = 100_000
MAX_WAIT_S = 600

Clearance = Annotated[float, Field(ge=-MAX_CLEARANCE_MM, le=MAX_CLEARANCE_MM)]
PlungeFeed = Annotated[float, Field(gt=0, le=MAX_FEED_MM_MIN)]
SpindleWait = Annotated[float, Field(ge=0, le=MAX_WAIT_S)]


@dataclass(frozen=True, slots=True)
class ReentryWish:
    """What one request says of it; None: as configured. `blocks`: the plan as somebody has edited it. `operator_done`:
    what only people can do is done. `force`: although the position may be lost."""

    clearance: float | None = None
    clearance_is_machine: bool | None = None
    plunge_feed: float | None = None
    spindle_wait: float | None = None
    blocks: tuple[str, ...] | None = None
    operator_done: bool = False
    force: bool = False


AS_CONFIGURED = ReentryWish()


class ReentryConfig(Section):
    """`[machine.reentry]`. `clearance`: program coordinates, or those of the machine with `clearance_is_machine`."""

    clearance: Annotated[float | None, Field(ge=-MAX_CLEARANCE_MM, le=MAX_CLEARANCE_MM)] = None
    clearance_is_machine: bool = False
    plunge_feed: PlungeFeed = 100.0
    spindle_wait: SpindleWait = 3.0

    def way(self, wish: ReentryWish = AS_CONFIGURED, *, laser: bool) -> Way | None:
        """The same for the core; None where nobody has said yet where the machine may move freely.

        A clearance of the request is in program coordinates unless the request says otherwise, whatever is configured.
        """
        said = wish.clearance is not None
        clearance = wish.clearance if said else self.clearance
        if clearance is None:
            return None
        return Way(
            clearance,
            self.plunge_feed if wish.plunge_feed is None else wish.plunge_feed,
            self.spindle_wait if wish.spindle_wait is None else wish.spindle_wait,
            clearance_is_machine=bool(wish.clearance_is_machine) if said else self.clearance_is_machine,
            laser=laser,
        )
