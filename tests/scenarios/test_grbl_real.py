"""kill -9 of a real daemon in the middle of a job on a virtual Grbl on a pty, and the way back by the plan.

The controller is a process of its own and writes down what it executes. Grbl has no memory of lines, so nothing goes on
by itself; every line that is called done must have been executed, once, and every other must be within the doubt.
"""

import random
import time
from pathlib import Path

import pytest

from tests.harness.process import MACHINE, Daemon, Recording, daemon, sim_process

pytestmark = pytest.mark.real

MOVES = 400
PLAIN = "compact = false\nresets_on_open = false"
REENTRY = "clearance = 5.0\nplunge_feed = 300.0\nspindle_wait = 0.1"


def program() -> list[str]:
    """Moves that all end somewhere else, as they go over the wire."""
    moves = [f"G1X{i / 10:g}Y{i * 7 % 40 / 10:g}F{3000 + i % 3 * 1000}" for i in range(1, MOVES)]
    return ["G21", "G90", "G17", "G54", "G94", "M3S1000", "G0Z1", *moves, "G0Z5", "M5", "M30"]


@pytest.mark.parametrize("seed", [1, 2])
def test_a_killed_daemon_names_the_doubt_and_takes_up_by_the_plan(tmp_path: Path, seed: int) -> None:
    print(f"seed {seed}")
    rng = random.Random(seed)
    with (
        sim_process(tmp_path, "--speed", "20", "-o", "homing_lock=false", kind="grbl") as (port, recording),
        daemon(tmp_path, port, grbl=PLAIN, reentry=REENTRY) as one,
    ):
        job = one.connected().job("\n".join(program()))
        recording.reached(rng.randrange(40, MOVES - 150))
        time.sleep(rng.uniform(0, 0.1))
        one.kill9()
        time.sleep(1.0)  # it executes what it has
        executed = recording.blocks()
        one.start().connected()
        view = one.status(job, "interrupted")
        done, error = view["progress"]["line"], view["error"]
        assert executed == program()[: len(executed)], "in order, once each"
        assert done <= len(executed) <= error["line_to"]
        assert error["line_from"] == done + 1
        _stands(one, recording)
        _goes_on_by_the_plan(one, recording, job, line=len(executed) + 1)


def _stands(one: Daemon, recording: Recording) -> None:
    count = len(recording.blocks())
    time.sleep(1.0)
    assert len(recording.blocks()) == count, "nothing goes on by itself"
    assert one.get(f"/machines/{MACHINE}/state")["status"] == "idle"


def _goes_on_by_the_plan(one: Daemon, recording: Recording, job: int, *, line: int) -> None:
    before = len(recording.blocks())
    plan = one.post(f"/jobs/{job}/recover", {"line": line})
    assert [step["text"] for step in plan["steps"] if step["purpose"] == "lift"] == ["G0 Z5"]
    assert len(recording.blocks()) == before, "a plan moves nothing"
    refused = one.http.post(f"/api/v1/jobs/{job}/recover", json={"action": "from_line", "line": line})
    assert (refused.status_code, refused.json()["code"]) == (409, "wrong_state"), "the machine is not homed"
    one.post(f"/jobs/{job}/recover", {"action": "from_line", "line": line, "force": True})
    one.status(job, "completed")
    rest = recording.blocks()[before:]
    steps = [step["text"].replace(" ", "") for step in plan["steps"] if step["text"]]
    assert rest[: len(steps)] == steps
    assert rest[len(steps) :] == program()[line - 1 + plan["takes_over"] :]
