"""An external tool changer over the API on each controller: the virtual changer at the other end of a WebSocket.

The truth about tools is in the virtual changer's magazine. The orders of single pins, row by row of the sheet, are in
test_tool_changer_rows.py.
"""

import asyncio
from pathlib import Path

import pytest

from sim.changer.changer import VirtualChanger
from sim.changer.settings import ChangerSettings
from tests.harness.asgisocket import AsgiSocket
from tests.harness.changerbench import ENDED, ROUTER, Story, Wired, desk, told, told_wired
from tests.harness.simloop import until
from tests.harness.workshop import MACHINE

BEGIN = "G21\nG90\nG1 X1 F240\n"
ONE = f"{BEGIN}T1 M6\nG1 X2\nM30\n"
LONG = BEGIN + "".join(f"G1 X{at}\n" for at in range(2, 60)) + "M30\n"
EACH = pytest.mark.parametrize("protocol", ["elvinto", "grbl", "ncframe"])
TWO = pytest.mark.parametrize("protocol", ["elvinto", "grbl"])
LOST = -1000.0


@EACH
@pytest.mark.parametrize(
    ("reason", "status", "message"),
    [(7, "completed", None), (-5, "failed", "toolchanger error -5")],
)
def test_what_a_fault_in_the_change_means(
    tmp_path: Path, protocol: str, reason: int, status: str, message: str | None
) -> None:
    async def story(s: Story) -> None:
        job = await s.bench.job(ONE)
        await s.bench.status(job["id"], "waiting")
        await asyncio.sleep(0.5)
        s.wired.fault(reason)
        view = await s.bench.status(job["id"], *ENDED)
        assert view["status"] == status, view
        error = view["error"]
        assert (None if error is None else (error["code"], error["message"])) == (
            None if message is None else ("tool_change_failed", message)
        )
        assert s.wired.changer.magazine.spindle == 0
        io = await s.io()
        assert (io["tool"], io["faulted"]) == (0, True)
        assert io["parameters"] == {"#5060": 1.0, "#5600": 1.0, "#5601": float(reason)}
        assert ("emc-reason", 101) in s.wired.orders("emc-reason")
        again = await s.ended(ONE)
        assert again["status"] == status, "the latch aborts the next M6 likewise"
        await asyncio.sleep(1)
        await s.post("tool/clear-fault")
        assert (await s.io())["parameters"]["#5060"] == 0.0
        assert (await s.ended(ONE))["status"] == "completed"
        assert s.wired.changer.magazine.spindle == 1

    told_wired(tmp_path, story, protocol=protocol)


@EACH
def test_a_fault_while_idle_aborts_the_next_change_before_anything_moves(tmp_path: Path, protocol: str) -> None:
    async def story(s: Story) -> None:
        s.wired.fault(-2)
        await asyncio.sleep(1)
        view = await s.ended(ONE)
        assert view["error"]["code"] == "tool_change_failed"
        assert not s.went_to_the_place

    told_wired(tmp_path, story, protocol=protocol)


def test_a_lathe_is_told_the_tool_of_an_m6_that_was_left_out(tmp_path: Path) -> None:
    async def story(s: Story) -> None:
        s.wired.fault(3)
        await asyncio.sleep(1)
        job = await s.bench.job(f"{BEGIN}T2 M6\nG1 X2\nM0\nT2 M6\nG1 X3\nM30\n")
        await s.bench.status(job["id"], "paused")
        assert s.bench.executed() == ["G1 X1000 F240", "G1 X1000 F240", "M0"]
        await s.post("tool/clear-fault")
        await s.post("resume")
        await s.bench.status(job["id"], "completed")
        assert s.bench.executed()[3:] == ["M6 T2", "G1 X1000 F240", "M30"]
        assert s.wired.changer.magazine.spindle == 2

    told_wired(tmp_path, story, protocol="ncframe")


