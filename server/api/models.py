"""The shapes of requests and answers, with units, bounds and examples: what the OpenAPI document says.

Not their meaning (the services) and not the WebSocket's messages (`server/api/messages.py`). The one rule: a request
with a field that is not here is refused, for a misspelt `end_line` must not run a whole program.
"""

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

AXES = ("x", "y", "z", "a", "b", "c")
MAX_BLOCKS = 100
MAX_BLOCK_CHARS = 1024
MAX_NOTE_CHARS = 2000
MAX_FEED_MM_MIN = 1_000_000.0
MAX_JOG_MM = 100_000.0

TIME = "2026-03-01T09:30:00.250Z"
EXAMPLE_SECRET = "mill_pWz0…"  # noqa: S105 - nobody's
PROGRAM_ID = "5f70bf18a086007016e948b04aed3b82103a36bea41755b6cddfaf10ace3c6ef"


def example(**fields: Any) -> ConfigDict:
    """The configuration of an answer: its example, and room for what is added later."""
    return ConfigDict(json_schema_extra={"examples": [fields]}, extra="allow")


def request_example(**fields: Any) -> ConfigDict:
    """The configuration of a request: strict, with its example."""
    return ConfigDict(json_schema_extra={"examples": [fields]}, extra="forbid", allow_inf_nan=False)


class Problem(BaseModel):
    """A refusal (RFC 9457). `code` is stable; `detail` says what happened and what to do next."""

    model_config = example(
        type="/docs#problem-not_connected",
        title="The machine is not connected",
        status=409,
        code="not_connected",
        detail="router is not connected; it is retried every few seconds. Check the cable and the port.",
    )
    type: str
    title: str
    status: int
    code: str
    detail: str


class Health(BaseModel):
    """The daemon is alive."""

    model_config = example(status="ok", version="0.1.0")
    status: Literal["ok"]
    version: str


# --- machines -------------------------------------------------------------------------------------------------


class AlarmView(BaseModel):
    """An alarm as the controller numbers it."""

    model_config = example(code=2, axis="x", message="end limit switch hit")
    code: int | None
    axis: str | None
    message: str


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
    "seq": 1841,
    "at": TIME,
}


class StateView(BaseModel):
    """The last known state. `feed` in mm/min, `spindle` in rpm, `overrides` in percent; null where it is not known."""

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
    seq: int
    at: str | None


MACHINE_EXAMPLE: dict[str, Any] = {
    "name": "router",
    "protocol": "elvinto",
    "port": "/dev/ttyUSB0",
    "link": "connected",
    "capabilities": ["home", "unlock", "reset", "estop", "pause", "jog", "commands", "sd"],
    "state": STATE_EXAMPLE,
    "active_job": 17,
    "queue_length": 2,
    "link_stats": {"retries": 1, "errors": {"checksum": 1}},
}


class MachineView(BaseModel):
    """A machine. `active_job` is the id of the job that uses it, `queue_length` counts the jobs that wait."""

    model_config = example(**MACHINE_EXAMPLE)
    name: str
    protocol: Literal["elvinto", "grbl", "ncframe"]
    port: str
    link: Literal["disconnected", "connecting", "connected"]
    capabilities: list[str]
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
    """Relative distances in mm (degrees for a, b, c)."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)
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


class ConsoleLine(BaseModel):
    """A message on the wire: `>` to the machine, `<` from it. `text` is the machine's own, to be escaped."""

    model_config = example(at=TIME, direction="<", text="OK,ID<#17;")
    at: str
    direction: Literal["<", ">"]
    text: str


# --- programs -------------------------------------------------------------------------------------------------


class ProgramView(BaseModel):
    """A program. `id` is the hash of its content, so the same content has the same id."""

    model_config = example(id=PROGRAM_ID, name="part.nc", lines=1204, bytes=31877, sha256=PROGRAM_ID)
    id: str
    name: str
    lines: int
    bytes: int
    sha256: str


class SourceLine(BaseModel):
    """One line as it stands in the file."""

    model_config = example(line=1, text="G21 G90")
    line: int
    text: str


class SourceView(BaseModel):
    """Lines of a program; numbers begin at 1."""

    model_config = example(lines=[{"line": 1, "text": "G21 G90"}])
    lines: list[SourceLine]


