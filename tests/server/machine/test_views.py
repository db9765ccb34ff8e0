"""JSON for people: from rows alone, and from a runner that knows more."""

import asyncio
from typing import Any

from jobs.cursor import Cursor
from jobs.feed import Feed
from jobs.ledger import Ledger
from jobs.pace import Left
from jobs.runner import Runner
from protocol.events import Alarm
from protocol.machine import MachineState
from server.machine.views import job_view, state_view
from tests.harness.fakes import ListSource, batch
from tests.harness.rows import AT, job_fields
from tests.harness.simloop import LoopClock, run_simulated


def row(**changes: Any) -> dict[str, Any]:
    fields = {"id": 3, "status": "queued", "line_done": 0, "tool": None, "restarted": 0, "created_at": AT}
    none = dict.fromkeys(
        ("error_code", "error_message", "error_line_from", "error_line_to", "started_at", "ended_at"), None
    )
    return {**job_fields(), **fields, **none, **changes}


def seen(
    row: dict[str, Any], runner: Runner | None = None, *, at: float = 0.0, left: Left | None = None
) -> dict[str, Any]:
    async def main() -> dict[str, Any]:
        await asyncio.sleep(at)
        return job_view(row, LoopClock(asyncio.get_running_loop()), runner, left)

    return run_simulated(main())


def test_a_job_that_waits() -> None:
    view = seen(row(hold=1))
    assert (view["status"], view["hold"], view["error"]) == ("queued", True, None)
    assert view["progress"] == {
        "line": 0,
        "lines": 10,
        "acknowledged_lines": 0,
        "sent_line": 0,
        "seconds_elapsed": None,
        "seconds_left": None,
        "seconds_left_min": None,
        "seconds_left_max": None,
    }


def test_a_job_that_has_ended() -> None:
    ended = row(
        status="failed",
        line_done=4,
        started_at=AT,
        ended_at="2026-03-01T09:01:00.000Z",
        error_code="alarm",
        error_message="x",
        error_line_from=5,
        error_line_to=6,
    )
    view = seen(ended, at=9999.0)
    assert view["error"] == {"code": "alarm", "message": "x", "line_from": 5, "line_to": 6}
    assert (view["progress"]["acknowledged_lines"], view["progress"]["seconds_elapsed"]) == (4, 60.0)


def test_a_job_under_way_is_seen_through_its_runner() -> None:
    ledger = Ledger(cursor=Cursor(8, 6, 5, 4), seconds_done=20.0)
    runner = Runner(3, 10.0, Feed(ListSource([batch(1)])), ledger)
    view = seen(row(status="queued", started_at=AT), runner, at=12.34, left=Left(40.04, 30.0, 55.54))
    progress = view["progress"]
    assert (view["status"], progress["line"], progress["sent_line"]) == ("running", 4, 6)
    assert (progress["seconds_elapsed"], progress["seconds_left"]) == (12.3, 40.0)
    assert (progress["seconds_left_min"], progress["seconds_left_max"]) == (30.0, 55.5)


def test_lines_before_the_start_are_not_counted_as_acknowledged() -> None:
    view = seen(row(start_line=5, line_done=7))
    assert (view["progress"]["line"], view["progress"]["acknowledged_lines"]) == (7, 3)


def test_a_state() -> None:
    state = MachineState(
        status="alarm", position={"y": 1.00004, "x": 2.123456}, alarm=Alarm(2, "x", "end"), absolute=True
    )
    view = state_view(state, seq=7, at=AT)
    assert view["position"] == {"machine": {"x": 2.1235, "y": 1.0}, "work": {}}
    assert view["alarm"] == {"code": 2, "axis": "x", "message": "end"}
    assert (view["seq"], view["at"], view["feed"]) == (7, AT, None)
