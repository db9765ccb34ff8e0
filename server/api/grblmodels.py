"""The shapes of requests and answers about what a Grbl tells of itself and what is pressed at it; not its settings.

Not their meaning (server/machine/panel.py). The one rule is that of models.py: a request with a field that is not here
is refused; whatever moves a machine or writes its memory has bounds besides.
"""

from typing import Annotated, Any, Literal

from pydantic import BaseModel, Field, model_validator

from server.api.machinemodels import AXES, AxisMove
from server.api.models import WHOLE, example, request_example
from server.machine.overrides import LEAST_PERCENT, MOST_PERCENT

MAX_INFO_CHARS = 80
MAX_STARTUP_BLOCKS = 10
MAX_STARTUP_CHARS = 120

# --- firmware -------------------------------------------------------------------------------------------------


class OptionView(BaseModel):
    """A letter of `[OPT:]` or a word of `[NEWOPT:]`; `meaning` is null where it is not known."""

    model_config = example(code="V", meaning="spindle with variable speed")
    code: str
    meaning: str | None


FIRMWARE_EXAMPLE: dict[str, Any] = {
    "machine": "router",
    "flavour": "grbl",
    "version": "1.1h",
    "build": "20190830",
    "info": "MYMILL",
    "options": [{"code": "V", "meaning": "spindle with variable speed"}],
    "planner_blocks": 15,
    "rx_bytes": 128,
    "axes": ["x", "y", "z"],
    "help": ["$$", "$#", "$G"],
    "facts": {},
    "warnings": [],
}


class FirmwareView(BaseModel):
    """What the controller is. `planner_blocks`, `rx_bytes`: what it says it has. `help`: the commands it knows,
    `facts`: its other lines by name, `warnings`: what differs from the usual build."""

    model_config = example(**FIRMWARE_EXAMPLE)
    machine: str
    flavour: Literal["grbl", "grblhal"]
    version: str
    build: str
    info: str
    options: list[OptionView]
    planner_blocks: int | None
    rx_bytes: int | None
    axes: list[str]
    help: list[str]
    facts: dict[str, str]
    warnings: list[str]


class InfoRequest(BaseModel):
    """The machine's info text; empty: none. Grbl drops blanks and knows no lower case."""

    model_config = request_example(info="MYMILL")
    info: Annotated[str, Field(max_length=MAX_INFO_CHARS)]


# --- modal state, offsets, start-up blocks --------------------------------------------------------------------


class ModalView(BaseModel):
    """Every modal group by name, with its word; `coolant` and `other` are lists. The F word is in mm or inches as `$13`
    says."""

    model_config = example(
        machine="router",
        groups={
            "motion": "G0",
            "coordinate_system": "G54",
            "units": "G21",
            "tool": "T0",
            "coolant": ["M9"],
            "other": [],
        },
        words=["G0", "G54", "G21", "M9", "T0"],
    )
    machine: str
    groups: dict[str, str | list[str]]
    words: list[str]


class ProbeView(BaseModel):
    """Where the last probing ended, machine coordinates in mm."""

    model_config = example(position={"x": 0.0, "y": 0.0, "z": -12.5}, succeeded=True)
    position: dict[str, float]
    succeeded: bool


class OffsetsView(BaseModel):
    """Offsets by name, in mm: G54 to G59.3, G28 and G30 (places), G92, TLO (tool length)."""

    model_config = example(
        machine="router",
        offsets={
            "G54": {"x": -120.0, "y": -80.0, "z": -30.0},
            "G92": {"x": 0.0, "y": 0.0, "z": 0.0},
            "TLO": {"z": 0.0},
        },
        probe={"position": {"x": 0.0, "y": 0.0, "z": -12.5}, "succeeded": True},
    )
    machine: str
    offsets: dict[str, dict[str, float]]
    probe: ProbeView | None


