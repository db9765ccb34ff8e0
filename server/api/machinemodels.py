"""The shapes of requests and answers about a machine: its state, jogs, blocks by hand, its card, its console.

Not their meaning (the services). The one rule is that of models.py: a request with a field that is not here is
refused; whatever moves a machine has bounds besides.
"""

from typing import Annotated, Any, Literal

from pydantic import BaseModel, Field, model_validator

from server.api.models import STRICT, TIME, example, request_example

AXES = ("x", "y", "z", "a", "b", "c")
MAX_BLOCKS = 100
MAX_BLOCK_CHARS = 1024
MAX_FEED_MM_MIN = 1_000_000.0
MAX_JOG_MM = 100_000.0


class AlarmView(BaseModel):
    """An alarm as the controller numbers it."""

    model_config = example(code=2, axis="x", message="end limit switch hit")
    code: int | None
    axis: str | None
    message: str


class HolderView(BaseModel):
    """Who moves a machine by hand. `client` is what it calls itself, or its address."""

    model_config = example(name="screen", client="192.168.1.17", since=TIME)
    name: str
    client: str
    since: str


class PositionView(BaseModel):
    """Coordinates in mm (degrees for a, b, c); an axis that is not known is absent."""

    model_config = example(machine={"x": 10.0, "y": 0.0, "z": 5.0}, work={"x": 10.0, "y": 0.0, "z": 5.0})
    machine: dict[str, float]
    work: dict[str, float]


STATE_EXAMPLE: dict[str, Any] = {
    "status": "run",
    "position": {"machine": {"x": 10.0, "y": 0.0, "z": 5.0}, "work": {"x": 10.0, "y": 0.0, "z": 5.0}},
    "feed": 800.0,
    "spindle": 12000.0,
    "overrides": {},
    "alarm": None,
    "absolute": True,
    "tool": 3,
    "inputs": {},
    "accessories": ["spindle_cw"],
    "homed": True,
    "pendant": False,
    "substate": None,
    "control": None,
    "seq": 1841,
    "at": TIME,
}


class StateView(BaseModel):
    """The last known state. `feed` in mm/min, `spindle` in rpm, `overrides` in percent; null where it is not known.

    `accessories` are those that run, `pendant`: one owns the machine (MPG), `substate` as the controller numbers it
    (Grbl: Hold 0 stands, 1 decelerates; Door 0 to 3), `control`: who moves it by hand, null where nobody does.
    """

    model_config = example(**STATE_EXAMPLE)
    status: Literal["offline", "idle", "run", "hold", "jog", "alarm", "home", "check", "door", "sleep", "tool"]
    position: PositionView
    feed: float | None
    spindle: float | None
    overrides: dict[str, float]
    alarm: AlarmView | None
    absolute: bool | None
    tool: int | None
    inputs: dict[str, bool]
    accessories: list[str]
    homed: bool | None
    pendant: bool
    substate: int | None
    control: HolderView | None
    seq: int
    at: str | None


MACHINE_EXAMPLE: dict[str, Any] = {
    "name": "router",
    "protocol": "elvinto",
    "port": "/dev/ttyUSB0",
    "link": "connected",
    "capabilities": ["home", "unlock", "reset", "estop", "pause", "jog", "commands", "sd"],
    "travel": {"x": [0.0, 300.0], "y": [0.0, 200.0], "z": [-80.0, 0.0]},
    "state": STATE_EXAMPLE,
    "active_job": 17,
    "queue_length": 2,
    "link_stats": {"retries": 1, "errors": {"checksum": 1}},
}


class MachineView(BaseModel):
    """A machine. `active_job` is the id of the job that uses it, `queue_length` counts the jobs that wait, `travel` is
    the reach of each axis in machine coordinates, mm (degrees), as configured; an axis without it is absent."""

    model_config = example(**MACHINE_EXAMPLE)
    name: str
    protocol: Literal["elvinto", "grbl", "ncframe"]
    port: str
    link: Literal["disconnected", "connecting", "connected"]
    capabilities: list[str]
    travel: dict[str, tuple[float, float]]
    state: StateView
    active_job: Any
    queue_length: int
    link_stats: dict[str, Any]


class Accepted(BaseModel):
    """The request is taken; the state shows when it is done."""

    model_config = example(machine="router", accepted="home")
    machine: str
    accepted: str


Block = Annotated[str, Field(min_length=1, max_length=MAX_BLOCK_CHARS)]


class CommandsRequest(BaseModel):
    """Blocks of G-code to run by hand, in order."""

    model_config = request_example(blocks=["G0 X0", "M3 S12000"])
    blocks: Annotated[list[Block], Field(min_length=1, max_length=MAX_BLOCKS)]


class BlockResult(BaseModel):
    """What became of one block. After the first that failed the rest is not sent."""

    model_config = example(block="G0 X0", ok=True, error=None)
    block: str
    ok: bool
    error: Any = None


class CommandsResult(BaseModel):
    """A result for each block."""

    model_config = example(results=[{"block": "G0 X0", "ok": True, "error": None}])
    results: list[BlockResult]


Distance = Annotated[float, Field(ge=-MAX_JOG_MM, le=MAX_JOG_MM)]


class AxisMove(BaseModel):
    """Relative distances in mm (degrees for a, b, c). Strict, with what is made of it: `true` is no millimetre."""

    model_config = STRICT
    x: Distance | None = None
    y: Distance | None = None
    z: Distance | None = None
    a: Distance | None = None
    b: Distance | None = None
    c: Distance | None = None

    def axes(self) -> dict[str, float]:
        """The distances that are asked for."""
        return {axis: value for axis in AXES if (value := getattr(self, axis))}


class JogRequest(AxisMove):
    """A relative move at `feed` mm/min."""

    model_config = request_example(x=1.0, feed=500)
    feed: Annotated[float, Field(gt=0, le=MAX_FEED_MM_MIN)]

    @model_validator(mode="after")
    def _goes_somewhere(self) -> "JogRequest":
        if not self.axes():
            raise ValueError(f"name at least one of the axes {', '.join(AXES)} with a distance that is not 0")
        return self


class FilesView(BaseModel):
    """The root folder of the SD card. `card` is its type, null without one."""

    model_config = example(card="SDHC", readable=True, names=["part1.nc"], problem=None)
    card: str | None
    readable: bool
    names: list[str]
    problem: str | None = None


class RunFileRequest(BaseModel):
    """The name of a file on the SD card."""

    model_config = request_example(name="part1.nc")
    name: Annotated[str, Field(min_length=1, max_length=255)]


class CodeView(BaseModel):
    """A code of the machine's profile. `text`: what the controller makes of it, where that is not the usual."""

    model_config = example(code="G28", text="retracts Z to the safe plane and goes to X0 Y0")
    code: str
    text: str


class ConsoleLine(BaseModel):
    """A message on the wire: `>` to the machine, `<` from it. `text` is the machine's own, to be escaped."""

    model_config = example(at=TIME, direction="<", text="OK,ID<#17;")
    at: str
    direction: Literal["<", ">"]
    text: str