class Finding(BaseModel):
    """One thing the check found; `count` says how often in all."""

    model_config = example(line=12, column=4, code="unknown_code", message="G55 does not exist here", count=3)
    line: int
    column: int
    code: str
    message: str
    count: int


class ToolUseView(BaseModel):
    """What one tool does; -1 before the first tool change. Ways in mm, time in s."""

    model_config = example(tool=1, cut_mm=2210.0, rapid_mm=640.0, seconds=312.4)
    tool: int
    cut_mm: float
    rapid_mm: float
    seconds: float


class CheckView(BaseModel):
    """What the check says. Bounds (program coordinates) and ways in mm, `feeds` in mm/min, `spindle` in rpm.

    `cut_mm` are all feed moves, `plunge_mm` those of them that go straight down. `shortest_mm` and `median_mm` are of
    the moves that cut. `wire_bytes` go out to the machine; `link_seconds` is what its serial link needs for them at
    least, null without one. `encoding`, `line_ends`, `bytes` and `sha256` are of the file. A value that the program
    does not have is null.
    """

    model_config = example(
        errors=[],
        warnings=[{"line": 3, "column": 1, "code": "ignored", "message": "G54 is ignored", "count": 1}],
        infos=[],
        bounds={"x": [0.0, 120.0], "y": [0.0, 80.0], "z": [-3.0, 5.0]},
        seconds=312.4,
        lines=1204,
        blocks=1180,
        cut_mm=2210.0,
        rapid_mm=640.0,
        tools=[1],
        feeds=[800.0],
        plunge_mm=24.0,
        segments=1150,
        arcs=16,
        shortest_mm=0.2,
        median_mm=1.6,
        spindle=[12000.0, 12000.0],
        dwell_seconds=0.0,
        seconds_overridden=None,
        wire_bytes=24310,
        link_seconds=2.1,
        by_tool=[{"tool": 1, "cut_mm": 2210.0, "rapid_mm": 640.0, "seconds": 312.4}],
        encoding="ascii",
        line_ends="lf",
        bytes=31870,
        sha256=PROGRAM_ID,
    )
    errors: list[Finding]
    warnings: list[Finding]
    infos: list[Finding]
    bounds: dict[str, list[float]]
    seconds: float
    lines: int
    blocks: int
    cut_mm: float
    rapid_mm: float
    tools: list[int]
    feeds: list[float]
    plunge_mm: float
    segments: int
    arcs: int
    shortest_mm: float | None
    median_mm: float | None
    spindle: list[float] | None
    dwell_seconds: float
    seconds_overridden: float | None
    wire_bytes: int
    link_seconds: float | None
    by_tool: list[ToolUseView]
    encoding: str | None
    line_ends: str | None
    bytes: int | None
    sha256: str | None


# --- jobs -----------------------------------------------------------------------------------------------------


class JobRequest(BaseModel):
    """A run of a program on a machine. `hold`: do not start by itself. `force`: run in spite of warnings."""

    model_config = request_example(program=PROGRAM_ID, machine="router", note="second side")
    program: Annotated[str, Field(min_length=1, max_length=128)]
    machine: Annotated[str, Field(min_length=1, max_length=64)]
    start_line: Annotated[int, Field(ge=1)] | None = None
    end_line: Annotated[int, Field(ge=1)] | None = None
    hold: bool = False
    force: bool = False
    note: Annotated[str, Field(max_length=MAX_NOTE_CHARS)] | None = None

    @model_validator(mode="after")
    def _runs_forward(self) -> "JobRequest":
        if self.end_line is not None and self.end_line < (self.start_line or 1):
            raise ValueError("end_line is before start_line")
        return self


class ProgressView(BaseModel):
    """How far a job is. `line` is the last line that is certainly done; times in s, null where unknown.

    `seconds_left` is the best estimate of what is still to come without pauses and waits, `seconds_left_min` and
    `seconds_left_max` are what it lies between in nine cases of ten.
    """

    model_config = example(
        line=600,
        lines=1204,
        acknowledged_lines=600,
        seconds_elapsed=151.0,
        seconds_left=160.5,
        seconds_left_min=148.0,
        seconds_left_max=174.1,
    )
    line: int
    lines: int
    acknowledged_lines: int
    seconds_elapsed: float | None
    seconds_left: float | None
    seconds_left_min: float | None
    seconds_left_max: float | None