class OffsetRequest(AxisMove):
    """With `here` the machine's present place gets these coordinates, with `absolute` the origin lies at these machine
    coordinates; mm. G28 and G30 store the present place and take no axes."""

    model_config = request_example(system="G54", mode="here", x=0.0, y=0.0)
    system: Literal[
        "active", "G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3", "G28", "G30"
    ]  # fmt: skip
    mode: Literal["here", "absolute"] = "here"

    @model_validator(mode="after")
    def _fits(self) -> "OffsetRequest":
        if self.system in ("G28", "G30"):
            if self.given() or self.mode != "here":
                raise ValueError(f"{self.system} stores the present place: mode `here`, and no axes")
        elif not self.given():
            raise ValueError(f"name at least one of the axes {', '.join(AXES)}")
        return self

    def given(self) -> dict[str, float]:
        """The coordinates that are named, 0 too."""
        return {axis: value for axis in AXES if (value := getattr(self, axis)) is not None}


class StartupView(BaseModel):
    """The start-up blocks in their order; an empty one does nothing. `warnings`: what writing them has done and what
    they will do."""

    model_config = example(machine="router", blocks=["G21", ""], warnings=[])
    machine: str
    blocks: list[str]
    warnings: list[str]


class StartupRequest(BaseModel):
    """All start-up blocks in their order; those that are missing are emptied. `force`: also blocks that move something,
    start something or write the controller's memory after every reset."""

    model_config = request_example(blocks=["G21", "G90"], force=False)
    blocks: Annotated[list[Annotated[str, Field(max_length=MAX_STARTUP_CHARS)]], Field(max_length=MAX_STARTUP_BLOCKS)]
    force: bool = False


# --- modes ----------------------------------------------------------------------------------------------------


class CheckModeRequest(BaseModel):
    """The controller's parser without motion."""

    model_config = request_example(on=True)
    on: bool


class DefaultsRequest(BaseModel):
    """What is to be as the firmware delivers it. `confirm`: the machine's name."""

    model_config = request_example(what="settings", confirm="router")
    what: Literal["settings", "offsets", "all"]
    confirm: Annotated[str, Field(max_length=64)]


class DefaultsResult(BaseModel):
    """The controller has its defaults and resets itself. `backup` has everything as it was."""

    model_config = example(machine="router", restored="settings", backup=14)
    machine: str
    restored: Literal["settings", "offsets", "all"]
    backup: int


# --- what is pressed ------------------------------------------------------------------------------------------

Percent = Annotated[int, Field(ge=LEAST_PERCENT, le=MOST_PERCENT), WHOLE]


class OverridesRequest(BaseModel):
    """Percent of what is programmed; rapids know 25, 50 and 100 only."""

    model_config = request_example(feed=110)
    feed: Percent | None = None
    rapid: Literal[25, 50, 100] | None = None
    spindle: Percent | None = None

    @model_validator(mode="after")
    def _wants_something(self) -> "OverridesRequest":
        if not self.wishes():
            raise ValueError("name feed, rapid or spindle")
        return self

    def wishes(self) -> dict[Literal["feed", "rapid", "spindle"], int]:
        """What is named."""
        named: dict[Literal["feed", "rapid", "spindle"], int | None] = {
            "feed": self.feed,
            "rapid": self.rapid,
            "spindle": self.spindle,
        }
        return {kind: percent for kind, percent in named.items() if percent is not None}


class OverridesResult(BaseModel):
    """What is being brought about, and what the last report said; the state shows what comes of it."""

    model_config = example(machine="router", asked={"feed": 110}, present={"feed": 100, "rapid": 100, "spindle": 100})
    machine: str
    asked: dict[str, int]
    present: dict[str, int]


class CoolantRequest(BaseModel):
    """What is to run; what is not named stays as it is."""

    model_config = request_example(flood=True, mist=False)
    flood: bool | None = None
    mist: bool | None = None

    @model_validator(mode="after")
    def _wants_something(self) -> "CoolantRequest":
        if not self.wishes():
            raise ValueError("name flood or mist")
        return self

    def wishes(self) -> dict[Literal["flood", "mist"], bool]:
        """What is named."""
        named: dict[Literal["flood", "mist"], bool | None] = {"flood": self.flood, "mist": self.mist}
        return {coolant: on for coolant, on in named.items() if on is not None}


class CoolantResult(BaseModel):
    """What runs now, as the controller reports it."""

    model_config = example(machine="router", flood=True, mist=False)
    machine: str
    flood: bool
    mist: bool
