"""The shells: a machine in memory, behind a port, behind a pseudo-terminal."""

import asyncio
import os
from collections.abc import Coroutine
from pathlib import Path
from typing import Any

import pytest

from sim.elvinto.machine import VirtualElvinto
from sim.elvinto.settings import SimSettings
from sim.faults import Drop, FaultRates
from sim.grbl.machine import VirtualGrbl
from sim.grbl.simsettings import SimSettings as GrblSettings
from sim.shell import PtyShell, open_memory, recording, run, serve_pty, serve_tcp, split_address
from tests.harness.elvinto_peer import frame, names, unframe
from tests.harness.simloop import run_simulated

INSTANT = SimSettings(instant=True)
FAST = SimSettings(speed_factor=200.0, boot_s=0.01)


def play(story: Coroutine[Any, Any, None]) -> None:
    """On a real loop, for ports and terminals."""

    async def bounded() -> None:
        await asyncio.wait_for(story, 20)

    asyncio.run(bounded())


def batch(wire_id: int, *blocks: str) -> bytes:
    return frame(f"GCODE,DATA<#{'|'.join(blocks)};", wire_id)


class Ear:
    """Collects what comes until the messages waited for are there."""

    def __init__(self) -> None:
        self.data = b""
        self._came = asyncio.Event()

    def hear(self, data: bytes) -> None:
        self.data += data
        self._came.set()

    async def until(self, name: str) -> list[str]:
        """The messages up to and with the first of that name; they are taken away."""
        mark = f";{name}".encode()
        while not (mark in self.data and self.data.endswith(b";")):
            self._came.clear()
            await self._came.wait()
        messages, self.data = unframe(self.data), b""
        return messages


# In memory.


def test_memory_answers_after_write_and_not_within() -> None:
    async def story() -> None:
        ear = Ear()
        link = await open_memory(VirtualElvinto(INSTANT), ear.hear)
        link.write(batch(1, "G0X1"))
        assert ear.data == b""
        assert names(await ear.until("OK")) == ["RECEIVED", "OK"]
        link.close()
        link.write(batch(2, "G0X2"))
        await asyncio.sleep(0)
        await asyncio.sleep(0)
        assert ear.data == b""

    run_simulated(story())


def test_memory_machine_lives_on_when_nobody_is_there() -> None:
    async def story() -> None:
        machine = VirtualElvinto(INSTANT, now=asyncio.get_running_loop().time())
        ear = Ear()
        first = await open_memory(machine, ear.hear)
        first.write(batch(7, "G0X1"))
        await ear.until("OK")
        first.close()
        machine.press_emergency(asyncio.get_running_loop().time())
        second = await open_memory(machine, ear.hear)
        await asyncio.sleep(0)
        assert ear.data == b"", "what was said to nobody is lost"
        second.write(frame("RESETALERT;", 8))
        assert names(await ear.until("STATE")) == ["RECEIVED", "OK", "STATE"]
        second.close()

    run_simulated(story())


def test_memory_with_faults() -> None:
    async def story() -> None:
        ear = Ear()
        faults = FaultRates(drops=(Drop("RECEIVED"),))
        link = await open_memory(VirtualElvinto(INSTANT), ear.hear, faults=faults)
        link.write(batch(1, "G0X1"))
        assert names(await ear.until("OK")) == ["OK"]
        link.close()

    run_simulated(story())


def test_memory_hears_what_befalls_the_machine() -> None:
    async def story() -> None:
        ear = Ear()
        machine = VirtualElvinto(INSTANT)
        link = await open_memory(machine, ear.hear)
        machine.press_emergency(asyncio.get_running_loop().time())
        link.turn()
        assert names(await ear.until("STATE")) == ["STATE"]
        link.close()
        link.turn()

    run_simulated(story())


def test_memory_lets_time_pass() -> None:
    async def story() -> None:
        ear = Ear()
        loop = asyncio.get_running_loop()
        machine = VirtualElvinto(FAST, now=loop.time())
        link = await open_memory(machine, ear.hear, baud=921600)
        link.write(batch(1, "G0X100"))
        assert names(await ear.until("OK")) == ["RECEIVED", "OK"]
        assert machine.executed[0].ended_at is not None
        assert machine.executed[0].ended_at - machine.executed[0].at == pytest.approx(1.2 / 200)
        link.close()

    run_simulated(story())


# TCP.


@pytest.mark.real
def test_tcp_a_new_client_takes_the_place_of_the_old() -> None:
    async def story() -> None:
        shell = await serve_tcp(VirtualElvinto(FAST, now=asyncio.get_running_loop().time()), "127.0.0.1", 0)
        reader, writer = await asyncio.open_connection("127.0.0.1", shell.port)
        writer.write(batch(1, "G0X100"))
        said = await reader.readuntil(b";OK,ID<#1;")
        assert names(unframe(said)) == ["RECEIVED", "OK"]
        reader2, writer2 = await asyncio.open_connection("127.0.0.1", shell.port)
        assert await reader.read() == b""
        writer2.write(batch(2, "G0X0"))
        assert names(unframe(await reader2.readuntil(b";OK,ID<#2;"))) == ["RECEIVED", "OK"]
        for each in (writer, writer2):
            each.close()
        await shell.close()

    play(story())