class JobErrorView(BaseModel):
    """Why a job ended early, and the lines that are in doubt."""

    model_config = example(code="alarm", message="end limit switch hit (axis x)", line_from=601, line_to=612)
    code: str
    message: str
    line_from: int | None
    line_to: int | None


JobStatus = Literal[
    "queued", "checking", "running", "paused", "waiting", "completed", "failed", "cancelled", "interrupted"
]

JOB_EXAMPLE: dict[str, Any] = {
    "id": 17,
    "status": "running",
    "program": PROGRAM_ID,
    "machine": "router",
    "progress": {
        "line": 600,
        "lines": 1204,
        "acknowledged_lines": 600,
        "seconds_elapsed": 151.0,
        "seconds_left": 160.5,
        "seconds_left_min": 148.0,
        "seconds_left_max": 174.1,
    },
    "error": None,
    "created_at": TIME,
    "started_at": TIME,
    "ended_at": None,
}


class JobView(BaseModel):
    """A job."""

    model_config = example(**JOB_EXAMPLE)
    id: int
    status: JobStatus
    program: Any
    machine: str
    progress: ProgressView
    error: JobErrorView | None


class MoveRequest(BaseModel):
    """The place in the queue, 1 is next."""

    model_config = request_example(position=1)
    position: Annotated[int, Field(ge=1)]


class RecoverRequest(BaseModel):
    """`continue` after the certain lines, or `from_line` with the `line` to begin at."""

    model_config = request_example(action="continue")
    action: Literal["continue", "from_line"]
    line: Annotated[int, Field(ge=1)] | None = None

    @model_validator(mode="after")
    def _line_where_needed(self) -> "RecoverRequest":
        if (self.action == "from_line") != (self.line is not None):
            raise ValueError("`line` is needed with from_line, and with nothing else")
        return self


class RecoverView(BaseModel):
    """Without a body: the plan. With an action: the job as it goes on."""

    model_config = example(certain_line=600, line_from=601, line_to=612, blocks=["G1 X20"])


class BatchView(BaseModel):
    """An entry of the journal: which lines went out under which wire id, and what is known of them."""

    model_config = example(
        wire_id=1017,
        line_from=601,
        line_to=612,
        status="ok",
        sent_at=TIME,
        received_at=TIME,
        ok_at=TIME,
        attempts=1,
        inferred=False,
    )
    status: str
    sent_at: str | None
    received_at: str | None
    ok_at: str | None
    attempts: int
    inferred: bool


class JobEventView(BaseModel):
    """Something that happened to a job."""

    model_config = example(at=TIME, type="status", data={"status": "running"})
    at: str


class JobReportView(BaseModel):
    """The job as a whole: what was done, how long it took, what the wire did."""

    model_config = example(job=JOB_EXAMPLE, batches=118, retries=1, inferred=0)


# --- who may do what ------------------------------------------------------------------------------------------


class SessionRequest(BaseModel):
    """Sign in with a token."""

    model_config = request_example(token=EXAMPLE_SECRET)
    token: Annotated[str, Field(min_length=1, max_length=512)]


class SessionView(BaseModel):
    """Who you are here. `open`: the daemon runs without tokens, on loopback."""

    model_config = example(name="screen", role="operator", open=False)
    name: str
    role: Literal["public", "viewer", "operator", "admin"]
    open: bool


RoleWord = Literal["viewer", "operator", "admin"]


class TokenRequest(BaseModel):
    """A name for people and a role."""

    model_config = request_example(name="screen at the mill", role="operator")
    name: Annotated[str, Field(min_length=1, max_length=80)]
    role: RoleWord


class TokenView(BaseModel):
    """A token without its secret."""

    model_config = example(
        id="9f2c41aa", name="screen", role="operator", created_at=TIME, last_used_at=None, revoked_at=None
    )
    id: str
    name: str
    role: RoleWord
    created_at: str
    last_used_at: str | None
    revoked_at: str | None


class NewTokenView(TokenView):
    """A token with its secret, which is shown this once."""

    model_config = example(
        id="9f2c41aa",
        name="screen",
        role="operator",
        created_at=TIME,
        last_used_at=None,
        revoked_at=None,
        token=EXAMPLE_SECRET,
    )
    token: str
