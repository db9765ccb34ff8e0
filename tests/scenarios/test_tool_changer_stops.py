"""Stops while an external changer is there: what each tells it (emc-reason), and that machine and job stand.

The virtual changer is at the other end of a WebSocket, on each controller.
"""

import asyncio
from pathlib import Path

import pytest

from tests.harness.changerbench import ENDED, Story, told_wired
from tests.harness.simloop import until

BEGIN = "G21\nG90\nG1 X1 F240\n"
ONE = f"{BEGIN}T1 M6\nG1 X2\nM30\n"
LONG = BEGIN + "".join(f"G1 X{at}\n" for at in range(2, 60)) + "M30\n"
EACH = pytest.mark.parametrize("protocol", ["elvinto", "grbl", "ncframe"])
TWO = pytest.mark.parametrize("protocol", ["elvinto", "grbl"])


@EACH
def test_cancel_while_a_change_is_pending_is_reason_100(tmp_path: Path, protocol: str) -> None:
    async def story(s: Story) -> None:
        job = await s.bench.job(ONE)
        await s.bench.status(job["id"], "waiting")
        await s.post("stop")
        await s.bench.status(job["id"], "cancelled")
        await asyncio.sleep(5)
        assert s.wired.orders("emc-reason", "emc-abort")[-3:] == [
            ("emc-reason", 100),
            ("emc-abort", True),
            ("emc-abort", False),
        ]
        assert (await s.ended(ONE))["status"] == "completed"

    told_wired(tmp_path, story, protocol=protocol)


def test_an_alarm_of_the_machine_is_reason_3(tmp_path: Path) -> None:
    async def story(s: Story) -> None:
        job = await s.bench.job(LONG)
        await asyncio.sleep(3)
        await s.post("reset")  # in the middle of motion that is an alarm
        view = await s.bench.status(job["id"], *ENDED)
        assert view["error"]["code"] in ("alarm", "machine_reset"), view
        await asyncio.sleep(1)
        assert s.wired.orders("emc-reason")[-1] == ("emc-reason", 3)

    told_wired(tmp_path, story, protocol="grbl")


def test_the_emergency_button_of_the_machine_is_reason_2(tmp_path: Path) -> None:
    async def story(s: Story) -> None:
        job = await s.bench.job(LONG)
        await asyncio.sleep(3)
        s.bench.machine.press_emergency(asyncio.get_running_loop().time())
        s.bench.cable.touch()
        view = await s.bench.status(job["id"], *ENDED)
        assert view["error"]["code"] == "alarm", view
        await asyncio.sleep(1)
        assert s.wired.orders("emc-reason")[-1] == ("emc-reason", 2)
        await s.post("unlock")
        s.bench.machine.press_emergency(asyncio.get_running_loop().time())
        s.bench.cable.touch()
        await asyncio.sleep(2)
        aborts = [order for order in s.wired.orders("emc-reason", "emc-abort") if order[1]]
        assert aborts[-2:] == [("emc-abort", True), ("emc-abort", True)], "without a job, too, and once for each"

    told_wired(tmp_path, story)


@TWO
def test_a_program_that_is_wrong_is_reason_1(tmp_path: Path, protocol: str) -> None:
    async def story(s: Story) -> None:
        view = await s.ended(f"{BEGIN}M6\nG1 X2\nM30\n")
        assert view["error"]["code"] == "no_tool_word"
        await asyncio.sleep(1)
        assert s.wired.orders("emc-reason", "emc-abort")[-3:] == [
            ("emc-reason", 1),
            ("emc-abort", True),
            ("emc-abort", False),
        ]

    told_wired(tmp_path, story, protocol=protocol)


@EACH
def test_e_stop_while_a_change_is_pending(tmp_path: Path, protocol: str) -> None:
    async def story(s: Story) -> None:
        job = await s.bench.job(ONE)
        await s.bench.status(job["id"], "waiting")
        await s.post("estop")
        view = await s.bench.status(job["id"], "failed")
        assert view["error"]["code"] == "estop"
        await asyncio.sleep(2)
        assert ("user-enable-out", False) in s.wired.orders("user-enable-out")
        assert s.wired.orders("emc-reason")[-1] == ("emc-reason", 6)
        assert (await s.io())["estop"] == "user"
        await s.post("unlock")
        await asyncio.sleep(2)
        assert s.wired.orders("emc-reason")[-1] == ("emc-reason", 5)
        await s.at_rest()
        assert (await s.ended(ONE))["status"] == "completed"

    told_wired(tmp_path, story, protocol=protocol)


@EACH
def test_the_external_chain_stops_machine_and_job(tmp_path: Path, protocol: str) -> None:
    async def story(s: Story) -> None:
        job = await s.bench.job(LONG)
        await asyncio.sleep(3)
        s.wired.press_estop()
        view = await s.bench.status(job["id"], "failed", within_s=5)
        assert view["error"]["code"] == "estop"
        await asyncio.sleep(1)
        stood = len(s.bench.executed())
        assert s.wired.orders("emc-reason")[-1] == ("emc-reason", 2)
        await s.post("unlock")
        await asyncio.sleep(3)
        assert (await s.io())["estop"] == "external", "the chain is still open"
        s.wired.release_estop()
        await asyncio.sleep(3)
        assert (await s.io())["estop"] == "external", "the line's return does not switch on"
        await s.post("reset")
        await until(lambda: s.router.tools.io.start_refusal is None, within_s=5)
        assert len(s.bench.executed()) == stood

    told_wired(tmp_path, story, protocol=protocol)