@pytest.mark.real
def test_tcp_unplug_and_replug() -> None:
    async def story() -> None:
        machine = VirtualElvinto(FAST, now=asyncio.get_running_loop().time())
        shell = await serve_tcp(machine, "127.0.0.1", 0)
        reader, writer = await asyncio.open_connection("127.0.0.1", shell.port)
        writer.write(batch(1, "G0X1"))
        await reader.readuntil(b";OK,ID<#1;")
        port = shell.port
        await shell.unplug()
        with pytest.raises(ConnectionRefusedError):
            await asyncio.open_connection("127.0.0.1", port)
        await shell.replug()
        assert shell.port == port
        reader, again = await asyncio.open_connection("127.0.0.1", port)
        again.write(batch(2, "G0X2"))
        await reader.readuntil(b";OK,ID<#2;")
        assert [block.text for block in machine.executed] == ["G0X1", "G0X2"]
        for each in (writer, again):
            each.close()
        await shell.close()

    play(story())


# Pseudo-terminals.


class Port:
    """The daemon's end of a pseudo-terminal."""

    def __init__(self, path: Path) -> None:
        self.ear = Ear()
        self._fd = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        asyncio.get_running_loop().add_reader(self._fd, self._read)

    def _read(self) -> None:
        try:
            self.ear.hear(os.read(self._fd, 4096))
        except OSError:
            asyncio.get_running_loop().remove_reader(self._fd)

    def write(self, data: bytes) -> None:
        os.write(self._fd, data)

    def close(self) -> None:
        asyncio.get_running_loop().remove_reader(self._fd)
        os.close(self._fd)


async def ask(port: Port, wire_id: int, *blocks: str) -> list[str]:
    port.write(batch(wire_id, *blocks))
    return names(await port.ear.until("OK"))


@pytest.mark.real
def test_pty_survives_closing_and_opening(tmp_path: Path) -> None:
    async def story() -> None:
        link = tmp_path / "mill"
        machine = VirtualElvinto(FAST, now=asyncio.get_running_loop().time())
        shell = await serve_pty(machine, link)
        assert shell.path == link
        for wire_id in (1, 2, 3):
            port = Port(link)
            assert await ask(port, wire_id, f"G0X{wire_id}", "M3S\r1000") == ["RECEIVED", "OK"]
            port.close()
        assert machine.executed_count == 6
        shell.close()
        assert not link.is_symlink()

    play(story())


@pytest.mark.real
def test_pty_is_raw(tmp_path: Path) -> None:
    async def story() -> None:
        machine = VirtualElvinto(FAST, now=asyncio.get_running_loop().time())
        shell = await serve_pty(machine, tmp_path / "mill")
        port = Port(tmp_path / "mill")
        port.write(bytes(range(256)) + b";")
        assert await ask(port, 1, "G0X1") == ["RECEIVED", "OK"]
        assert machine.dropped["malformed"] + machine.dropped["no_header"] >= 1
        port.close()
        shell.close()

    play(story())


@pytest.mark.real
def test_pty_that_nobody_reads_does_not_stop_the_machine(tmp_path: Path) -> None:
    async def story() -> None:
        loop = asyncio.get_running_loop()
        machine = VirtualElvinto(INSTANT, now=loop.time())
        shell = await serve_pty(machine, tmp_path / "mill")
        for wire_id in range(1, 3000):
            shell.pump.hear(batch(wire_id, "W95"))
        assert machine.last_id == 2999
        shell.close()

    play(story())


@pytest.mark.real
def test_pty_unplug_and_replug(tmp_path: Path) -> None:
    async def story() -> None:
        link = tmp_path / "mill"
        machine = VirtualElvinto(FAST, now=asyncio.get_running_loop().time())
        shell = await serve_pty(machine, link)
        port = Port(link)
        await ask(port, 1, "G0X1")
        shell.unplug()
        shell.unplug()
        assert not link.exists()
        with pytest.raises(OSError, match="Input/output error"):
            port.write(b"gone?")
        port.close()
        shell.replug()
        port = Port(link)
        assert await ask(port, 2, "G0X2") == ["RECEIVED", "OK"]
        port.close()
        shell.close()

    play(story())


@pytest.mark.real
def test_pty_does_not_overwrite_a_file(tmp_path: Path) -> None:
    async def story() -> None:
        path = tmp_path / "mill"
        path.write_text("precious", encoding="utf-8")
        with pytest.raises(FileExistsError, match="another path"):
            await serve_pty(VirtualElvinto(INSTANT), path)
        assert path.read_text(encoding="utf-8") == "precious"
        path.unlink()
        path.symlink_to("/nowhere")
        shell = await serve_pty(VirtualElvinto(INSTANT), path)
        assert isinstance(shell, PtyShell)
        assert path.readlink() != Path("/nowhere")
        path.unlink()
        path.symlink_to("/somebody/elses")
        shell.close()
        assert path.is_symlink(), "the link was not ours any more"

    play(story())


