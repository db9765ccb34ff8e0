"""A real daemon whose mill loses its cable or its power in mid-job, on a pty and on TCP.

The mill lives in a thread of the test, so that it goes on while nobody is connected. The judge is what it executed.
"""

from pathlib import Path

import pytest

from sim.elvinto.settings import SimSettings
from tests.harness.process import LiveMill, Recording, daemon, live_mill, until

pytestmark = pytest.mark.real

BLOCKS = 110
FAST = 15.0
PLAIN = "compact = false"


def program() -> list[str]:
    """Moves that all end somewhere else; without M30, so that nothing at all may be executed twice."""
    return ["G90", *(f"G1X{i}Y{(i * 7) % 40}F4000" for i in range(1, BLOCKS))]


@pytest.mark.parametrize(("link", "repeat"), [("pty", "silent"), ("tcp", "reack")])
def test_unplugged_and_plugged_in_again_the_job_goes_on(tmp_path: Path, link: str, repeat: str) -> None:
    settings = SimSettings(speed_factor=FAST, repeat="reack" if repeat == "reack" else "silent")
    with (
        live_mill(tmp_path, settings, link=link) as (mill, recording),
        daemon(tmp_path, mill.port, machine="resume_within = 60", elvinto=PLAIN) as one,
    ):
        job = one.connected().job("\n".join(program()))
        for blocks in (20, 60):
            recording.reached(blocks)
            mill.unplug()
            until(lambda: one.get("/machines/mill")["link"] == "connecting", why=one.log)
            assert one.get(f"/jobs/{job}")["status"] == "running"
            mill.replug()
        view = one.status(job, "completed", "failed", "interrupted")
        assert view["status"] == "completed", (view, one.get(f"/jobs/{job}/events"))
        assert recording.blocks() == program()
        assert one.get("/machines/mill")["link_stats"]["errors"]["lost"] == 2


@pytest.mark.parametrize("heard", [True, False])
def test_a_mill_that_restarts_gets_not_one_block_more(tmp_path: Path, heard: bool) -> None:
    """`heard`: its READY arrives; otherwise it restarts while the cable is out, and the daemon has to find out."""
    with (
        live_mill(tmp_path, SimSettings(speed_factor=FAST), link="pty") as (mill, recording),
        daemon(tmp_path, mill.port, machine="resume_within = 60", elvinto=PLAIN) as one,
    ):
        job = one.connected().job("\n".join(program()))
        recording.reached(50)
        stood = _restarted(mill, recording, heard=heard)
        view = one.status(job, "interrupted")
        one.connected()
        view = one.status(job, "interrupted")
        # Between two batches all that was executed is certain, and what is in doubt begins behind it.
        assert view["progress"]["line"] <= len(stood) <= view["error"]["line_to"]
        assert view["progress"]["line"] == view["error"]["line_from"] - 1
        plan = one.post(f"/jobs/{job}/recover")
        assert (plan["restarted"], plan["can_continue"]) == (True, False)
        refused = one.http.post(f"/api/v1/jobs/{job}/recover", json={"action": "continue"})
        assert (refused.status_code, refused.json()["code"]) == (409, "wrong_state")
        assert recording.blocks() == stood == program()[: len(stood)]


def _restarted(mill: LiveMill, recording: Recording, *, heard: bool) -> list[str]:
    """What it had executed when its power came back."""
    if heard:
        mill.restart()
    else:
        mill.unplug()
        mill.restart()
        mill.replug()
    return recording.blocks()
