"""A workshop made of fakes: what the API is tested against without a machine. It records what it was asked.

What it answers are the examples of the API's own models, so a fake cannot drift from the contract. The whole daemon,
with a virtual machine, is in `workshop.py`.
"""

import asyncio
import copy
import sqlite3
from collections.abc import AsyncIterator, Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, cast

import httpx
from fastapi import FastAPI
from sqlite_utils import Database

from jobs.schema import prepare
from server.access.audit import Audit
from server.access.tokens import TokenStore
from server.api.machinemodels import MACHINE_EXAMPLE, ConsoleLine, FilesView
from server.api.models import JOB_EXAMPLE, PROGRAM_ID, CheckView, ProgramView
from server.api.routing import example_of
from server.background.dbthread import Db
from server.background.worker import InlineWorker
from server.clock import WallClock
from server.config.limits import LimitsConfig
from server.config.reentry import AS_CONFIGURED, ReentryWish
from server.live.hub import Hub
from server.metrics import MachineMetrics
from server.problems import ProblemError
from server.waysout import Counters
from tests.harness.apps import create_app

BASE_URL = "http://127.0.0.1:8420"
FIRST_SEQ = 1000

Json = dict[str, Any]


async def settle(steps: int = 30) -> None:
    """Let everything that can run without time passing do so."""
    for _ in range(steps):
        await asyncio.sleep(0)


class Recording:
    """Notes each call as (name, arguments); raises what the test has put into `refusals` for it."""

    def __init__(self) -> None:
        self.calls: list[tuple[Any, ...]] = []
        self.refusals: dict[str, Exception] = {}

    def note(self, name: str, *arguments: Any) -> None:
        self.calls.append((name, *arguments))
        if name in self.refusals:
            raise self.refusals[name]

    def names(self) -> list[str]:
        return [call[0] for call in self.calls]


class FakeMachine(Recording):
    def __init__(self, name: str) -> None:
        super().__init__()
        self.name = name
        self.metrics = MachineMetrics()
        self.while_jogging: Callable[[], Any] | None = None
        self.jog_ahead = 0
        self.control: Json | None = None

    def view(self) -> Json:
        return copy.deepcopy(MACHINE_EXAMPLE) | {"name": self.name}

    def state_view(self) -> Json:
        state: Json = self.view()["state"]
        return state

    def show_control(self, holder: Json | None) -> None:
        self.control = holder

    def console(self, limit: int) -> Iterator[Json]:
        self.note("console", limit)
        return (example_of(ConsoleLine) for _ in range(limit))

    def estop(self) -> None:
        self.note("estop")

    def pause(self) -> None:
        self.note("pause")

    def resume(self) -> None:
        self.note("resume")

    def stop(self) -> None:
        self.note("stop")

    def cancel_jog(self) -> None:
        self.note("cancel_jog")

    async def connect(self) -> None:
        self.note("connect")

    async def disconnect(self) -> None:
        self.note("disconnect")

    async def home(self) -> None:
        self.note("home")

    async def unlock(self) -> None:
        self.note("unlock")

    async def reset(self) -> None:
        self.note("reset")

    async def run_blocks(self, blocks: list[str]) -> list[Json]:
        self.note("run_blocks", blocks)
        return [{"block": block, "ok": True, "error": None} for block in blocks]

    async def jog(self, axes: dict[str, float], feed: float) -> None:
        self.note("jog", axes, feed)
        if self.while_jogging is not None:
            await self.while_jogging()

    async def list_files(self) -> Json:
        self.note("list_files")
        files: Json = example_of(FilesView)
        return files

    async def run_file(self, name: str) -> None:
        self.note("run_file", name)

    async def confirm_tool(self) -> None:
        self.note("confirm_tool")


class FakeJobs(Recording):
    def job(self, job_id: int) -> Json:
        return copy.deepcopy(JOB_EXAMPLE) | {"id": job_id}

    async def create(self, program_id: str, machine: str, **options: Any) -> Json:
        await options.pop("still_wanted")()
        self.note("create", program_id, machine, options)
        return self.job(17)

    async def list(self, machine: str | None, status: str | None, limit: int, before: int | None) -> list[Json]:
        self.note("list", machine, status, limit, before)
        return [self.job(17)]

    async def get(self, job_id: int) -> Json:
        self.note("get", job_id)
        return self.job(job_id)

    async def pause(self, job_id: int) -> Json:
        self.note("pause", job_id)
        return self.job(job_id)

    async def resume(self, job_id: int) -> Json:
        self.note("resume", job_id)
        return self.job(job_id)

    async def cancel(self, job_id: int) -> Json:
        self.note("cancel", job_id)
        return self.job(job_id)

    async def queue(self, machine: str) -> Sequence[Json]:
        self.note("queue", machine)
        return [{"id": 18, "program_name": "part.nc", "hold": True}]

    async def rerun(self, job_id: int) -> Json:
        self.note("rerun", job_id)
        return self.job(job_id + 1)

    async def move(self, job_id: int, position: int) -> Json:
        self.note("move", job_id, position)
        return self.job(job_id)

    async def recover(
        self, job_id: int, action: str | None = None, line: int | None = None, wish: ReentryWish = AS_CONFIGURED
    ) -> Json:
        self.note("recover", job_id, action, line, *([] if wish == AS_CONFIGURED else [wish]))
        return self.job(job_id)

    async def batches(self, job_id: int, after: int = 0) -> "list[Json]":
        self.note("batches", job_id, after)
        return []

    async def events(self, job_id: int, after: int = 0) -> "list[Json]":
        self.note("events", job_id, after)
        return []

    async def report(self, job_id: int) -> Json:
        self.note("report", job_id)
        return {"job": self.job(job_id)}

    async def counts(self) -> Mapping[str, int]:
        return {"running": 1, "completed": 4}


