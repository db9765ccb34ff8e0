"""The responders of the Grbl benchmarks as processes: the virtual controller (grblpeer.py), grblsim where it is there.

grblsim.c is a measuring responder on a pseudo-terminal that lies beside the checkout; it is compiled when there is a C
compiler. The one rule: where it cannot be had that is said in the report, never passed over.
"""

import asyncio
import json
import shutil
import subprocess
import sys
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, contextmanager
from pathlib import Path
from typing import Any

from bench.grblpeer import HOST, Seen

SOURCE = Path(__file__).resolve().parents[2] / "shared" / "tools" / "grblsim.c"
ROOT = Path(__file__).resolve().parent.parent
POLL_S = 0.1


class Peer:
    """`bench.grblpeer` in another process."""

    def __init__(self, process: asyncio.subprocess.Process, port: int) -> None:
        self._process = process
        self.port = port
        self.url = f"tcp://{HOST}:{port}"

    async def lines(self) -> int:
        """Lines of programs that it has obeyed."""
        return int((await self._ask(b"lines\n"))["lines"])

    async def until(self, lines: int, *, within_s: float = 600.0) -> None:
        """Wait for so many. Raises TimeoutError."""
        async with asyncio.timeout(within_s):
            while await self.lines() < lines:
                await asyncio.sleep(POLL_S)

    async def news(self) -> dict[str, Any]:
        """`Witness.news`."""
        return await self._ask(b"news\n")

    async def seen(self) -> Seen:
        """What it has seen; it ends with that."""
        return Seen(**await self._ask(b"\n"))

    async def _ask(self, question: bytes) -> dict[str, Any]:
        assert self._process.stdin is not None
        self._process.stdin.write(question)
        return await answer(self._process)


async def answer(process: asyncio.subprocess.Process) -> dict[str, Any]:
    """The next line of a process, which is JSON."""
    assert process.stdout is not None
    return dict(json.loads(await process.stdout.readline()))


@asynccontextmanager
async def process(module: str, *arguments: str) -> AsyncIterator[asyncio.subprocess.Process]:
    """A module of the benchmarks in another process, ended with the block."""
    pipe = asyncio.subprocess.PIPE
    command = (sys.executable, "-m", module, *arguments)
    begun = await asyncio.create_subprocess_exec(*command, stdin=pipe, stdout=pipe, cwd=ROOT, limit=1 << 24)
    try:
        yield begun
    finally:
        if begun.returncode is None:
            begun.kill()
        await begun.wait()


@asynccontextmanager
async def peer(baud: int, acceleration: float) -> AsyncIterator[Peer]:
    """A virtual controller that listens."""
    async with process("bench.grblpeer", str(baud), str(acceleration)) as begun:
        yield Peer(begun, int((await answer(begun))["port"]))


def compiled(folder: Path) -> Path | None:
    """grblsim, or None where its source or a compiler is missing."""
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None or not SOURCE.is_file():
        return None
    program = folder / "grblsim"
    built = subprocess.run([compiler, "-O2", "-w", "-o", program, SOURCE, "-lutil", "-lm"], check=False)
    return program if built.returncode == 0 else None


class Rig:
    """A grblsim that runs: `link` is its port; it has written its figures when `lines` lines are acknowledged."""

    def __init__(self, link: Path, report: Path) -> None:
        self.link = link
        self._report = report

    async def done(self, *, within_s: float = 600.0) -> dict[str, Any]:
        """Its figures, when the program has ended. Raises TimeoutError."""
        async with asyncio.timeout(within_s):
            while not self._report.is_file():
                await asyncio.sleep(POLL_S)
        return dict(json.loads(self._report.read_text()))


@contextmanager
def rig(program: Path, folder: Path, *, lines: int, line_s: float | None = None) -> Iterator[Rig]:
    """A responder on a line of 115200; with `line_s` every line takes so long in its planner."""
    link, report = folder / "tty", folder / "grblsim.json"
    report.unlink(missing_ok=True)
    mode = ["--mode", "wire"] if line_s is None else ["--mode", "planner", "--exec-us", str(line_s * 1e6)]
    command = [str(program), *mode, "--expect", str(lines), "--link", str(link), "--json", str(report)]
    running = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        yield Rig(link, report)
    finally:
        running.terminate()
        running.wait()
