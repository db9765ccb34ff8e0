"""What happens to a machine: epochs, IDs that never go back, states, and noise that does not drown what matters."""

import asyncio
from pathlib import Path
from typing import Any

import pytest

from protocol.engine import OpenWork
from protocol.events import (
    Alarm,
    BatchFailed,
    BatchReceived,
    BatchSent,
    LinkLost,
    LinkReady,
    MachineRestarted,
    MessageSeen,
    ProgramEnded,
    ProtocolFault,
    StateReported,
    ToolRequested,
)
from server.background.dbthread import InlineDb
from server.background.worker import InlineWorker
from server.config.model import MachineConfig
from server.live.hub import Hub
from server.live.subscription import Filter
from server.machine.machine import FIRST_ID, ID_STEP, Machine
from tests.harness.fakes import ScriptedEngine
from tests.harness.simloop import LoopClock, run_simulated
from tests.harness.textframes import messages


class FakePort:
    def __init__(self) -> None:
        self.written: list[bytes] = []
        self.closed = False

    def write(self, data: bytes) -> None:
        self.written.append(data)

    def close(self) -> None:
        self.closed = True


class Bench:
    """A machine with a scripted engine for each epoch."""

    def __init__(self, folder: Path, *, highest_id: int = 0) -> None:
        loop = asyncio.get_running_loop()
        clock = LoopClock(loop)
        self.hub = Hub(clock=clock.now, first_seq=0)
        self.reader = self.hub.subscribe(Filter())
        self.db = InlineDb(folder / "m.db", loop)
        self.engines: list[ScriptedEngine] = []
        self.ports: list[FakePort] = []
        self.lost: Any = None
        self.data: Any = None
        self.work: list[OpenWork | None] = []
        self.machine = Machine(
            MachineConfig(name="router", port="/dev/null"),
            db=self.db,
            hub=self.hub,
            clock=clock,
            opener=self.open,
            engine=self.engine,
            highest_id=highest_id,
            reader=InlineWorker(),
        )

    async def open(self, _url: str, _baud: int, on_data: Any, on_lost: Any) -> FakePort:
        self.ports.append(FakePort())
        self.data, self.lost = on_data, on_lost
        return self.ports[-1]

    def engine(self, *, first_id: int, now: float, open_work: OpenWork | None) -> Any:
        self.engines.append(ScriptedEngine(first_id))
        self.work.append(open_work)
        return self.engines[-1]

    async def connected(self) -> None:
        self.machine._reconnect.want()
        await asyncio.sleep(0.01)
        self.tell(LinkReady())

    def tell(self, *events: Any) -> None:
        self.engines[-1].events.extend(events)
        self.machine.pump()

    async def close(self) -> None:
        self.machine.close()
        await self.db.close()


@pytest.mark.parametrize(
    ("highest", "first"), [(0, FIRST_ID), (1, 2000), (1000, 2000), (1001, 3000), (123_456, 125_000)]
)
def test_a_new_epoch_begins_far_above_every_id_before(tmp_path: Path, highest: int, first: int) -> None:
    async def main() -> None:
        bench = Bench(tmp_path, highest_id=highest)
        await bench.connected()
        assert bench.engines[0].next_id == first
        assert first == FIRST_ID or first - highest >= ID_STEP
        await bench.close()

    run_simulated(main())


def test_ids_that_an_engine_used_for_itself_are_not_used_again(tmp_path: Path) -> None:
    async def main() -> None:
        bench = Bench(tmp_path)
        await bench.connected()
        bench.engines[0].next_id = 7_500
        bench.lost("unplugged")
        await asyncio.sleep(10)
        assert bench.engines[1].next_id == 9_000
        await bench.close()

    run_simulated(main())


def test_the_words_for_the_link(tmp_path: Path) -> None:
    async def main() -> None:
        bench = Bench(tmp_path)
        machine = bench.machine
        assert (machine.link_status, machine.state.status) == ("disconnected", "offline")
        machine._reconnect.want()
        await asyncio.sleep(0.01)
        assert machine.link_status == "connecting"
        bench.tell(LinkReady())
        assert (machine.link_status, machine.state.status) == ("connected", "idle")
        bench.tell(LinkLost("no answer"))
        assert (machine.link_status, machine.state.status) == ("connecting", "offline")
        assert bench.ports[0].closed, "whoever gives the machine up closes the port"
        machine.close()
        assert machine.link_status == "disconnected"
        await bench.close()

    run_simulated(main())


def test_bytes_and_losses_of_an_old_epoch_are_not_heard(tmp_path: Path) -> None:
    async def main() -> None:
        bench = Bench(tmp_path)
        await bench.connected()
        old_data, old_lost = bench.data, bench.lost
        old_lost("unplugged")
        await asyncio.sleep(10)
        bench.tell(LinkReady())
        old_data(b"OK,ID<#1000;")
        old_lost("once more")
        assert bench.engines[1].heard == []
        assert bench.machine.link_status == "connected"
        bench.data(b"OK,ID<#2000;")
        assert bench.engines[1].heard == [b"OK,ID<#2000;"]
        await bench.close()

    run_simulated(main())


