"""The shapes of requests and answers about a tool changer: its pins, its tools, its tool table.

Not their meaning (server/changer/toolchanger.py). The one rule is that of models.py: a request with a field that is not
here is refused.
"""

from typing import Annotated, Any, Literal

from fastapi import Query
from pydantic import BaseModel, Field, StrictBool, StrictInt, model_validator

from protocol.iocontrol.pins import PINS
from protocol.iocontrol.tooltable import NUMBER_MAX, TOOLS_MAX
from server.api.models import STRICT, TIME, WHOLE, example, request_example

MAX_TABLE_CHARS = 1_000_000

After = Annotated[int, Query(ge=0, le=2**53, description="Only events with a higher `id`")]


Levels = Annotated[dict[str, StrictBool | Annotated[StrictInt, WHOLE]], Field(max_length=len(PINS))]


class PinView(BaseModel):
    """A pin. `direction` as the daemon sees it; `valid`: false for inputs of a changer that is not connected;
    `drivable`: PATCH may set it."""

    model_config = example(
        name="tool-change", type="bit", direction="out", value=True, since=TIME, valid=True, drivable=False
    )
    name: str
    type: Literal["bit", "s32"]
    direction: Literal["in", "out"]
    value: bool | int
    since: str
    valid: bool
    drivable: bool


class IoView(BaseModel):
    """The tool changer of a machine. `tool`: in the spindle, 0 none, null not known; `tool_certain`: nobody can have
    changed it unseen, else a person is asked for it though it is thought to be in. `parameters`: set by a fault.
    `refusal`: why no job can begin, null: it can."""

    model_config = example(
        kind="external",
        state="changing",
        estop="enabled",
        connected=True,
        tool=1,
        tool_certain=True,
        prepared=2,
        faulted=False,
        parameters={"#5060": 0.0, "#5600": 0.0, "#5601": 0.0},
        waiting_for="tool-changed",
        waiting_tool=2,
        overdue=False,
        may_confirm=False,
        may_fail=True,
        may_clear_fault=False,
        refusal="a tool change is pending",
        pins=[],
    )
    kind: Literal["manual", "external", "loopback", "none"]
    state: str
    estop: str
    connected: bool
    tool: int | None
    tool_certain: bool
    prepared: int | None
    faulted: bool
    parameters: dict[str, float]
    waiting_for: str | None
    waiting_tool: int | None
    overdue: bool
    may_confirm: bool
    may_fail: bool
    may_clear_fault: bool
    refusal: str | None
    pins: list[PinView]


class PinsRequest(BaseModel):
    """Levels of inputs, all in one step."""

    model_config = request_example(pins={"tool-changed": True})
    pins: Levels


class ToolRequest(BaseModel):
    """The tool that is in the spindle; 0: none."""

    model_config = request_example(tool=3)
    tool: Annotated[int, Field(ge=0, le=NUMBER_MAX), WHOLE]


class ToolEntry(BaseModel):
    """A line of the tool table. Lengths in the machine's units, angles in degrees."""

    model_config = STRICT
    number: Annotated[int, Field(ge=0, le=NUMBER_MAX), WHOLE]
    pocket: Annotated[int, Field(ge=0, le=NUMBER_MAX), WHOLE]
    diameter: float = 0.0
    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    a: float = 0.0
    b: float = 0.0
    c: float = 0.0
    u: float = 0.0
    v: float = 0.0
    w: float = 0.0
    front_angle: float = 0.0
    back_angle: float = 0.0
    orientation: Annotated[int, Field(ge=0, le=9)] = 0
    comment: Annotated[str, Field(max_length=200)] = ""


class ToolsRequest(BaseModel):
    """The tool table, as LinuxCNC's text or as a list; neither: every number is a tool."""

    model_config = request_example(text="T1 P1 D6.0 Z+10.0 ;six mm\n")
    text: Annotated[str, Field(max_length=MAX_TABLE_CHARS)] | None = None
    tools: Annotated[list[ToolEntry], Field(max_length=TOOLS_MAX)] | None = None

    @model_validator(mode="after")
    def _one_of_both(self) -> "ToolsRequest":
        if self.text is not None and self.tools is not None:
            raise ValueError("say text or tools, not both")
        return self


class ToolsView(BaseModel):
    """The tool table; `tools` and `text` are null where there is none. `warnings`: lines that were left out."""

    model_config = example(tool=1, random=False, tools=[], text="T1 P1 D+6.0 ;six mm\n", warnings=[])
    tool: int | None
    random: bool
    tools: list[ToolEntry] | None
    text: str | None
    warnings: list[dict[str, Any]]
