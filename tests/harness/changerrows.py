"""The order of events of the sheet (iocontrol §2, §3) as one table: what is done, and what the pins do then.

Each row is tried on the bare block (tests/protocol/iocontrol/test_rows.py) and, with jobs over HTTP, on whole daemons
(tests/scenarios/test_tool_changer_rows.py): the same sequence to the letter. The changer of a row is external and
connected, its chain closed, without a tool table; pins are as in the sheet: `^` rises, `_` falls, a comma within a
step, a bar between steps. The one rule: a row is written from the sheet, not from what the code did.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

Step = tuple[str, Any]


def drive(**pins: bool | int) -> Step:
    """Levels of the changer, in one step."""
    return "drive", {name.replace("_", "-"): value for name, value in pins.items()}


def answer(request: str, pin: str) -> list[Step]:
    """A good changer: the answer rises with its request, and falls with it."""
    return [("rises", request), ("drive", {pin: True}), ("falls", request), ("drive", {pin: False})]


PREPARE = answer("tool-prepare", "tool-prepared")
CHANGE = answer("tool-change", "tool-changed")
ACK = answer("emc-abort", "emc-abort-ack")
START = answer("start-change", "start-change-ack")
CHANGING: list[Step] = [("job", "T5 M6"), *PREPARE, ("rises", "tool-change")]

PREP_5 = "tool-prep-number=5, tool-prep-pocket=5, tool-prep-index=5"
PREP_0 = "tool-prep-number=0, tool-prep-pocket=0, tool-prep-index=0"
PREPARED_5 = f"{PREP_5}, tool-prepare^ | tool-prepared^ | tool-prepare_ | tool-prepared_"
CHANGED_5 = f"tool-change^ | tool-changed^ | tool-change_, tool-number=5, {PREP_0} | tool-changed_"
STARTED = "start-change^ | start-change-ack^ | start-change_ | start-change-ack_"
ACKED = "emc-abort-ack^ | emc-abort_ | emc-abort-ack_"
FAULTED = "toolchanger-fault^ | toolchanger-fault-ack^, toolchanger-faulted^"
OVER = "toolchanger-fault_ | toolchanger-fault-ack_"
RESET = "user-enable-out^, user-request-enable^, emc-reason=5, emc-abort^ | user-request-enable_"
DONE = "completed"
FAILED = "tool_change_failed"
TWO = ("elvinto", "grbl")
EACH = (*TWO, "ncframe")


@dataclass(frozen=True, slots=True)
class Row:
    """What is done, and what comes of it.

    `sequence`: all that the pins do. `ends`: the job's status, or the code of its error; None: no job, or it waits.
    `spindle`: the tool before; `tool`: behind it, None not known. `parameters`: #5060, #5600, #5601. `place`: the
    machine has gone to where tools are changed. `ignored`: answers that were written down and had no effect.
    `protocols`: where the row has a meaning.
    """

    name: str
    steps: list[Step]
    sequence: str
    ends: str | None = DONE
    spindle: int = 0
    tool: int | None = 0
    table: str | None = None
    settings: Mapping[str, Any] = field(default_factory=dict)
    parameters: tuple[float, float, float] = (0.0, 0.0, 0.0)
    place: bool = False
    refusal: str | None = None
    prepared: int | None = None
    waits_for: str | None = None
    ignored: tuple[str, ...] = ()
    protocols: tuple[str, ...] = TWO


def fault_while_changing(reason: int, ends: str) -> Row:
    """§3: what the program does then depends on the reason alone."""
    signed = "" if reason == 0 else f"toolchanger-reason={reason}, "
    return Row(
        f"fault while changing, reason {reason}",
        [*CHANGING, drive(toolchanger_reason=reason, toolchanger_fault=True), *ACK, drive(toolchanger_fault=False)],
        f"{PREPARED_5} | tool-change^ | {signed}{FAULTED}, tool-change_, emc-reason=101, emc-abort^ | {ACKED} | {OVER}",
        ends=ends,
        parameters=(1.0, 1.0, float(reason)),
        place=True,
        prepared=5,
        protocols=EACH,
    )


def fault_while_idle(reason: int, ends: str) -> Row:
    """The next M6 aborts, before anything moves; with a reason above 0 it is left out."""
    signed = "" if reason == 0 else f"toolchanger-reason={reason}, "
    latched = [drive(toolchanger_reason=reason, toolchanger_fault=True), drive(toolchanger_fault=False)]
    return Row(
        f"fault while idle, reason {reason}",
        [*latched, ("job", "T5 M6"), *PREPARE, *ACK],
        f"{signed}{FAULTED} | {OVER} | {PREPARED_5} | emc-reason=101, emc-abort^ | {ACKED}",
        ends=ends,
        parameters=(1.0, 1.0, float(reason)),
        prepared=5,
    )


ROWS = [
    Row("prepare", [("job", "T5"), *PREPARE], PREPARED_5, prepared=5),
    Row(
        "change",
        [("job", "T5 M6"), *PREPARE, *CHANGE],
        f"{PREPARED_5} | {CHANGED_5}",
        tool=5,
        place=True,
        protocols=EACH,
    ),
    Row(
        "change with start-change",
        [("job", "T5 M6"), *PREPARE, ("rises", "start-change"), ("stays", 3.0), *START, *CHANGE],
        f"{PREPARED_5} | {STARTED} | {CHANGED_5}",
        tool=5,
        settings={"support_start_change": True},
        place=True,
        protocols=EACH,
    ),
    Row(
        "a level that is TRUE before it is asked for",
        [drive(tool_prepared=True, tool_changed=True), ("job", "T5 M6"), ("rises", "tool-number")],
        f"tool-prepared^, tool-changed^ | {PREP_5}, tool-prepare^ | tool-prepare_"
        f" | tool-change^ | tool-change_, tool-number=5, {PREP_0}",
        tool=5,
        place=True,
        ignored=("tool-prepared", "tool-changed"),
    ),
    Row(
        "tool already in the spindle",
        [("job", "T5 M6"), *PREPARE, ("ends", None)],
        f"{PREPARED_5} | {PREP_0}",
        spindle=5,
        tool=5,
        place=True,
    ),
    Row(
        "M6 without a T",
        [("job", "M6"), *ACK],
        f"emc-reason=1, emc-abort^ | {ACKED}",
        ends="no_tool_word",
        protocols=EACH,
    ),
    Row(
        "T of a tool that is not in the table",
        [("job", "T6 M6"), *ACK],
        f"emc-reason=1, emc-abort^ | {ACKED}",
        ends=FAILED,
        table="T5 P5\n",
    ),
    Row(
        "T0",
        [("job", "T0 M6"), *PREPARE, *CHANGE],
        "tool-prepare^ | tool-prepared^ | tool-prepare_ | tool-prepared_"
        " | tool-change^ | tool-changed^ | tool-change_, tool-number=0 | tool-changed_",
        spindle=5,
        place=True,
    ),
    Row(
        "T0 of a random changer without a T0 in its table",
        [("job", "T0 M6"), *ACK],
        f"emc-reason=1, emc-abort^ | {ACKED}",
        ends=FAILED,
        tool=5,
        table="T5 P0\nT6 P6\n",
        settings={"random": True},
    ),
    Row(
        "abort while preparing",
        [("job", "T5 M6"), ("rises", "tool-prepare"), ("cancel", None), *ACK],
        f"{PREP_5}, tool-prepare^ | emc-reason=100, emc-abort^, tool-prepare_ | {ACKED}",
        ends="cancelled",
    ),
    Row(
        "abort while start-change is up",
        [("job", "T5 M6"), *PREPARE, ("rises", "start-change"), ("cancel", None), *ACK],
        f"{PREPARED_5} | start-change^ | emc-reason=100, emc-abort^, start-change_ | {ACKED}",
        ends="cancelled",
        settings={"support_start_change": True},
        prepared=5,
    ),
    Row(
        "abort while changing, the prepared tool stays prepared",
        [*CHANGING, ("cancel", None), *ACK],
        f"{PREPARED_5} | tool-change^ | emc-reason=100, emc-abort^, tool-change_ | {ACKED}",
        ends="cancelled",
        place=True,
        prepared=5,
        protocols=EACH,
    ),
    Row(
        "abort with coolant on",
        [("job", "M8"), ("rises", "coolant-flood"), ("cancel", None), *ACK],
        f"coolant-flood^ | coolant-flood_, emc-reason=100, emc-abort^ | {ACKED}",
        ends="cancelled",
        protocols=("grbl", "ncframe"),
    ),
    Row(
        "coolant",
        [("job", "M8 M9"), ("rises", "coolant-flood"), ("ends", None)],
        "coolant-flood^ | coolant-flood_",
        protocols=("grbl", "ncframe"),
    ),
    Row(
        "an abort that is not acknowledged lets nothing begin",
        [*CHANGING, ("cancel", None), ("rises", "emc-abort"), ("stays", 3.0)],
        f"{PREPARED_5} | tool-change^ | emc-reason=100, emc-abort^, tool-change_",
        ends="cancelled",
        place=True,
        prepared=5,
        refusal="the tool changer has not acknowledged the last abort",
        waits_for="emc-abort-ack",
    ),
    Row(
        "tool-changed before the abort counts",
        [*CHANGING, drive(tool_changed=True), ("cancel", None), drive(tool_changed=False), *ACK],
        f"{PREPARED_5} | tool-change^ | tool-changed^ | tool-change_, tool-number=5, {PREP_0}"
        f" | emc-reason=100, emc-abort^ | tool-changed_ | {ACKED}",
        ends="cancelled",
        tool=5,
        place=True,
    ),
    Row(
        "tool-changed after the abort is ignored and written down",
        [*CHANGING, ("cancel", None), drive(tool_changed=True), drive(tool_changed=False), *ACK],
        f"{PREPARED_5} | tool-change^ | emc-reason=100, emc-abort^, tool-change_"
        f" | tool-changed^ | tool-changed_ | {ACKED}",
        ends="cancelled",
        place=True,
        prepared=5,
        ignored=("tool-changed",),
    ),
    Row(
        "answers that are repeated and late",
        [
            *(("job", "T5 M6"), *PREPARE, drive(tool_prepared=True), drive(tool_prepared=False), *CHANGE),
            *(drive(tool_changed=True), drive(tool_changed=False), drive(emc_abort_ack=True)),
            drive(emc_abort_ack=False),
        ],
        f"{PREPARED_5} | tool-prepared^ | tool-prepared_ | {CHANGED_5}"
        " | tool-changed^ | tool-changed_ | emc-abort-ack^ | emc-abort-ack_",
        tool=5,
        place=True,
        ignored=("tool-prepared", "tool-changed", "emc-abort-ack"),
    ),
    fault_while_idle(-2, FAILED),
    fault_while_idle(0, FAILED),
    fault_while_idle(4, DONE),
    Row(
        "fault while preparing",
        [
            *(("job", "T5 M6"), ("rises", "tool-prepare"), drive(toolchanger_reason=-2, toolchanger_fault=True)),
            *(drive(toolchanger_fault=False), *PREPARE, *ACK),
        ],
        f"{PREP_5}, tool-prepare^ | toolchanger-reason=-2, {FAULTED} | {OVER}"
        f" | tool-prepared^ | tool-prepare_ | tool-prepared_ | emc-reason=101, emc-abort^ | {ACKED}",
        ends=FAILED,
        parameters=(1.0, 1.0, -2.0),
        prepared=5,
    ),
    Row(
        "a prepare that cannot finish for a fault",
        [
            *(("job", "T5"), ("rises", "tool-prepare"), drive(toolchanger_reason=-2, toolchanger_fault=True)),
            *(("rises", "emc-abort"), *ACK),
        ],
        f"{PREP_5}, tool-prepare^ | toolchanger-reason=-2, {FAULTED}"
        f" | tool-prepare_, emc-reason=101, emc-abort^ | {ACKED}",
        ends=FAILED,
        settings={"prepare_timeout": 1.0},
        parameters=(1.0, 1.0, -2.0),
    ),
    fault_while_changing(-5, FAILED),
    fault_while_changing(0, FAILED),
    fault_while_changing(7, DONE),
    Row(
        "fault and tool-changed in the same step",
        [*CHANGING, drive(tool_changed=True, toolchanger_reason=-5, toolchanger_fault=True), *ACK],
        f"{PREPARED_5} | tool-change^ | tool-changed^, toolchanger-reason=-5, {FAULTED}, tool-change_,"
        f" tool-number=-1, emc-reason=101, emc-abort^ | {ACKED}",
        ends=None,
        tool=None,
        parameters=(1.0, 1.0, -5.0),
        place=True,
        prepared=5,
        refusal="it is not known which tool is in the spindle",
        waits_for="verdict",
    ),
    Row(
        "the latch is cleared by the pin once its line is FALSE, and the next M6 goes",
        [
            *(drive(toolchanger_reason=-2, toolchanger_fault=True), drive(toolchanger_clear_fault=True)),
            *(drive(toolchanger_fault=False), drive(toolchanger_clear_fault=False)),
            *(("job", "T5 M6"), *PREPARE, *CHANGE),
        ],
        f"toolchanger-reason=-2, {FAULTED} | toolchanger-clear-fault^ | {OVER} | toolchanger-faulted_"
        f" | toolchanger-clear-fault_ | {PREPARED_5} | {CHANGED_5}",
        tool=5,
        place=True,
    ),
    Row(
        "user e-stop",
        [*CHANGING, ("estop", None), *ACK],
        f"{PREPARED_5} | tool-change^ | user-enable-out_, tool-change_, {PREP_0} | emc-reason=6, emc-abort^ | {ACKED}",
        ends="estop",
        place=True,
        refusal="the e-stop is not reset",
        protocols=EACH,
    ),
    Row(
        "user e-stop with coolant on",
        [("job", "M8"), ("rises", "coolant-flood"), ("estop", None), *ACK],
        f"coolant-flood^ | user-enable-out_, coolant-flood_ | emc-reason=6, emc-abort^ | {ACKED}",
        ends="estop",
        refusal="the e-stop is not reset",
        protocols=("grbl", "ncframe"),
    ),
    Row(
        "external e-stop, and the line's return does not switch on",
        [*CHANGING, drive(emc_enable_in=False), *ACK, drive(emc_enable_in=True), ("stays", 3.0)],
        f"{PREPARED_5} | tool-change^ | emc-enable-in_ | emc-reason=2, emc-abort^, tool-change_, {PREP_0} | {ACKED}"
        " | emc-enable-in^",
        ends="estop",
        place=True,
        refusal="the e-stop is not reset",
        protocols=EACH,
    ),
    Row(
        "e-stop reset",
        [("estop", None), *ACK, ("reset", None), ("falls", "user-request-enable"), *ACK],
        f"user-enable-out_ | emc-reason=6, emc-abort^ | {ACKED} | {RESET} | {ACKED}",
        ends=None,
    ),
    Row(
        "an e-stop reset while the external chain is open",
        [drive(emc_enable_in=False), *ACK, ("reset", None), ("falls", "user-request-enable"), *ACK, ("stays", 3.0)],
        f"emc-enable-in_ | emc-reason=2, emc-abort^ | {ACKED}"
        f" | user-request-enable^, emc-reason=5, emc-abort^ | user-request-enable_ | {ACKED}",
        ends=None,
        refusal="the e-stop is not reset",
    ),
    Row(
        "a change that takes too long is told and stays",
        [*CHANGING, ("stays", 3.0), *CHANGE],
        f"{PREPARED_5} | {CHANGED_5}",
        tool=5,
        settings={"change_timeout": 2.0},
        place=True,
    ),
]