@TWO
def test_done_and_fault_at_once_is_believed_by_nobody(tmp_path: Path, protocol: str) -> None:
    async def story(s: Story) -> None:
        job = await s.bench.job(ONE)
        await s.bench.status(job["id"], "waiting")
        await asyncio.sleep(30)
        assert (await s.bench.status(job["id"], "waiting"))["status"] == "waiting"
        io = await s.io()
        assert (io["tool"], io["waiting_for"], io["may_confirm"]) == (None, "verdict", True)
        await s.post("tool/confirm")
        await s.bench.status(job["id"], "completed")
        assert (await s.io())["tool"] == 1

    told_wired(tmp_path, story, protocol=protocol, changer=ChangerSettings(both=1.0))


@EACH
def test_a_lost_changer_fails_the_change_and_nobody_knows_the_tool(tmp_path: Path, protocol: str) -> None:
    async def story(s: Story) -> None:
        job = await s.bench.job(ONE)
        await s.bench.status(job["id"], "waiting")
        await asyncio.sleep(0.5)
        s.wired.close()
        await s.wired.socket.disconnect()
        view = await s.bench.status(job["id"], *ENDED)
        assert (view["status"], view["error"]["code"]) == ("failed", "tool_change_failed")
        io = await s.io()
        assert (io["connected"], io["tool"], io["parameters"]["#5601"]) == (False, None, LOST)
        await s.drive({"tool-changed": True}, 409)
        async with AsgiSocket(desk()[1], query={"topics": "io"}) as socket:
            wired = Wired(s.wired.changer, socket)
            await until(lambda: s.router.tools.io.connected, within_s=5)
            await asyncio.sleep(1)
            assert (await s.io())["refusal"] == "it is not known which tool is in the spindle"
            await s.post("tool/set", tool=0)
            await s.post("tool/clear-fault")
            assert (await s.ended(ONE))["status"] == "completed"
            wired.close()

    told_wired(tmp_path, story, protocol=protocol)


@TWO
def test_a_changer_that_is_lost_while_a_job_cuts_lets_it_cut_on(tmp_path: Path, protocol: str) -> None:
    async def story(s: Story) -> None:
        job = await s.bench.job(LONG)
        await asyncio.sleep(3)
        s.wired.close()
        await s.wired.socket.disconnect()
        await s.bench.status(job["id"], "completed")
        assert (await s.io())["refusal"] == "the tool changer is not connected"

    told_wired(tmp_path, story, protocol=protocol)


@EACH
def test_a_changer_that_says_nothing_is_waited_for_in_sight(tmp_path: Path, protocol: str) -> None:
    async def story(s: Story) -> None:
        job = await s.bench.job(ONE)
        view = await s.bench.status(job["id"], "waiting", within_s=60)
        assert view["tool"] == 1
        io = await s.io()
        assert (io["waiting_for"], io["overdue"]) == ("tool-prepared", True)
        await s.post("tool/fail")
        view = await s.bench.status(job["id"], *ENDED)
        assert (view["status"], view["error"]["code"]) == ("failed", "tool_change_failed")
        assert not s.went_to_the_place

    told_wired(tmp_path, story, protocol=protocol, changer=ChangerSettings(silence=1.0), prepare_timeout=10.0)


@TWO
def test_a_changer_that_prepares_and_then_says_nothing_is_answered_for_by_a_person(
    tmp_path: Path, protocol: str
) -> None:
    async def story(s: Story) -> None:
        job = await s.bench.job(ONE)
        await s.bench.status(job["id"], "waiting")
        await s.post("tool/confirm", 409)
        await asyncio.sleep(25)
        io = await s.io()
        assert (io["waiting_for"], io["overdue"], io["may_confirm"]) == ("tool-changed", True, True)
        assert "Tool" not in (await s.io())["pins"], "nothing is guessed"
        await s.post("tool/confirm")
        await s.bench.status(job["id"], "completed")
        assert (await s.io())["tool"] == 1

    told_wired(
        tmp_path, story, protocol=protocol, changer=ChangerSettings(stuck={"tool-changed": False}), change_timeout=20.0
    )


