"""Daemons and virtual mills as processes of their own, and a mill in a thread whose cable a test can pull.

For the few tests that touch real ports, processes and clocks. The one rule: the judge is what the mill executed (its
recording), never what the daemon says of itself; and every wait has an end.
"""

import asyncio
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

import httpx

from sim.elvinto.machine import VirtualElvinto
from sim.elvinto.settings import SimSettings
from sim.shell import PtyShell, TcpShell, recording, serve_pty, serve_tcp

T = TypeVar("T")

WITHIN_S = 60.0
"""For everything that takes a second on a computer that has nothing else to do."""
LOOK_EVERY_S = 0.03
MACHINE = "mill"
ENVIRON = {**os.environ, "NO_PROXY": "127.0.0.1", "PYTHONUNBUFFERED": "1"}
MILLSTREAM = (sys.executable, "-c", "from server.cli import main; main()")


def until(what: Callable[[], T], *, within_s: float = WITHIN_S, why: Callable[[], Any] = lambda: "") -> T:
    """Look until there is something; an AssertionError with `why` when time is up."""
    deadline = time.monotonic() + within_s
    while not (found := what()):
        if time.monotonic() > deadline:
            raise AssertionError(f"not within {within_s:g} s: {why()}")
        time.sleep(LOOK_EVERY_S)
    return found


class Daemon:
    """A `millstream serve` in a process, its configuration and data in `folder`; it can die and be started again."""

    def __init__(
        self,
        folder: Path,
        port: str,
        *,
        server: str = "",
        machine: str = "",
        elvinto: str = "",
        grbl: str | None = None,
        reentry: str = "",
    ) -> None:
        self.folder = folder
        self._process: subprocess.Popen[str] | None = None
        self._http: httpx.Client | None = None
        text = (
            f'[server]\nport = 0\ndata_dir = "{folder}/data"\n{server}\n'
            f'[[machine]]\nname = "{MACHINE}"\nport = "{port}"\n{machine}\n'
        )
        if grbl is None:
            text += f"[machine.elvinto]\n{elvinto}\n"
        else:
            text += f'protocol = "grbl"\n[machine.grbl]\n{grbl}\n'
        text += f"[machine.reentry]\n{reentry}\n" if reentry else ""
        (folder / "millstream.toml").write_text(text, encoding="utf-8")

    @property
    def url(self) -> str:
        """Where it answers; another port after every start."""
        return str(self.http.base_url)

    @property
    def pid(self) -> int:
        """Of the process that runs now."""
        assert self._process is not None, "the daemon is not running"
        return self._process.pid

    @property
    def http(self) -> httpx.Client:
        """A client of the daemon that runs now."""
        assert self._http is not None, "the daemon is not running"
        return self._http

    def start(self) -> "Daemon":
        """Returns when it answers."""
        with (self.folder / "daemon.log").open("a") as log:
            self._process = subprocess.Popen(
                [*MILLSTREAM, "serve"], cwd=self.folder, env=ENVIRON, stdout=subprocess.PIPE, stderr=log, text=True
            )
        assert self._process.stdout is not None
        said = self._process.stdout.readline()
        assert said.startswith("millstream: http://"), f"{said!r}\n{self.log()}"
        url = said.removeprefix("millstream: ").strip()
        self._http = httpx.Client(base_url=url, timeout=30, transport=httpx.HTTPTransport())
        return self

    def kill9(self) -> None:
        """As the power does it."""
        self._end(signal.SIGKILL)

    def stop(self) -> int:
        """In good order; the exit code."""
        return self._end(signal.SIGTERM)

    def _end(self, number: signal.Signals) -> int:
        process, self._process = self._process, None
        http, self._http = self._http, None
        if http is not None:
            http.close()
        if process is None:
            return 0
        assert process.stdout is not None
        process.send_signal(number)
        try:
            return process.wait(WITHIN_S)
        finally:
            process.kill()
            process.wait()
            process.stdout.close()

    def log(self) -> str:
        """What it wrote to its log so far."""
        return (self.folder / "daemon.log").read_text()

    def get(self, path: str) -> Any:
        """GET below /api/v1, which must succeed."""
        return _good(self.http.get(f"/api/v1{path}"))

    def post(self, path: str, body: Any = None) -> Any:
        """POST JSON below /api/v1, which must succeed."""
        return _good(self.http.post(f"/api/v1{path}", json=body))

    def connected(self) -> "Daemon":
        """Wait until the machine takes commands."""
        until(lambda: self.get(f"/machines/{MACHINE}")["link"] == "connected", why=self.log)
        return self

    def job(self, program: str | bytes) -> int:
        """Upload and queue a program; its warnings are meant."""
        stored = _good(self.http.post("/api/v1/programs?name=part.nc", content=program))
        return int(self.post("/jobs", {"program": stored["id"], "machine": MACHINE, "force": True})["id"])

    def status(self, job: int, *wanted: str) -> dict[str, Any]:
        """Wait until the job is in one of these states; its view."""
        until(lambda: self.get(f"/jobs/{job}")["status"] in wanted, why=lambda: (self.get(f"/jobs/{job}"), self.log()))
        return dict(self.get(f"/jobs/{job}"))


