"""The adapter: agents in memory for what it does, and one on a socket that shows that it is reached."""

import asyncio
import socket
from typing import Any

import pytest

from server.live.hub import Hub
from server.outbound.feed import Feed, Notice
from server.outbound.mtconnect import MAX_LINE_BYTES, MAX_UNSENT_BYTES, SILENT_S, Adapter, Agent, fresh_devices
from server.outbound.shdr import PONG
from server.waysout import WayOut
from tests.harness.simloop import run_simulated
from tests.server.outbound.test_shdr import AT, JOB, STATE


class Line(asyncio.Transport):
    """The agent's side: what it was sent, and how much it left unread."""

    def __init__(self) -> None:
        super().__init__({"peername": ("192.0.2.7", 5000)})
        self.sent = b""
        self.unsent = 0
        self.ended = ""

    def write(self, data: Any) -> None:
        self.sent += data

    def get_write_buffer_size(self) -> int:
        return self.unsent

    def abort(self) -> None:
        self.ended = "aborted"

    def close(self) -> None:
        self.ended = "closed"


def adapter(*names: str, max_clients: int = 8) -> Adapter:
    devices = fresh_devices((name, "xyz") for name in names or ("router",))
    return Adapter(devices, counted=WayOut(), emergency=lambda _name: False, now=lambda: AT, max_clients=max_clients)


def agent(there: Adapter) -> tuple[Agent, Line]:
    one, line = Agent(there), Line()
    one.connection_made(line)
    return one, line


def news(**changes: Any) -> Notice:
    return Notice("state", "router", AT, {**STATE, **changes})


def test_an_agent_is_told_everything_and_then_what_changes() -> None:
    async def main() -> None:
        there = adapter()
        there.hear(news())
        _, line = agent(there)
        assert line.sent.startswith(f"{AT}|avail|AVAILABLE|estop|ARMED|".encode())
        assert line.sent.count(b"\n") == 4
        line.sent = b""
        there.hear(news(feed=60.0))
        there.hear(news(feed=60.0))
        there.hear(Notice("job", "router", AT, JOB))
        assert line.sent.decode().splitlines() == [
            f"{AT}|Fact|60",
            f"{AT}|mode|AUTOMATIC|program|part.nc|line|412",
        ]
        assert there.counted.sent == 6

    run_simulated(main())


def test_before_anything_is_known_everything_is_unavailable() -> None:
    async def main() -> None:
        _, line = agent(adapter())
        assert line.sent.startswith(f"{AT}|avail|UNAVAILABLE|".encode())
        assert f"{AT}|comms|UNAVAILABLE||||\n".encode() in line.sent

    run_simulated(main())


def test_several_machines_have_their_names_before_the_items() -> None:
    async def main() -> None:
        there = adapter("router", "lathe")
        _, line = agent(there)
        assert b"|router:avail|UNAVAILABLE|" in line.sent
        assert b"|lathe:system|UNAVAILABLE||||\n" in line.sent
        line.sent = b""
        there.hear(news())
        assert b"router:execution|ACTIVE" in line.sent
        assert b"lathe" not in line.sent
        there.hear(Notice("state", "unheard-of", AT, STATE))

    run_simulated(main())


def test_ping_is_answered_whole_or_in_pieces_and_nothing_else_is() -> None:
    async def main() -> None:
        one, line = agent(adapter())
        line.sent = b""
        for piece in (b"* PI", b"NG\r", b"\n"):
            assert line.sent == b""
            one.data_received(piece)
        assert line.sent == PONG == b"* PONG 10000\n"
        one.data_received(b"* device: x\nM3 S1000\n|execution|READY\n\n")
        assert line.sent == PONG
        one.data_received(b"* PING\n" * 1000)
        assert line.sent == PONG * 2, "a flood of questions makes no flood of answers"

    run_simulated(main())


def test_an_agent_that_does_not_read_is_dropped_and_the_others_are_told() -> None:
    async def main() -> None:
        there = adapter()
        (_, slow), (_, good) = agent(there), agent(there)
        assert there.counted.connected == 2
        slow.unsent = MAX_UNSENT_BYTES + 1
        good.sent = b""
        there.hear(news())
        assert slow.ended == "aborted"
        assert good.sent != b""
        assert (there.counted.connected, there.counted.dropped) == (1, 1)

    run_simulated(main())


@pytest.mark.parametrize("data", [b"x" * (MAX_LINE_BYTES + 1), b"x" * (MAX_LINE_BYTES + 1) + b"\n"])
def test_a_line_without_an_end_is_no_agent(data: bytes) -> None:
    async def main() -> None:
        one, line = agent(adapter())
        one.data_received(data)
        assert line.ended == "aborted"
        one.data_received(b"* PING\n")

    run_simulated(main())


def test_an_agent_whose_heartbeat_stops_is_dropped() -> None:
    async def main() -> None:
        there = adapter()
        (one, line), (_, quiet) = agent(there), agent(there)
        for _ in range(5):
            one.data_received(b"* PING\n")
            await asyncio.sleep(SILENT_S - 1)
        assert line.ended == ""
        await asyncio.sleep(2)
        assert line.ended == "aborted"
        assert quiet.ended == "", "one that never asked may be a person with telnet"

    run_simulated(main())


def test_more_agents_than_allowed_are_refused() -> None:
    async def main() -> None:
        there = adapter(max_clients=1)
        one, first = agent(there)
        refused, second = agent(there)
        assert (first.ended, second.ended, second.sent) == ("", "aborted", b"")
        refused.connection_lost(None)
        assert there.counted.failures == 1
        one.connection_lost(OSError("reset"))
        _, third = agent(there)
        assert third.ended == ""
        assert there.counted.connected == 1

    run_simulated(main())


@pytest.mark.real
def test_over_a_socket_from_the_hub_to_the_agent() -> None:
    async def main() -> None:
        hub, there = Hub(), adapter()
        listener = socket.create_server(("127.0.0.1", 0))
        feed = Feed(hub, rate_hz=50.0, now_stands=lambda: [news(status="idle")])
        serving = asyncio.create_task(there.run(listener, feed))
        reader, writer = await asyncio.open_connection(*listener.getsockname())
        writer.write(b"* PING\n")
        assert (await reader.readuntil(b"comms|NORMAL||||\n")).count(b"avail|AVAILABLE") == 1
        assert await reader.readline() == PONG
        hub.publish("state", "router", {**STATE, "status": "hold"})
        assert b"|execution|FEED_HOLD" in await reader.readline()
        serving.cancel()
        await asyncio.gather(serving, return_exceptions=True)
        assert await reader.read() == b"", "it says good-bye"
        writer.close()
        await writer.wait_closed()
        assert hub.readers == 0

    asyncio.run(asyncio.wait_for(main(), 5))