@TWO
def test_an_abort_that_is_not_acknowledged_lets_no_job_begin_and_is_told(tmp_path: Path, protocol: str) -> None:
    async def story(s: Story) -> None:
        s.wired.changer.settings = ChangerSettings(acknowledges_aborts=False)
        job = await s.bench.job(ONE)
        await s.bench.status(job["id"], "waiting")
        await s.post("stop")
        await s.bench.status(job["id"], "cancelled")
        await asyncio.sleep(3)
        io = await s.io()
        assert (io["waiting_for"], io["overdue"]) == ("emc-abort-ack", True)
        assert io["refusal"] == "the tool changer has not acknowledged the last abort"
        held = await s.bench.job(ONE)
        await asyncio.sleep(60)
        assert (await s.bench.status(held["id"], "queued"))["status"] == "queued"
        await s.post("tool/confirm")
        assert (await s.io())["refusal"] is None
        events = await s.get("io/events")
        said = [event["data"]["message"] for event in events if event["type"] == "tool_message"]
        assert "The changer has not acknowledged the abort in time (emc-abort-ack)." in said

    told_wired(tmp_path, story, protocol=protocol, ack_timeout=2.0)


@TWO
def test_a_start_change_that_is_not_acknowledged_is_told_and_moves_nothing(tmp_path: Path, protocol: str) -> None:
    async def story(s: Story) -> None:
        job = await s.bench.job(ONE)
        await s.bench.status(job["id"], "waiting")
        io = await s.io()
        assert (io["waiting_for"], io["overdue"], io["state"]) == ("start-change-ack", True, "starting")
        assert not s.went_to_the_place
        await s.post("tool/confirm")
        await s.bench.status(job["id"], "completed")
        assert s.wired.changer.magazine.spindle == 1

    stuck = ChangerSettings(stuck={"start-change-ack": False})
    told_wired(tmp_path, story, protocol=protocol, changer=stuck, support_start_change=True, ack_timeout=2.0)


@pytest.mark.parametrize("protocol", ["elvinto", "ncframe"])
def test_a_job_that_waits_for_a_changer_outlives_a_crash_and_stands_still_behind_it(
    tmp_path: Path, protocol: str
) -> None:
    async def story(s: Story) -> None:
        job = await s.bench.job(ONE)
        await s.bench.status(job["id"], "waiting")
        s.wired.close()
        shop = await s.restarted()
        router = shop.machines[MACHINE]
        async with AsgiSocket(desk()[1], query={"topics": "io"}) as socket:
            wired = Wired(VirtualChanger(ChangerSettings()), socket)
            await until(lambda: router.tools.io.connected, within_s=5)
            await asyncio.sleep(20)
            assert (await shop.jobs.get(job["id"]))["status"] == "waiting", "no handshake in an e-stop"
            router.tools.estop_reset()
            await s.bench.status(job["id"], "paused", within_s=30)
            assert wired.changer.magazine.spindle == 1
            router.resume()
            await s.bench.status(job["id"], "completed")
            wired.close()

    told_wired(tmp_path, story, protocol=protocol)


def test_a_grbl_job_that_waits_for_a_changer_is_interrupted_by_a_crash_and_its_tool_is_known(tmp_path: Path) -> None:
    """The controller may have been reset meanwhile, so nothing goes on by itself."""

    async def story(s: Story) -> None:
        job = await s.bench.job(f"{BEGIN}T1 M6\nG1 X2\nT2 M6\nG1 X3\nM30\n")
        await s.bench.status(job["id"], "waiting")
        await until(lambda: s.router.tools.io.tool == 1, within_s=60)
        await s.bench.status(job["id"], "waiting")
        s.wired.close()
        shop = await s.restarted()
        view = await s.bench.status(job["id"], "interrupted", within_s=30)
        assert view["error"]["code"] == "link_lost"
        assert shop.machines[MACHINE].tools.io.tool == 1

    told_wired(tmp_path, story, protocol="grbl")


