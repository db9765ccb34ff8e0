"""How machines and jobs look in JSON (api.md). Reads only; computes nothing that is not derived from what it is given.

The one rule: numbers are in mm, mm/min, rpm and s, times are RFC 3339 UTC, and what is unknown is null or absent.
"""

from collections.abc import Mapping
from datetime import datetime
from typing import Any

from jobs.holds import hold_view
from jobs.job import Status
from jobs.pace import Left
from jobs.runner import Runner
from jobs.store import Row, error_of
from protocol.events import Alarm, Announced, ProbeReported, StartupBlockRun
from protocol.machine import MachineState
from server.clock import Clock, seconds_since

AXIS_ORDER = "xyzabcuvw"
MICROMETRE_DIGITS = 4


def axes_view(position: Mapping[str, float]) -> dict[str, float]:
    """Coordinates in the usual order of the axes."""
    known = sorted(position, key=lambda axis: (AXIS_ORDER.find(axis), axis))
    return {axis: round(position[axis], MICROMETRE_DIGITS) for axis in known}


def alarm_view(alarm: Alarm | None) -> dict[str, Any] | None:
    """An alarm as the controller numbers it."""
    return None if alarm is None else {"code": alarm.code, "axis": alarm.axis, "message": alarm.message}


def state_view(state: MachineState, *, seq: int, at: str | None) -> dict[str, Any]:
    """The last known state of a machine."""
    return {
        "status": state.status,
        "position": {"machine": axes_view(state.position), "work": axes_view(state.work_position)},
        "feed": state.feed_mm_min,
        "spindle": state.spindle_rpm,
        "overrides": dict(state.overrides),
        "alarm": alarm_view(state.alarm),
        "absolute": state.absolute,
        "tool": state.tool,
        "tool_requested": state.tool_requested,
        "inputs": dict(state.inputs),
        "accessories": sorted(state.accessories),
        "homed": state.homed,
        "pendant": state.pendant,
        "substate": state.substate,
        "seq": seq,
        "at": at,
    }


def said(event: Announced | StartupBlockRun | ProbeReported) -> dict[str, Any]:
    """What a controller says of itself for people, as a message of the log."""
    match event:
        case Announced(text=text):
            return {"level": "info", "kind": "announced", "message": text}
        case StartupBlockRun(block=block, code=code):
            outcome = "was run" if code is None else f"failed with error {code}"
            level = "info" if code is None else "warning"
            return {"level": level, "kind": "startup_block", "message": f"The start-up block {block} {outcome}."}
        case ProbeReported(position=position, succeeded=succeeded):
            where = " ".join(f"{axis.upper()}{value:g}" for axis, value in axes_view(position).items())
            message = f"The probe {'made contact' if succeeded else 'found nothing'} at {where} (machine coordinates)."
            data = {"position": axes_view(position), "succeeded": succeeded}
            return {"level": "info" if succeeded else "warning", "kind": "probe", "message": message, **data}


def job_view(row: Row, clock: Clock, runner: Runner | None = None, left: Left | None = None) -> dict[str, Any]:
    """A job, from its row and, while it is under way, from its runner, which knows more; `left` is still to come."""
    error = error_of(row) if runner is None else runner.error
    status = Status(row["status"]) if runner is None else runner.status
    return {
        "id": row["id"],
        "status": status.value,
        "program": row["program"],
        "program_name": row["program_name"],
        "source_program": row["source_program"],
        "machine": row["machine"],
        "progress": _progress(row, clock, runner, left),
        "error": None if error is None else error.view(),
        "tool": row["tool"] if runner is None else runner.tool,
        "hold": bool(row["hold"]) if runner is None else runner.holding,
        "hold_reason": hold_view(row) if runner is None else None,
        "cancelling": runner is not None and runner.cancelling and status is Status.RUNNING,
        "mode": row["mode"],
        "on_error": row["on_error"],
        "note": row["note"],
        "start_line": row["start_line"],
        "end_line": row["end_line"],
        "rerun_of": row["rerun_of"],
        "created_at": row["created_at"],
        "started_at": row["started_at"],
        "ended_at": row["ended_at"],
    }


def _progress(row: Row, clock: Clock, runner: Runner | None, left: Left | None) -> dict[str, Any]:
    done = row["line_done"] if runner is None else runner.ledger.cursor.done
    first, last = row["start_line"], row["end_line"]
    return {
        "line": done,
        "lines": last,
        "acknowledged_lines": max(0, done - first + 1),
        "sent_line": done if runner is None else runner.ledger.cursor.sent,
        "seconds_elapsed": _elapsed(row, clock),
        "seconds_left": None if left is None else round(left.seconds, 1),
        "seconds_left_min": None if left is None else round(left.least_s, 1),
        "seconds_left_max": None if left is None else round(left.most_s, 1),
    }


def _elapsed(row: Row, clock: Clock) -> float | None:
    if row["started_at"] is None:
        return None
    if row["ended_at"] is None:
        passed_s = seconds_since(clock, row["started_at"])
    else:
        began, ended = datetime.fromisoformat(row["started_at"]), datetime.fromisoformat(row["ended_at"])
        passed_s = (ended - began).total_seconds()
    return None if passed_s is None else round(passed_s, 1)
