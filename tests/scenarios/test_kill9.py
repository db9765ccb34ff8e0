"""kill -9 of a real daemon in the middle of a job on a pty, again and again: every block is executed once, in order.

The mill is a process of its own and writes down what it executes; the daemon's word is not asked. The moments are
seeded, so that they differ and a failure names its seed; what must come out is the same for every moment.
"""

import random
import time
from pathlib import Path

import pytest

from tests.harness.effort import more
from tests.harness.process import MACHINE, Daemon, Recording, daemon, sim_process

pytestmark = pytest.mark.real

SEEDED = (("silent", 1), ("reack", 2))
"""Both answers to a repeated ID that the standard allows, and where the kills fall."""
BLOCKS = 150
KILLS = 2
FAST = ("--speed", "20")
"""A batch of a second takes 50 ms."""
LATER_S = 0.1
"""A kill falls up to so long after a certain block has begun: anywhere between a header and the end of its batch."""
PLAIN = "compact = false"


def program() -> list[str]:
    """Moves that all end somewhere else, as they go over the wire, and what belongs to a program."""
    moves = [f"G1X{i}Y{(i * 7) % 40}F{3000 + i % 3 * 1000}" for i in range(1, BLOCKS)]
    moves[90:90] = ["M5", "M3S8000", "G0Z5"]
    return ["G21", "G90", "M3S12000", *moves, "M5", "M30"]


def once(executed: list[str]) -> list[str]:
    """Only the end of a program may be executed twice: it does no harm (elvinto §5.6)."""
    while executed[-2:] == ["M30", "M30"]:
        executed = executed[:-1]
    return executed


@pytest.mark.parametrize(("repeat", "seed"), SEEDED)
def test_after_a_short_break_the_job_goes_on_by_itself(tmp_path: Path, repeat: str, seed: int) -> None:
    print(f"seed {seed}")
    rng = random.Random(seed)
    with (
        sim_process(tmp_path, "--repeat", repeat, *FAST) as (port, recording),
        daemon(tmp_path, port, machine="resume_within = 60", elvinto=PLAIN) as one,
    ):
        job = one.connected().job("\n".join(program()))
        for blocks in sorted(rng.sample(range(5, BLOCKS - 50), KILLS)):
            recording.reached(blocks)
            time.sleep(rng.uniform(0, LATER_S))
            one.kill9()
            one.start()
        # Once more while it is still finding out what became of the batch in flight.
        time.sleep(rng.uniform(0, 0.6))
        one.kill9()
        one.start()
        view = one.status(job, "completed", "failed", "interrupted")
        assert view["status"] == "completed", (view, one.get(f"/jobs/{job}/events"))
        assert once(recording.blocks()) == program()


@pytest.mark.parametrize(("repeat", "seed"), SEEDED[: more(1)])
def test_after_a_long_break_nothing_moves_until_somebody_says_continue(tmp_path: Path, repeat: str, seed: int) -> None:
    print(f"seed {seed}")
    rng = random.Random(seed)
    with (
        sim_process(tmp_path, "--repeat", repeat, *FAST) as (port, recording),
        daemon(tmp_path, port, machine="resume_within = 0.5", elvinto=PLAIN) as one,
    ):
        job = one.connected().job("\n".join(program()))
        recording.reached(rng.randrange(5, BLOCKS - 50))
        time.sleep(rng.uniform(0, LATER_S))
        one.kill9()
        time.sleep(0.5)  # the break
        one.start().connected()
        stood = _stands_still(one, job, recording)
        one.post(f"/jobs/{job}/recover", {"action": "continue"})
        one.status(job, "completed")
        # The modes that a hand could have changed are said again; that moves nothing, and it stands in the history.
        (said,) = [event["data"] for event in one.get(f"/jobs/{job}/events") if event["type"] == "prologue"]
        again = [block.replace(" ", "") for block in said["blocks"]]
        assert not [block for block in again if set("XYZABC") & set(block)]
        assert once(recording.blocks()) == stood + again + program()[len(stood) :]


def _stands_still(one: Daemon, job: int, recording: Recording) -> list[str]:
    """Interrupted, everything proven, and no motion; what was executed so far."""
    view = one.status(job, "interrupted")
    assert view["error"]["code"] == "break_too_long"
    assert view["error"]["line_from"] is None, "the position is proven, so no line is in doubt"
    stood = recording.blocks()
    assert stood == program()[: len(stood)]
    plan = one.post(f"/jobs/{job}/recover")
    assert plan["certain_line"] == view["progress"]["line"] == len(stood)
    assert plan["next_line"] == len(stood) + 1
    assert plan["can_continue"]
    time.sleep(1.0)  # longer than resume_within and than any batch
    assert recording.blocks() == stood
    assert one.get(f"/machines/{MACHINE}/state")["status"] == "idle"
    return stood
