"""The real daemon as a process of its own, and a virtual mill on a TCP port of this one.

Linux only: CPU and memory are read from /proc. The one rule: while something is measured nobody asks the daemon
anything; how far it is, the machine knows.
"""

import asyncio
import os
import re
import sys
import time
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import httpx

from bench.tap import Tap
from sim.elvinto.events import Executed
from sim.elvinto.machine import VirtualElvinto
from sim.elvinto.settings import SimSettings
from sim.shell import Pump, TcpShell

MACHINE = "mill"
HOST = "127.0.0.1"
OURS = ("W90", "W95", "W98")
"""Blocks that the engine sends of its own accord."""
START_WITHIN_S = 120.0
CHUNK_LINES = 2000
KB_PER_MB = 1024


class _TappedPump(Pump):
    tap: Tap | None = None

    def hear(self, data: bytes) -> None:
        if self.tap is not None:
            self.tap.down(data, self._loop.time())
        super().hear(data)


class Mill:
    """A virtual mill that counts what it does."""

    def __init__(self, settings: SimSettings) -> None:
        now = asyncio.get_running_loop().time()
        self.machine = VirtualElvinto(settings, now=now, on_block=self._count)
        self.blocks = 0
        self.batches = 0
        self.ended = False
        self.url = ""
        self.tap = Tap()
        self._last_id = -1

    def executed(self) -> list[Executed]:
        """The blocks of programs, in order, as far as they are kept."""
        return [block for block in self.machine.executed if block.text not in OURS]

    @asynccontextmanager
    async def serve(self, *, baud: int = 0, tapped: bool = False) -> AsyncIterator["Mill"]:
        """Listens until the end of the block."""
        pump = _TappedPump(self.machine, baud=baud)
        shell = TcpShell(pump)
        await shell.open(HOST, 0)
        if tapped:
            pump.tap, say, loop = self.tap, pump.say, asyncio.get_running_loop()
            assert say is not None

            def said(data: bytes) -> None:
                self.tap.up(data, loop.time())
                say(data)

            pump.say = said
        self.url = f"tcp://{HOST}:{shell.port}"
        try:
            yield self
        finally:
            await shell.close()

    async def until(self, *, blocks: int | None = None, within_s: float = 300.0) -> None:
        """Wait for so many blocks of programs, or for the end of the program. Raises TimeoutError."""
        async with asyncio.timeout(within_s):
            while not (self.ended if blocks is None else self.ended or self.blocks >= blocks):
                await asyncio.sleep(0.01)

    def _count(self, block: Executed) -> None:
        if block.text in OURS:
            return
        self.blocks += 1
        self.batches += block.id != self._last_id
        self._last_id = block.id
        self.ended = self.ended or block.text in ("M30", "M99")


class Daemon:
    """`millstream serve` in another process."""

    def __init__(self, process: asyncio.subprocess.Process, http: httpx.AsyncClient) -> None:
        self._process = process
        self._http = http

    def cpu_s(self) -> float:
        """User and system time of the whole process so far, to 10 ms."""
        fields = Path(f"/proc/{self._process.pid}/stat").read_text().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    def resident_mb(self, *, peak: bool = False) -> float:
        """Resident memory now, or its highest so far (MiB)."""
        name = "VmHWM" if peak else "VmRSS"
        found = re.search(rf"{name}:\s+(\d+) kB", Path(f"/proc/{self._process.pid}/status").read_text())
        assert found is not None
        return int(found[1]) / KB_PER_MB

    async def upload(self, lines: Iterator[str]) -> str:
        """Hand in a program line by line; its id."""
        answer = await self._http.post("/programs", params={"name": "bench.nc"}, content=_chunks(lines))
        answer.raise_for_status()
        return str(answer.json()["id"])

    @property
    def pid(self) -> int:
        """Of its process."""
        return self._process.pid

    @property
    def address(self) -> tuple[str, int]:
        """Where it listens."""
        return self._http.base_url.host, self._http.base_url.port or 80

    async def run(self, program: str, **options: Any) -> int:
        """Begin a job; its id."""
        wanted = {"program": program, "machine": MACHINE, "force": True, **options}
        answer = await self._http.post("/jobs", json=wanted)
        answer.raise_for_status()
        return int(answer.json()["id"])

    async def job(self, job: int) -> dict[str, Any]:
        """How it stands."""
        answer = await self._http.get(f"/jobs/{job}")
        answer.raise_for_status()
        return dict(answer.json())

    async def cancel(self, job: int) -> None:
        """End it after the batch in flight."""
        (await self._http.post(f"/jobs/{job}/cancel")).raise_for_status()

    async def settled(self, job: int, status: str, *, within_s: float = 30.0) -> None:
        """Wait until the job has this status. Raises AssertionError when it does not come."""
        deadline = time.monotonic() + within_s
        while (view := await self.job(job))["status"] != status:
            assert time.monotonic() < deadline, f"job {job} is {view['status']}, not {status}: {view['error']}"
            await asyncio.sleep(0.1)

    async def connected(self, machine: str = MACHINE) -> None:
        """Wait for the machine."""
        async with asyncio.timeout(START_WITHIN_S):
            while (await self._http.get(f"/machines/{machine}")).json()["link"] != "connected":
                await asyncio.sleep(0.05)


@asynccontextmanager
async def daemon(folder: Path, mill: Mill, *, baud: int = 115200, max_batch_blocks: int = 32) -> AsyncIterator[Daemon]:
    """The daemon, connected to `mill`; stopped at the end."""
    machine = (
        f'[[machine]]\nname = "{MACHINE}"\nport = "{mill.url}"\nbaud = {baud}\n'
        f"[machine.elvinto]\nmax_batch_blocks = {max_batch_blocks}\n"
    )
    async with serving(folder, machine) as running:
        yield running


@asynccontextmanager
async def serving(folder: Path, machine: str) -> AsyncIterator[Daemon]:
    """The daemon with one `[[machine]]` of that text, connected; stopped at the end."""
    config = folder / "millstream.toml"
    config.write_text(f'[server]\nport = 0\nlog_level = "warning"\ndata_dir = "{folder}"\n{machine}')
    log = (folder / "daemon.log").open("wb")
    process = await asyncio.create_subprocess_exec(
        sys.executable,
        "-c",
        "from server.cli import main; main()",
        "serve",
        "--config",
        str(config),
        stdout=asyncio.subprocess.PIPE,
        stderr=log,
        cwd=Path(__file__).resolve().parent.parent,
        env={key: value for key, value in os.environ.items() if not key.startswith("MILLSTREAM_")},
    )
    try:
        assert process.stdout is not None
        async with asyncio.timeout(START_WITHIN_S):
            said = (await process.stdout.readline()).decode()
        found = re.search(r"http://\S+", said)
        assert found is not None, f"the daemon did not start: {(folder / 'daemon.log').read_text()}"
        async with httpx.AsyncClient(base_url=f"{found[0]}/api/v1", trust_env=False, timeout=300.0) as http:
            running = Daemon(process, http)
            await running.connected()
            yield running
    finally:
        if process.returncode is None:
            process.terminate()
        await process.wait()
        log.close()


async def _chunks(lines: Iterator[str]) -> AsyncIterator[bytes]:
    chunk: list[str] = []
    for line in lines:
        chunk.append(line)
        if len(chunk) >= CHUNK_LINES:
            yield ("\n".join(chunk) + "\n").encode()
            chunk.clear()
    yield "".join(f"{line}\n" for line in chunk).encode()