class FakePrograms(Recording):
    """Keeps what was uploaded; `full_after_bytes` is a disk that fills up."""

    def __init__(self) -> None:
        super().__init__()
        self.full_after_bytes: int | None = None
        self.kept: dict[str, bytes] = {}
        self.taken_bytes = 0
        self.largest_piece = 0
        self.broken_off = False

    async def store(self, chunks: AsyncIterator[bytes], name: str) -> tuple[Json, bool]:
        self.note("store", name)
        content = bytearray()
        try:
            await self._take(chunks, content)
        except BaseException:
            self.broken_off = True
            raise
        self.kept[name] = bytes(content)
        return await self.get(PROGRAM_ID) | {"name": name, "bytes": len(content)}, True

    async def _take(self, chunks: AsyncIterator[bytes], content: bytearray) -> None:
        async for chunk in chunks:
            self.taken_bytes += len(chunk)
            self.largest_piece = max(self.largest_piece, len(chunk))
            content += chunk
            if self.full_after_bytes is not None and self.taken_bytes > self.full_after_bytes:
                raise ProblemError("disk_full", "The disk is full; nothing was kept.")

    async def list(self) -> list[Json]:
        return [await self.get(PROGRAM_ID)]

    async def get(self, program_id: str) -> Json:
        self.note("get", program_id)
        program: Json = example_of(ProgramView)
        return dict(program) | {"id": program_id}

    async def source(self, program_id: str, first: int, last: int) -> Json:
        self.note("source", program_id, first, last)
        return {"lines": [{"line": first, "text": "G21"}]}

    async def check(self, program_id: str, *, machine: str | None = None, profile: str | None = None) -> Json:
        self.note("check", program_id, machine, profile)
        report: Json = example_of(CheckView)
        return report

    async def toolpath(
        self, program_id: str, *, machine: str | None = None, profile: str | None = None, level: int = 0
    ) -> "FakeToolpath":
        self.note("toolpath", program_id, machine, profile, level)
        return FakeToolpath(self)

    async def delete(self, program_id: str) -> None:
        self.note("delete", program_id)

    def codes(self, machine: str) -> Sequence[Json]:
        self.note("codes", machine)
        return [{"code": "G0", "text": ""}]


@dataclass(frozen=True)
class FakeToolpath:
    """Three pieces of one byte, one and two."""

    programs: FakePrograms
    etag: str = '"abc-1"'

    async def open(self) -> tuple[int, AsyncIterator[bytes]]:
        self.programs.note("open")

        async def chunks() -> AsyncIterator[bytes]:
            for chunk in (b"M", b"S", b"TP"):
                yield chunk

        return 4, chunks()


@dataclass(frozen=True)
class FakeServerSettings:
    host: str = "127.0.0.1"
    max_upload_bytes: int = 1_000_000
    allowed_hosts: tuple[str, ...] = ()
    trusted_proxies: tuple[str, ...] = ()


@dataclass(frozen=True)
class FakeConfig:
    server: FakeServerSettings = field(default_factory=FakeServerSettings)
    limits: LimitsConfig = LimitsConfig()  # noqa: RUF009 - frozen


class MemoryDatabase:
    """The tables, in memory, on the loop's own thread."""

    def __init__(self) -> None:
        self.db = Database(sqlite3.connect(":memory:"))
        prepare(self.db)
        self.runs = 0

    trouble = None

    async def run(self, fn: Callable[..., Any], *args: Any, **kwargs: Any) -> Any:
        self.runs += 1
        return fn(self.db, *args, **kwargs)

    async def read(self, fn: Callable[..., Any], *args: Any, **kwargs: Any) -> Any:
        self.runs += 1
        return fn(self.db, *args, **kwargs)

    def post(self, fn: Callable[..., Any], *args: Any, then: Callable[[], None] | None = None) -> None:
        fn(self.db, *args)
        if then is not None:
            then()

    def close(self) -> None:
        self.db.close()


class FakeWorkshop:
    """Machines, jobs, programs; the hub and the tokens are the real ones. Made inside a running loop."""

    def __init__(self, *machines: str, settings: FakeServerSettings | None = None) -> None:
        self.config = FakeConfig(settings or FakeServerSettings())
        self.database = MemoryDatabase()
        self.machines = {name: FakeMachine(name) for name in machines or ("router",)}
        self.jobs = FakeJobs()
        self.programs = FakePrograms()
        self.hub = Hub(first_seq=FIRST_SEQ)
        self.outbound = Counters()
        self.now = 5000.0
        self.tokens = TokenStore(self.database, host=self.config.server.host, monotonic=lambda: self.now)
        self.audit = Audit(cast(Db, self.database), WallClock())
        self.describer = InlineWorker()

    @property
    def router(self) -> FakeMachine:
        return self.machines["router"]

    async def __aenter__(self) -> "FakeWorkshop":
        await self.tokens.load()
        return self

    async def __aexit__(self, *_: object) -> None:
        await settle()
        self.database.close()

    def app(self) -> FastAPI:
        return create_app(self)

    def client(self, **headers: str) -> httpx.AsyncClient:
        """An HTTP client without a network."""
        transport = httpx.ASGITransport(self.app())
        return httpx.AsyncClient(transport=transport, base_url=BASE_URL, headers=headers)

    async def token(self, role: str) -> str:
        """The secret of a new token."""
        secret: str = (await self.tokens.create(f"a {role}", role))["token"]
        return secret


def bearer(secret: str) -> dict[str, str]:
    """The header of a token."""
    return {"Authorization": f"Bearer {secret}"}
