"""The shapes of `recover`: what is asked and what is answered, with units, bounds and examples.

Not their meaning (server/job/recovery.py, docs/resume.md). The one rule: a request that moves a machine says so in a
field of its own, `action`; every other field only describes.
"""

from typing import Annotated, Any, Literal

from pydantic import BaseModel, Field, model_validator

from gcode.reentry import Purpose
from jobs.reentry import MAX_BLOCKS
from server.api.models import WHOLE, JobErrorView, example, request_example
from server.config.reentry import Clearance, PlungeFeed, ReentryWish, SpindleWait

MAX_BLOCK_CHARS = 256
"""The longest line that any controller takes."""

WAY_FIELDS = frozenset({"line", "clearance", "clearance_is_machine", "plunge_feed", "spindle_wait"})
"""What a plan may be asked for with."""


class RecoverRequest(BaseModel):
    """`continue` behind the certain lines, or `from_line`. Without `action` nothing moves: the answer is the plan for
    `line`.

    Only for a controller that is taken up by a plan (Grbl): `line` may be left out then. `clearance` (mm, program
    coordinates, or those of the machine with `clearance_is_machine`), `plunge_feed` (mm/min) and `spindle_wait` (s) go
    before the configuration. `blocks`: the plan as it was edited, sent in the place of its steps. `operator_done`: what
    only people can do is done.

    `force`: although the machine is not homed, where that is needed (`needs` of the plan).
    """

    model_config = request_example(action="from_line", line=601, clearance=20.0, operator_done=True)
    action: Literal["continue", "from_line"] | None = None
    line: Annotated[int, Field(ge=1, le=2**53), WHOLE] | None = None
    clearance: Clearance | None = None
    clearance_is_machine: bool | None = None
    plunge_feed: PlungeFeed | None = None
    spindle_wait: SpindleWait | None = None
    blocks: (
        Annotated[list[Annotated[str, Field(max_length=MAX_BLOCK_CHARS)]], Field(min_length=1, max_length=MAX_BLOCKS)]
        | None
    ) = None
    operator_done: bool = False
    force: bool = False

    @model_validator(mode="after")
    def _says_what_it_means(self) -> "RecoverRequest":
        said = self.model_fields_set - {"action"}
        if self.action == "continue" and said:
            raise ValueError("`continue` takes nothing else: it goes on behind the certain lines")
        if self.action is None and not said & WAY_FIELDS:
            raise ValueError("say `action`, or `line` to see the plan for another line")
        if self.action is None and said - WAY_FIELDS:
            raise ValueError("`blocks`, `operator_done` and `force` belong to the action from_line")
        if self.clearance is None and self.clearance_is_machine is not None:
            raise ValueError("`clearance_is_machine` says what `clearance` means: say both")
        return self

    def wish(self) -> ReentryWish:
        """The same for the service."""
        return ReentryWish(
            self.clearance,
            self.clearance_is_machine,
            self.plunge_feed,
            self.spindle_wait,
            None if self.blocks is None else tuple(self.blocks),
            self.operator_done,
            self.force,
        )


class StepView(BaseModel):
    """One block of a plan; an empty `text` is a step for people, `note` says which."""

    model_config = example(text="G0 Z20", purpose="lift", note="before anything else moves")
    text: str
    purpose: Purpose
    note: str


class WayView(BaseModel):
    """How the machine would get back to the path: mm, mm/min, s."""

    model_config = example(clearance=20.0, clearance_is_machine=False, plunge_feed=100.0, spindle_wait=3.0)
    clearance: float
    clearance_is_machine: bool
    plunge_feed: float
    spindle_wait: float


Need = Literal["clearance", "operator_done", "force"]

PLAN_EXAMPLE: dict[str, Any] = {
    "job": 17,
    "reason": {"code": "in_doubt", "message": "the link broke", "line_from": 601, "line_to": 612},
    "restarted": False,
    "position_expected": {"x": 10.0, "y": 4.0, "z": -2.0},
    "position": {"x": 12.5, "y": 4.0, "z": -2.0},
    "place": {"x": 10.0, "y": 4.0, "z": -2.0},
    "certain_line": 600,
    "line_from": 601,
    "line_to": 612,
    "next_line": 601,
    "can_continue": False,
    "why_not": "Lines 601 to 612 are in doubt. Look at the part, then recover from a line.",
    "line_why_not": None,
    "blocks": ["G21", "G17", "G90"],
    "steps": [{"text": "G0 Z20", "purpose": "lift", "note": "before anything else moves"}],
    "takes_over": 0,
    "warnings": [],
    "needs": ["force"],
    "way": {"clearance": 20.0, "clearance_is_machine": False, "plunge_feed": 100.0, "spindle_wait": 3.0},
}


class PlanView(BaseModel):
    """What is certain, what is in doubt, and what going on from `next_line` would do.

    `line_why_not`: why going on from there is refused. `blocks`: what would go out first. `steps`, `takes_over` (so
    many lines of the rest are said by the plan itself), `warnings`, `place` (where the path goes on, mm) and `way` only
    where the controller is taken up by a plan. `needs`: what a request for this line has to say besides.
    """

    model_config = example(**PLAN_EXAMPLE)
    job: int
    certain_line: int
    line_from: int | None
    line_to: int | None
    reason: JobErrorView | None
    restarted: bool
    position_expected: dict[str, float]
    position: dict[str, float]
    can_continue: bool
    why_not: str | None
    next_line: int
    line_why_not: str | None
    blocks: list[str]
    steps: list[StepView]
    takes_over: int
    warnings: list[str]
    place: dict[str, float]
    needs: list[Need]
    way: WayView | None


class RecoverView(BaseModel):
    """Without an action the plan (the example); with one the job as it goes on."""

    model_config = example(**PLAN_EXAMPLE)
