"""The shapes of requests and answers, with units, bounds and examples: what the OpenAPI document says.

Not their meaning (the services), not the WebSocket's messages (`server/api/messages.py`) and not the shapes of what
concerns a machine (`server/api/machinemodels.py`). The one rule: a request with a field that is not here, or of another
type than JSON says, is refused, for a misspelt `end_line` must not run a whole program.
"""

from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, model_validator

MAX_NOTE_CHARS = 2000

TIME = "2026-03-01T09:30:00.250Z"
PROGRAM_ID = "5f70bf18a086007016e948b04aed3b82103a36bea41755b6cddfaf10ace3c6ef"


STRICT = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)
"""Of what a client says in JSON: types are JSON's own. A text is no number and no truth value: `"false"` is neither."""


def example(**fields: Any) -> ConfigDict:
    """The configuration of an answer: its example, and room for what is added later."""
    return ConfigDict(json_schema_extra={"examples": [fields]}, extra="allow")


def request_example(**fields: Any) -> ConfigDict:
    """The configuration of a request: no unknown keys, nothing that is taken for something else, and its example."""
    return ConfigDict(json_schema_extra={"examples": [fields]}, **STRICT)


def _whole(value: object) -> object:
    return int(value) if isinstance(value, float) and value.is_integer() else value


WHOLE = BeforeValidator(_whole)
"""In JSON 3.0 is a whole number as 3 is; "3" and true are none. Behind the bounds, or the document lacks them."""


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


# --- programs -------------------------------------------------------------------------------------------------


class ProgramView(BaseModel):
    """A program. `id` is the hash of its content, so the same content has the same id. `source_program` is the one that
    it was made of when that was first run, null for an upload; that may have been deleted since."""

    model_config = example(
        id=PROGRAM_ID, name="part.nc", lines=1204, bytes=31877, sha256=PROGRAM_ID, source_program=None
    )
    id: str
    name: str
    lines: int
    bytes: int
    sha256: str
    source_program: str | None


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
    least, null without one. `encoding`, `line_ends`, `bytes` and `sha256` are of the file. `expanded_lines` are the
    plain lines that a program with O-words, parameters or macros stands for. A value that the program does not have
    is null.
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
        expanded_lines=None,
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
    expanded_lines: int | None


# --- jobs -----------------------------------------------------------------------------------------------------


class JobRequest(BaseModel):
    """A run of a program on a machine. `hold`: do not start by itself. `force`: run in spite of warnings.

    `mode`, `on_error` and `ignored_errors` are for Grbl: `check` has the controller's own parser read the program
    without motion; `on_error` says what follows a line that it refuses while more lines are inside (the default is in
    the configuration); `ignore` holds for `ignored_errors`, or for every code where none is named.
    """

    model_config = request_example(program=PROGRAM_ID, machine="router", note="second side")
    program: Annotated[str, Field(min_length=1, max_length=128)]
    machine: Annotated[str, Field(min_length=1, max_length=64)]
    start_line: Annotated[int, Field(ge=1, le=2**53), WHOLE] | None = None
    end_line: Annotated[int, Field(ge=1, le=2**53), WHOLE] | None = None
    hold: bool = False
    force: bool = False
    note: Annotated[str, Field(max_length=MAX_NOTE_CHARS)] | None = None
    mode: Literal["run", "check"] = "run"
    on_error: Literal["hold", "stop", "ignore"] | None = None
    ignored_errors: Annotated[list[Annotated[int, Field(ge=1, le=255), WHOLE]], Field(max_length=64)] | None = None

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


class HoldView(BaseModel):
    """Why a job waits on hold: `asked`, `job_ended`, `restarted`, `restored`, or the code of what kept it from
    beginning."""

    model_config = example(code="not_connected", message="router is connecting. Check the cable and the port.")
    code: str
    message: str


class JobWarning(BaseModel):
    """What somebody should know who has queued a job. `startup_blocks`: what the controller runs behind its check."""

    model_config = example(
        code="startup_blocks",
        message="The controller resets itself behind the check, and then runs its start-up blocks: G54.",
    )
    code: str
    message: str


JobStatus = Literal[
    "queued", "checking", "running", "paused", "waiting", "completed", "failed", "cancelled", "interrupted"
]

JOB_EXAMPLE: dict[str, Any] = {
    "id": 17,
    "status": "running",
    "program": PROGRAM_ID,
    "source_program": None,
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
    "hold_reason": None,
    "created_at": TIME,
    "started_at": TIME,
    "ended_at": None,
}


class JobView(BaseModel):
    """A job. `source_program` is the one that was uploaded where `program` is what became of its O-words, parameters
    and macros; else null. Lines are those of `program`. Only the answer to the request that made it has `warnings`."""

    model_config = example(**JOB_EXAMPLE)
    id: int
    status: JobStatus
    program: Any
    source_program: str | None
    machine: str
    progress: ProgressView
    error: JobErrorView | None
    hold_reason: HoldView | None
    warnings: list[JobWarning] = []


class MoveRequest(BaseModel):
    """The place in the queue, 1 is next."""

    model_config = request_example(position=1)
    position: Annotated[int, Field(ge=1, le=2**53), WHOLE]


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