@TWO
def test_protocol_version_1_has_no_abort_pins_and_changes_tools_all_the_same(tmp_path: Path, protocol: str) -> None:
    async def story(s: Story) -> None:
        names = {pin["name"] for pin in (await s.io())["pins"]}
        assert not [name for name in names if "abort" in name or "fault" in name or "start" in name or "reason" in name]
        await s.drive({"emc-abort-ack": True}, 409)
        job = await s.bench.job(f"{BEGIN}T5\nM6\nG1 X2\nM30\n")
        await s.rises("tool-prepare")
        await s.drive({"tool-prepared": True})
        await s.drive({"tool-prepared": False})
        await s.rises("tool-change")
        await s.post("stop")
        await s.bench.status(job["id"], "cancelled")
        assert not s.pin("tool-change")
        assert (await s.io())["refusal"] is None, "nobody has to acknowledge it"
        job = await s.bench.job(f"{BEGIN}T5\nM6\nG1 X2\nM30\n")
        await s.rises("tool-prepare")
        await s.drive({"tool-prepared": True})
        await s.rises("tool-change")
        await s.drive({"tool-changed": True})
        await s.bench.status(job["id"], "completed")
        assert (await s.io())["tool"] == 5

    async def connected(s: Story) -> None:
        await s.drive({"emc-enable-in": True})
        await story(s)

    told(tmp_path, connected, protocol=protocol, kind="external", protocol_version=1, start_in_estop=False)


@EACH
def test_a_random_changer_exchanges_pockets_and_its_table_is_kept(tmp_path: Path, protocol: str) -> None:
    async def story(s: Story) -> None:
        text = "T0 P0\nT1 P1\nT2 P2\n"
        answer = await s.client.put(f"{ROUTER}/tools", json={"text": text})
        assert (answer.status_code, answer.json()["random"]) == (200, True)

        async def pockets() -> dict[int, int]:
            return {tool["number"]: tool["pocket"] for tool in (await s.get("tools"))["tools"]}

        program = f"{BEGIN}T1 M6\nG1 X2\nT2 M6\nG1 X3\nM30\n"
        assert (await s.ended(program))["status"] == "completed"
        assert s.wired.changer.magazine.spindle == 2
        assert await pockets() == {2: 0, 0: 1, 1: 2}
        job = await s.ended(f"{BEGIN}T3 M6\nG1 X2\nM30\n")
        assert (job["error"]["code"], "tool 3 is not in the tool table" in job["error"]["message"]) == (
            "tool_change_failed",
            True,
        )
        s.wired.close()
        shop = await s.restarted()
        kept = shop.machines[MACHINE].tools.io
        assert kept.tool == 2
        assert kept.tool_table is not None
        assert {tool.number: tool.pocket for tool in kept.tool_table.tools} == {2: 0, 0: 1, 1: 2}

    changer = ChangerSettings(magazine={1: 1, 2: 2}, random=True)
    told_wired(tmp_path, story, protocol=protocol, changer=changer, random=True)


def test_outputs_are_not_driven_from_outside(tmp_path: Path) -> None:
    async def story(s: Story) -> None:
        await s.drive({"tool-change": True}, 409)
        await s.drive({"nonsense": True}, 422)
        await s.drive({"tool-changed": 1}, 422)
        await s.drive({"tool-prepared": True, "toolchanger-reason": -3})

    told_wired(tmp_path, story)


def test_the_tool_table_is_kept_and_a_tool_that_is_not_in_it_fails_the_job(tmp_path: Path) -> None:
    async def story(s: Story) -> None:
        answer = await s.client.put(f"{ROUTER}/tools", json={"text": "T1 P4 D6 ;six\nT9 nonsense\n"})
        assert (answer.status_code, answer.json()["warnings"][0]["line"]) == (200, 2)
        shown = await s.get("tools")
        assert [(tool["number"], tool["pocket"]) for tool in shown["tools"]] == [(1, 4)]
        back = await s.client.put(f"{ROUTER}/tools", json={"tools": shown["tools"]})
        assert back.json()["text"] == shown["text"]
        view = await s.ended(ONE.replace("T1", "T2"))
        assert view["error"]["code"] == "tool_change_failed"
        shop = await s.restarted()
        assert [tool.number for tool in shop.machines[MACHINE].tools.io.tool_table.tools] == [1]  # type: ignore[union-attr]

    told_wired(tmp_path, story)