# Another kind of machine.


def test_lines_and_realtime_bytes_arrive_at_the_pace_of_the_wire() -> None:
    async def story() -> None:
        loop = asyncio.get_running_loop()
        machine = VirtualGrbl(GrblSettings(), now=loop.time())
        said: list[tuple[float, bytes]] = []
        link = await open_memory(machine, lambda data: said.append((loop.time(), data)), baud=1000)
        link.write(b"G21 (a comment)\n?")
        await asyncio.sleep(2.0)
        link.close()
        answers = b"".join(data for _, data in said)
        assert answers == b"ok\r\n<Idle|MPos:0.000,0.000,0.000|FS:0,0|WCO:0.000,0.000,0.000>\r\n"
        whole_at = next(at for nth, (at, _) in enumerate(said) if sum(len(d) for _, d in said[: nth + 1]) >= 4)
        assert whole_at == pytest.approx(0.16 + 0.04), "16 bytes there, 4 back, 10 ms each"

    run_simulated(story())


@pytest.mark.real
def test_opening_a_port_resets_a_board_that_dtr_resets() -> None:
    async def story() -> None:
        settings = GrblSettings(reset_on_open=True, boot_s=0.01)
        shell = await serve_tcp(VirtualGrbl(settings, now=asyncio.get_running_loop().time()), "127.0.0.1", 0)
        for _ in range(2):
            reader, writer = await asyncio.open_connection("127.0.0.1", shell.port)
            assert await reader.readuntil(b"help]\r\n") == b"\r\nGrbl 1.1h ['$' for help]\r\n"
            writer.close()
        await shell.close()

    play(story())


@pytest.mark.real
def test_run_serves_a_grbl_controller(tmp_path: Path) -> None:
    async def story() -> None:
        ready: asyncio.Future[str] = asyncio.get_running_loop().create_future()
        settings = GrblSettings(instant=True)
        record = tmp_path / "record"
        serving = run(settings, pty=None, tcp="127.0.0.1:0", record=record, faults=None, seed=0, ready=ready.set_result)
        task = asyncio.create_task(serving)
        reader, writer = await asyncio.open_connection(*split_address(await ready))
        writer.write(b"G21\nG1 X1 F100 (one)\n")
        await reader.readuntil(b"ok\r\nok\r\n")
        assert record.read_text(encoding="utf-8") == "1\tG21\n2\tG1X1F100\n"
        writer.close()
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task

    play(story())


# The whole program.


def test_recording_is_on_disk_line_by_line(tmp_path: Path) -> None:
    path = tmp_path / "record"
    path.write_text("1000\tG0X0\n", encoding="utf-8")
    with recording(path) as on_block:
        machine = VirtualElvinto(INSTANT, on_block=on_block)
        machine.receive_data(batch(1001, "G0X1", "G0\n X2"), 0.0)
        assert path.read_text(encoding="utf-8") == "1000\tG0X0\n1001\tG0X1\n1001\tG0 X2\n"
    with recording(None) as on_block:
        assert on_block is None


@pytest.mark.real
@pytest.mark.parametrize("kind", ["pty", "tcp"])
def test_run_serves_until_it_is_cancelled(tmp_path: Path, kind: str) -> None:
    async def story() -> None:
        ready: asyncio.Future[str] = asyncio.get_running_loop().create_future()
        task = asyncio.create_task(
            run(
                FAST,
                pty=tmp_path / "mill" if kind == "pty" else None,
                tcp="127.0.0.1:0" if kind == "tcp" else None,
                record=tmp_path / "record",
                faults=None,
                seed=0,
                ready=ready.set_result,
            )
        )
        address = await ready
        if kind == "pty":
            port = Port(Path(address))
            assert await ask(port, 5, "G0X1") == ["RECEIVED", "OK"]
            port.close()
        else:
            reader, writer = await asyncio.open_connection(*split_address(address))
            writer.write(batch(5, "G0X1"))
            await reader.readuntil(b";OK,ID<#5;")
            writer.close()
        assert (tmp_path / "record").read_text(encoding="utf-8") == "5\tG0X1\n"
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task
        assert not (tmp_path / "mill").is_symlink()

    play(story())


@pytest.mark.parametrize("text", ["tcp://127.0.0.1:8421", "127.0.0.1:8421"])
def test_addresses(text: str) -> None:
    assert split_address(text) == ("127.0.0.1", 8421)
    assert split_address("[::1]:5") == ("::1", 5)


@pytest.mark.parametrize("text", ["8421", "host", ":8421", "host:", "host:x", "host:99999"])
def test_addresses_that_are_none(text: str) -> None:
    with pytest.raises(ValueError, match="HOST:PORT"):
        split_address(text)