def test_without_a_job_a_new_epoch_inherits_nothing(tmp_path: Path) -> None:
    async def main() -> None:
        bench = Bench(tmp_path)
        await bench.connected()
        assert bench.work == [None]
        await bench.close()

    run_simulated(main())


def test_faults_are_all_counted_and_told_once_a_second_of_each_kind(tmp_path: Path) -> None:
    async def main() -> None:
        bench = Bench(tmp_path)
        await bench.connected()
        before = bench.hub.published["log"]
        for _ in range(500):
            bench.tell(ProtocolFault("checksum", "x"), ProtocolFault("malformed", "y"))
        assert bench.hub.published["log"] - before == 2
        assert bench.machine.metrics.link_errors == {"checksum": 500, "malformed": 500}
        await asyncio.sleep(1.1)
        bench.tell(ProtocolFault("checksum", "x"))
        assert bench.hub.published["log"] - before == 3
        await bench.close()

    run_simulated(main())


def test_an_alarm_is_told_when_it_comes_and_when_it_goes(tmp_path: Path) -> None:
    async def main() -> None:
        bench = Bench(tmp_path)
        await bench.connected()
        alarm = StateReported("alarm", {}, alarm=Alarm(2, "x", "end limit switch hit"))
        bench.tell(alarm, alarm, StateReported("idle", {}))
        assert bench.hub.published["alarm"] == 2
        await bench.close()

    run_simulated(main())


def test_states_have_a_rising_number_and_a_time(tmp_path: Path) -> None:
    async def main() -> None:
        bench = Bench(tmp_path)
        await bench.connected()
        before = bench.machine.state_view()
        await asyncio.sleep(2)
        bench.tell(StateReported("run", {"x": 1.0}, feed_mm_min=600.0))
        after = bench.machine.state_view()
        assert after["seq"] > before["seq"]
        assert after["at"] > before["at"]
        assert (after["position"]["machine"], after["feed"]) == ({"x": 1.0}, 600.0)
        await bench.close()

    run_simulated(main())


def test_a_state_that_is_sent_says_how_long_the_newest_batch_took(tmp_path: Path) -> None:
    async def main() -> None:
        bench = Bench(tmp_path)
        await bench.connected()
        reader = bench.hub.subscribe(Filter(topics=frozenset({"state"})))
        bench.tell(BatchSent(7, 1))
        await asyncio.sleep(0.25)
        bench.tell(BatchReceived(7), StateReported("run", {"x": 1.0}))
        (message,) = messages(reader.take(asyncio.get_running_loop().time()))
        assert (message["data"]["ack_s"], message["data"]["batch_s"]) == (0.25, None)
        await bench.close()

    run_simulated(main())


def test_a_batch_that_failed_says_nothing_of_how_long_one_takes(tmp_path: Path) -> None:
    async def main() -> None:
        bench = Bench(tmp_path)
        await bench.connected()
        bench.tell(BatchSent(7, 1), BatchFailed(7, "stop", None, "stopped by hand"), BatchReceived(7))
        assert bench.machine.metrics.ack_latency.count == 0
        await bench.close()

    run_simulated(main())


def test_the_console_has_what_was_said(tmp_path: Path) -> None:
    async def main() -> None:
        bench = Bench(tmp_path)
        await bench.connected()
        bench.tell(MessageSeen(">", "INIT;"), MessageSeen("<", "OK,ID<#1;"))
        assert [entry["text"] for entry in bench.machine.console(5)] == ["INIT;", "OK,ID<#1;"]
        assert bench.hub.published["console"] == 2
        await bench.close()

    run_simulated(main())


def test_a_tool_that_a_program_of_its_own_wants_is_told(tmp_path: Path) -> None:
    async def main() -> None:
        bench = Bench(tmp_path)
        await bench.connected()
        bench.tell(ToolRequested(3))
        assert bench.hub.published["tool"] == 1
        assert bench.machine.state.tool_requested == 3
        await bench.close()

    run_simulated(main())


@pytest.mark.parametrize(
    "event",
    [ProgramEnded(), MachineRestarted("READY"), StateReported("alarm", {}, alarm=Alarm(1, None, "")), LinkLost("x")],
)
def test_what_ends_a_program_of_its_own(tmp_path: Path, event: Any) -> None:
    async def main() -> None:
        bench = Bench(tmp_path)
        await bench.connected()
        bench.machine.own_program = "part1.nc"
        bench.tell(event)
        assert bench.machine.own_program is None
        await bench.close()

    run_simulated(main())


def test_a_port_that_cannot_be_opened_is_told_once(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level("INFO", "server.machine.machine")
    reason = "no such file"

    async def main() -> None:
        nonlocal reason
        bench = Bench(tmp_path)

        async def refuse(*_args: Any) -> FakePort:
            raise OSError(reason)

        bench.machine._opener = refuse  # type: ignore[assignment]
        bench.machine._reconnect.want()
        await asyncio.sleep(300)
        assert bench.hub.published["log"] == 1
        assert bench.machine.link_status == "connecting"
        assert [one.message.split(": ")[-1] for one in caplog.records] == ["no such file"]
        reason = "permission denied"
        await asyncio.sleep(60)
        assert [one.message.split(": ")[-1] for one in caplog.records] == ["no such file", "permission denied"]
        await bench.close()

    run_simulated(main())
