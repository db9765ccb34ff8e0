"""Ports of every kind: bytes both ways, exclusive, and one word about their loss."""

import asyncio
import os
import pty
import threading
import tty
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager, contextmanager, suppress
from random import Random
from typing import Any

import pytest

from server.machine.serialport import READ_BYTES, PortOpener, list_ports
from tests.harness.simloop import run_simulated

pytestmark = pytest.mark.real

MORE_THAN_THE_KERNEL_HOLDS = 32 * 1024 * 1024


class Ends:
    """What comes out of a port."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.lost: list[str] = []

    async def until(self, condition: Callable[[], bool]) -> None:
        async with asyncio.timeout(10):
            while not condition():
                await asyncio.sleep(0.001)


@contextmanager
def pseudo_terminal() -> Iterator[tuple[int, str]]:
    ours, theirs = pty.openpty()
    tty.setraw(theirs)
    name = os.ttyname(theirs)
    os.close(theirs)
    try:
        yield ours, name
    finally:
        os.close(ours)


def test_a_device_carries_bytes_both_ways() -> None:
    async def main() -> None:
        with pseudo_terminal() as (ours, name):
            ends = Ends()
            port = await PortOpener("elvinto")(name, 115200, ends.data.extend, ends.lost.append)
            port.write(b"INIT;")
            assert os.read(ours, 100) == b"INIT;"
            os.write(ours, b"READY;")
            await ends.until(lambda: bytes(ends.data) == b"READY;")
            port.close()
            await asyncio.sleep(0)
            assert ends.lost == [], "whoever closes it knows"

    asyncio.run(main())


def test_a_device_is_ours_alone() -> None:
    async def main() -> None:
        with pseudo_terminal() as (_ours, name):
            ends = Ends()
            port = await PortOpener("elvinto")(name, 115200, ends.data.extend, ends.lost.append)
            with pytest.raises(OSError, match=rf"^Could not exclusively lock port {name}: Resource"):
                await PortOpener("elvinto")(name, 115200, ends.data.extend, ends.lost.append)
            port.close()
            await asyncio.sleep(0)

    asyncio.run(main())


def test_a_device_is_opened_again_at_once_also_while_its_driver_takes_long_to_close_it() -> None:
    async def main() -> None:
        with pseudo_terminal() as (ours, name):
            ends = Ends()
            opener = PortOpener("elvinto")
            port: Any = await opener(name, 115200, ends.data.extend, ends.lost.append)
            close, let_go = port._device.close, threading.Event()
            port._device.close = lambda: (let_go.wait(10), close())
            port.close()
            opening = asyncio.ensure_future(opener(name, 115200, ends.data.extend, ends.lost.append))
            await asyncio.sleep(0)
            let_go.set()
            again = await opening
            again.write(b"INIT;")
            assert os.read(ours, 100) == b"INIT;"
            again.close()
            await asyncio.sleep(0)

    asyncio.run(main())


def test_a_device_that_goes_away_is_lost_once() -> None:
    async def main() -> None:
        ends = Ends()
        with pseudo_terminal() as (_ours, name):
            port = await PortOpener("elvinto")(name, 115200, ends.data.extend, ends.lost.append)
        await ends.until(lambda: bool(ends.lost))
        port.write(b"nobody hears this")
        port.close()
        await asyncio.sleep(0.01)
        assert len(ends.lost) == 1

    asyncio.run(main())


def test_a_device_is_lost_with_a_thousand_files_open_too(monkeypatch: pytest.MonkeyPatch) -> None:
    def out_of_range(*_: object) -> None:
        raise ValueError("filedescriptor out of range in select()")

    async def main() -> None:
        ends = Ends()
        with pseudo_terminal() as (_ours, name):
            await PortOpener("elvinto")(name, 115200, ends.data.extend, ends.lost.append)
            monkeypatch.setattr("serial.serialposix.select.select", out_of_range)
        await ends.until(lambda: bool(ends.lost))
        await asyncio.sleep(0.01)
        assert len(ends.lost) == 1

    asyncio.run(main())


def test_what_a_device_does_not_take_at_once_waits_beside_the_loop_and_goes_out_in_order() -> None:
    async def main() -> None:
        with pseudo_terminal() as (ours, name):
            os.set_blocking(ours, False)
            ends = Ends()
            port = await PortOpener("grbl")(name, 115200, ends.data.extend, ends.lost.append)
            said = b"".join(b"%07d\n" % number for number in range(32_768))
            for start in range(0, len(said), 1024):
                port.write(said[start : start + 1024])  # nobody reads: the device is soon full
            heard = bytearray()
            async with asyncio.timeout(10):
                while len(heard) < len(said):
                    with suppress(BlockingIOError):
                        heard += os.read(ours, 65_536)
                    await asyncio.sleep(0)
            assert bytes(heard) == said
            port.close()
            await asyncio.sleep(0)
            assert ends.lost == []

    asyncio.run(main())


@pytest.mark.parametrize(
    ("path", "reason"),
    [
        ("/dev/no-such-device", "No such file or directory"),
        ("/dev", "Is a directory"),
        ("/dev/null", "Could not configure port: Inappropriate ioctl for device"),
    ],
)
def test_a_device_that_cannot_be_opened_says_why_once(path: str, reason: str) -> None:
    async def main() -> None:
        with pytest.raises(OSError, match=reason) as refused:
            await PortOpener("elvinto")(path, 115200, lambda _data: None, lambda _reason: None)
        assert str(refused.value) == reason

    asyncio.run(main())


def test_a_network_port_carries_bytes_both_ways_and_its_loss_is_told() -> None:
    async def main() -> None:
        heard = bytearray()

        async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            heard.extend(await reader.readexactly(5))
            writer.write(b"READY;")
            await writer.drain()
            writer.close()

        server = await asyncio.start_server(serve, "127.0.0.1", 0)
        number = server.sockets[0].getsockname()[1]
        ends = Ends()
        port = await PortOpener("elvinto")(f"tcp://127.0.0.1:{number}", 0, ends.data.extend, ends.lost.append)
        port.write(b"INIT;")
        await ends.until(lambda: bool(ends.lost))
        assert (bytes(heard), bytes(ends.data), len(ends.lost)) == (b"INIT;", b"READY;", 1)
        port.close()
        server.close()
        with pytest.raises(ConnectionRefusedError):
            await PortOpener("elvinto")(f"tcp://127.0.0.1:{number}", 0, ends.data.extend, ends.lost.append)

    asyncio.run(main())


@asynccontextmanager
async def network_port() -> AsyncIterator[tuple[str, asyncio.Queue[asyncio.StreamWriter]]]:
    """An address, and the other ends of those who connect to it."""
    ends: asyncio.Queue[asyncio.StreamWriter] = asyncio.Queue()

    async def serve(_reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        ends.put_nowait(writer)

    server = await asyncio.start_server(serve, "127.0.0.1", 0)
    try:
        yield f"tcp://127.0.0.1:{server.sockets[0].getsockname()[1]}", ends
    finally:
        server.close()


def test_what_comes_piece_by_piece_is_handed_on_piece_by_piece_and_stays_as_it_was() -> None:
    async def main() -> None:
        async with network_port() as (url, others):
            pieces: list[bytes] = []
            ends = Ends()
            port = await PortOpener("elvinto")(url, 0, pieces.append, ends.lost.append)
            other = await others.get()
            sent = [b"CRC16,VALUE<#1", b"5;REC", b"E", b"IVED,ID<#7;"]
            for count, piece in enumerate(sent, 1):
                other.write(piece)
                await ends.until(lambda count=count: len(pieces) == count)  # type: ignore[misc]
            assert pieces == sent, "the buffer is filled again, what was handed on is not"
            port.close()
            other.close()

    asyncio.run(main())


def test_a_burst_of_more_than_the_buffer_holds_comes_whole_and_in_order() -> None:
    async def main() -> None:
        async with network_port() as (url, others):
            pieces: list[bytes] = []
            ends = Ends()
            burst = Random(7).randbytes(5 * READ_BYTES + 123)
            port = await PortOpener("elvinto")(url, 0, pieces.append, ends.lost.append)
            other = await others.get()
            other.write(burst)
            await ends.until(lambda: sum(map(len, pieces)) >= len(burst))
            assert b"".join(pieces) == burst
            assert max(map(len, pieces)) <= READ_BYTES
            port.close()
            other.close()

    asyncio.run(main())


def test_a_port_that_is_closed_in_the_middle_of_a_burst_hands_on_nothing_more() -> None:
    async def main() -> None:
        async with network_port() as (url, others):
            pieces: list[bytes] = []
            ends = Ends()

            def close_at_once(data: bytes) -> None:
                pieces.append(data)
                port.close()

            port = await PortOpener("elvinto")(url, 0, close_at_once, ends.lost.append)
            other = await others.get()
            other.write(bytes(3 * READ_BYTES))
            await ends.until(lambda: bool(pieces))
            await ends.until(other.is_closing)
            port.write(b"nobody hears this")
            assert len(pieces) == 1
            assert ends.lost == [], "whoever closes it knows"
            other.close()

    asyncio.run(main())


def test_what_still_waits_to_go_out_when_a_network_port_is_closed_does_not_go_out() -> None:
    async def main() -> None:
        heard = 0
        read_on, done = asyncio.Event(), asyncio.Event()

        async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            nonlocal heard
            await read_on.wait()
            with suppress(ConnectionError):
                while data := await reader.read(READ_BYTES):
                    heard += len(data)
            writer.close()
            done.set()

        server = await asyncio.start_server(serve, "127.0.0.1", 0)
        ends = Ends()
        url = f"tcp://127.0.0.1:{server.sockets[0].getsockname()[1]}"
        port = await PortOpener("elvinto")(url, 0, ends.data.extend, ends.lost.append)
        port.write(bytes(MORE_THAN_THE_KERNEL_HOLDS))
        port.close()
        read_on.set()
        async with asyncio.timeout(10):
            await done.wait()
        assert heard < MORE_THAN_THE_KERNEL_HOLDS
        server.close()

    asyncio.run(main())


def test_a_network_port_that_is_cut_off_in_the_middle_of_a_message_is_lost_once() -> None:
    async def main() -> None:
        async with network_port() as (url, others):
            ends = Ends()
            port = await PortOpener("elvinto")(url, 0, ends.data.extend, ends.lost.append)
            other = await others.get()
            other.write(b"RECEIVED,I")
            await ends.until(lambda: len(ends.data) == 10)
            other.transport.abort()
            await ends.until(lambda: bool(ends.lost))
            port.close()
            await asyncio.sleep(0.01)
            assert (bytes(ends.data), len(ends.lost)) == (b"RECEIVED,I", 1)

    asyncio.run(main())


@pytest.mark.parametrize("url", ["tcp://nowhere", "tcp://:7"])
def test_an_address_without_host_or_port(url: str) -> None:
    async def main() -> None:
        with pytest.raises(OSError, match="tcp://host:port"):
            await PortOpener("elvinto")(url, 0, lambda _data: None, lambda _reason: None)

    asyncio.run(main())


def test_the_built_in_machine_outlives_its_connections() -> None:
    async def main() -> None:
        opener, ends = PortOpener("elvinto"), Ends()
        for _ in range(2):
            port = await opener("sim:?boot_s=0", 115200, ends.data.extend, ends.lost.append)
            port.close()
        assert len(opener._simulated) == 1

    run_simulated(main())


def test_the_ports_of_this_computer_can_be_listed() -> None:
    assert all({"device", "description", "hardware_id"} == set(port) for port in list_ports())