def _good(response: httpx.Response) -> Any:
    assert response.is_success, response.text
    return response.json() if response.content else None


@contextmanager
def daemon(folder: Path, port: str, **options: str) -> Iterator[Daemon]:
    """A daemon that runs and does not outlive the test."""
    one = Daemon(folder, port, **options)
    try:
        yield one.start()
    finally:
        one.kill9()


class Recording:
    """What a mill executed, in order, from the file that it writes as each block begins."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def blocks(self) -> list[str]:
        """The blocks of programs, without what the daemon asks of its own accord."""
        if not self.path.exists():
            return []
        complete = self.path.read_text(encoding="utf-8").split("\n")[:-1]
        blocks = [line.partition("\t")[2].replace(" ", "") for line in complete]
        return [block for block in blocks if not block.startswith(("W", "$"))]

    def reached(self, count: int) -> None:
        """Wait until so many blocks have begun."""
        until(lambda: len(self.blocks()) >= count, why=lambda: f"{len(self.blocks())} blocks of {count}")


@contextmanager
def sim_process(folder: Path, *options: str, kind: str = "elvinto") -> Iterator[tuple[str, Recording]]:
    """`millstream sim KIND` on a pty in a process of its own: its port, and what it executed."""
    port, record = folder / "mill", folder / "executed.txt"
    command = [*MILLSTREAM, "sim", kind, "--pty", str(port), "--record", str(record), *options]
    with subprocess.Popen(command, env=ENVIRON, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            assert process.stdout.readline().endswith(f": {port}\n")
            yield str(port), Recording(record)
        finally:
            process.kill()


class LiveMill:
    """A virtual mill on a loop of its own in a thread of this process, so that a test can lay hands on it."""

    def __init__(self, loop: asyncio.AbstractEventLoop, machine: VirtualElvinto, shell: TcpShell | PtyShell) -> None:
        self._loop = loop
        self.machine = machine
        self.shell = shell
        self.port = f"tcp://127.0.0.1:{shell.port}" if isinstance(shell, TcpShell) else str(shell.path)

    def unplug(self) -> None:
        """The cable is out; the mill goes on with what it has."""
        self._do(self._unplug)

    def replug(self) -> None:
        """The cable is in again, at the same address."""
        self._do(self._replug)

    def restart(self) -> None:
        """The mill loses its memory, as after a short cut of its power."""
        self._do(self._restart)

    async def _unplug(self) -> None:
        if isinstance(self.shell, TcpShell):
            await self.shell.unplug()
        else:
            self.shell.unplug()

    async def _replug(self) -> None:
        if isinstance(self.shell, TcpShell):
            await self.shell.replug()
        else:
            self.shell.replug()

    async def _restart(self) -> None:
        self.machine.restart(self._loop.time())
        self.shell.pump.turn()

    def _do(self, what: Callable[[], Any]) -> None:
        asyncio.run_coroutine_threadsafe(what(), self._loop).result(WITHIN_S)


@contextmanager
def live_mill(folder: Path, settings: SimSettings, *, link: str) -> Iterator[tuple[LiveMill, Recording]]:
    """A mill behind `link`, "pty" or "tcp", and what it executed."""
    loop = asyncio.new_event_loop()
    thread = threading.Thread(target=loop.run_forever, name="mill")
    thread.start()
    record = folder / "executed.txt"

    async def build(on_block: Any) -> LiveMill:
        machine = VirtualElvinto(settings, now=loop.time(), on_block=on_block)
        shell = await (serve_tcp(machine, "127.0.0.1", 0) if link == "tcp" else serve_pty(machine, folder / "mill"))
        return LiveMill(loop, machine, shell)

    try:
        with recording(record) as on_block:
            mill = asyncio.run_coroutine_threadsafe(build(on_block), loop).result(WITHIN_S)
            try:
                yield mill, Recording(record)
            finally:
                mill.unplug()
                loop.call_soon_threadsafe(mill.shell.pump.stop)
    finally:
        loop.call_soon_threadsafe(loop.stop)
        thread.join(WITHIN_S)
        loop.close()
