"""`millstream serve`: the daemon as a process. Binds, checks who could reach it, serves, and stops in good order.

Not what is served (`server/app.py`, `server/api/`). The one rule: everything that can be wrong with the surroundings
(configuration, port, data directory, exposure) is told in a sentence before the first machine is touched.
"""

import asyncio
import contextlib
import gc
import logging
import os
import socket
import sys
from collections.abc import AsyncIterator, Callable
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING

import typer
import uvicorn

from server.access import auditing, endedtokens
from server.access.auth import ExposureError, check_exposure
from server.access.tokens import list_tokens
from server.api.httpwire import MAX_CONNECTIONS, HttpProtocol
from server.api.wswire import WireProtocol
from server.cli.common import CliError, ConfigFile, ExitCode, on_stop_signal, say, warn
from server.cli.settings import DEFAULT_CONFIG, configuration, database, sole_daemon
from server.clock import WallClock, utc_now
from server.config.model import Config
from server.logformat import log_handler
from server.notify import Notifier, keep_telling
from server.outbound.errors import OutboundError
from server.outbound.service import Outbound
from server.store.retention import keep_within
from server.store.sealing import keep_sealing

if TYPE_CHECKING:
    from server.app import Workshop

GRACEFUL_STOP_S = 5
"""Requests that are still being answered at a stop get this long; a job under way is kept in the journal anyway."""
KEEP_ALIVE_S = 30
BACKLOG = 128
MAX_HEADER_BYTES = 32 * 1024
WEBSOCKET_MAX_BYTES = 64 * 1024
"""Clients send jogs and subscriptions, nothing large."""
UNREAD_S = 30
"""A peer that takes nothing of what waits for it for so long is gone: closing alone would wait for it for ever, and
with MAX_CONNECTIONS of its kind nobody could reach the e-stop."""
TURN_S = 0.0002
"""A thread that computes (the lines of the next batches, a check, the journal) lets the loop have its turn after this
at the latest, up to three times for a line: the loop gives its turn away when it waits, reads and writes. Python's own
5 ms would hold up each step of the stream, and the stop."""
DATE_EVERY_S = 1.0
WEBSOCKET_PING_S = 20.0
"""A reader that vanished without a word is noticed within two of these."""


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(serve)


def serve(ctx: typer.Context, config: ConfigFile = None) -> None:
    """Run the daemon until it is told to stop (Ctrl-C, SIGTERM)."""
    settings = configuration(ctx, config)
    if not settings.machine:
        raise CliError(
            ExitCode.USAGE,
            f"No machine is configured. Copy config.example.toml to {DEFAULT_CONFIG} and set the port of yours, "
            "or try `millstream demo` with a virtual one.",
        )
    run(settings)


def run(config: Config) -> None:
    """The daemon of `config` in the foreground. Raises CliError when it cannot start."""
    logging.basicConfig(level=config.server.log_level.upper(), handlers=[log_handler(os.environ)])
    with asyncio.Runner(loop_factory=loop_factory()) as runner:
        runner.run(_serve(config))


async def _serve(config: Config) -> None:
    async with running(config, bind(config.server.host, config.server.port)) as daemon:
        favour_the_stream()
        say(f"millstream: {daemon.url}")
        await daemon.stopped()
        warn("millstream: stopped")


def favour_the_stream() -> None:
    """Whatever else this process does, the loop does not stand still for it. Once, when everything is made."""
    sys.setswitchinterval(TURN_S)
    # What is there stays: looking through all of it for garbage, a tenth of a second at a time, would find nothing.
    gc.collect()
    gc.freeze()


def loop_factory() -> Callable[[], asyncio.AbstractEventLoop] | None:
    """uvloop where it is installed (the extra `speed`), else asyncio's own."""
    if find_spec("uvloop") is None:
        return None
    factory: Callable[[], asyncio.AbstractEventLoop] = import_module("uvloop").new_event_loop
    return factory


def bind(host: str, port: int) -> socket.socket:
    """A listening socket. Raises CliError."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    try:
        listener = socket.create_server((host.strip("[]"), port), family=family, backlog=BACKLOG)
    except OSError as error:
        if error.errno in (socket.EAI_NONAME, socket.EAI_AGAIN):  # what was a gaierror, within create_server
            raise CliError(
                ExitCode.FAILED, f"{host}: this name is not known. Set server.host to an address of this computer."
            ) from error
        reason = os.strerror(error.errno) if error.errno else str(error)
        raise CliError(
            ExitCode.FAILED, f"{host}:{port}: {reason}. Is another program there? Set server.host and server.port."
        ) from error
    # Every connection that is accepted inherits these. asyncio itself does this only for sockets that say they are TCP,
    # which those of create_server do not: the second half of each answer would wait 40 ms for the client's word.
    listener.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    if hasattr(socket, "TCP_USER_TIMEOUT"):  # Linux
        listener.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, UNREAD_S * 1000)
    return listener


class _Server(uvicorn.Server):
    """uvicorn without its signal handlers: it would end the process by the signal, not by its exit code. `answers` is
    set when requests are answered."""

    def __init__(self, config: uvicorn.Config) -> None:
        super().__init__(config)
        self.answers = asyncio.Event()
        self._told = asyncio.Event()

    def ask_to_stop(self) -> None:
        """The second time it does not wait for requests under way."""
        self.force_exit = self.should_exit
        self.should_exit = True
        self._told.set()

    async def main_loop(self) -> None:
        """uvicorn's own looks ten times a second whether it is to stop, and each look costs as much as three lines of a
        Grbl. This one is told, and wakes up for the date of the answers alone."""
        told = [asyncio.create_task(self._told.wait())]
        while not await self.on_tick(0):
            await asyncio.wait(told, timeout=DATE_EVERY_S)

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        await super().startup(sockets)
        self.answers.set()

    @contextlib.contextmanager
    def capture_signals(self):  # type: ignore[no-untyped-def]
        yield


class RunningDaemon:
    """A daemon that serves. `url` is its address for people."""

    def __init__(
        self, server: _Server, serving: asyncio.Task[None], url: str, say_farewell: Callable[[], None]
    ) -> None:
        self._server = server
        self._serving = serving
        self._say_farewell = say_farewell
        self.url = url

    async def started(self) -> None:
        """Returns when requests are answered: whoever waits for the daemon may be told."""
        answers = asyncio.ensure_future(self._server.answers.wait())
        await asyncio.wait([answers, self._serving], return_when=asyncio.FIRST_COMPLETED)
        answers.cancel()

    async def stopped(self) -> None:
        """Returns when somebody has asked it to stop."""
        await asyncio.wait([self._serving])

    def stop(self) -> None:
        """Ask it to stop; the second time it does not wait for requests under way."""
        self._say_farewell()
        self._server.ask_to_stop()


@contextlib.asynccontextmanager
async def running(config: Config, listener: socket.socket) -> AsyncIterator[RunningDaemon]:
    """The daemon of `config` behind `listener`, started and, at the end, stopped in good order. Raises CliError."""
    # Imported here, for `millstream check` needs neither the web framework nor its start-up time.
    from server.api import create_app
    from server.app import build

    with contextlib.closing(listener), sole_daemon(config), contextlib.ExitStack() as stack:
        _check_exposure(config)
        outbound = stack.enter_context(contextlib.closing(_ways_out(config)))
        workshop = build(config)
        # Before the start: making the routes takes the loop for a moment that no running job should wait.
        app = create_app(workshop)
        await workshop.start()
        try:
            server = _Server(_uvicorn_config(app, config))
            serving = asyncio.create_task(server.serve(sockets=[listener]))
            daemon = RunningDaemon(server, serving, address(listener), workshop.say_farewell)
            on_stop_signal(daemon.stop)
            await daemon.started()
            async with _beside(workshop), outbound.running(workshop, listener):
                try:
                    yield daemon
                finally:
                    daemon.stop()
                    await daemon.stopped()
        finally:
            await workshop.stop()


@contextlib.asynccontextmanager
async def _beside(workshop: "Workshop") -> AsyncIterator[None]:
    """What goes on beside the machines: the service manager is kept informed, ended jobs are sealed, old ones go."""
    notifier = Notifier(os.environ)
    tasks = [
        asyncio.create_task(keep_sealing(workshop.db, WallClock())),
        asyncio.create_task(keep_within(workshop.config.history, workshop.db, WallClock(), workshop.programs.delete)),
        asyncio.create_task(auditing.keep_within(workshop.config.audit, workshop.db, WallClock())),
        asyncio.create_task(endedtokens.keep_removing(workshop.db, WallClock())),
    ]
    if notifier:
        tasks.append(asyncio.create_task(keep_telling(notifier, workshop.db, partial(_sentence, workshop))))
    notifier.status(_sentence(workshop))
    notifier.ready()
    try:
        yield
    finally:
        notifier.stopping()
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        notifier.close()


def _sentence(workshop: "Workshop") -> str:
    """What the daemon is doing, for `systemctl status`."""
    machines = workshop.machines.values()
    connected = sum(one.link_status == "connected" for one in machines)
    jobs = sum(one.stream.moving for one in machines)
    return f"{connected} of {len(machines)} machines connected, {jobs} jobs under way"


def _check_exposure(config: Config) -> None:
    """Before anything is started: can the database be used, and may the daemon listen where it is told to?"""
    with database(config) as db:
        usable = [token for token in list_tokens(db) if token.revoked_at is None]
    try:
        check_exposure(config.server.host, usable)
    except ExposureError as error:
        raise CliError(ExitCode.FAILED, str(error)) from error
    if usable and all(token.has_expired(utc_now()) for token in usable):
        warn("millstream: all tokens have expired, so nobody can do anything over HTTP: `millstream token create`.")


def _ways_out(config: Config) -> Outbound:
    """What tells others (docs/telemetry.md), prepared before anything is started. Raises CliError."""
    try:
        return Outbound.prepare(config)
    except OutboundError as error:
        raise CliError(ExitCode.FAILED, str(error)) from error


def address(listener: socket.socket) -> str:
    """What a person types into a browser on this computer."""
    host, port = listener.getsockname()[:2]
    if host in ("0.0.0.0", "::"):  # noqa: S104 - compared, not bound
        host = socket.gethostname()
    return f"http://[{host}]:{port}" if ":" in host else f"http://{host}:{port}"


def _uvicorn_config(app: object, config: Config) -> uvicorn.Config:
    """uvicorn with every limit that matters said, so that a new version of it changes nothing here."""
    return uvicorn.Config(
        app,  # type: ignore[arg-type]
        log_config=None,
        log_level="debug" if config.server.log_level == "debug" else "warning",
        access_log=False,
        lifespan="off",
        http=HttpProtocol,
        ws=WireProtocol,
        proxy_headers=False,
        server_header=False,
        limit_concurrency=MAX_CONNECTIONS,
        backlog=BACKLOG,
        timeout_keep_alive=KEEP_ALIVE_S,
        timeout_graceful_shutdown=GRACEFUL_STOP_S,
        h11_max_incomplete_event_size=MAX_HEADER_BYTES,
        ws_max_size=WEBSOCKET_MAX_BYTES,
        ws_ping_interval=WEBSOCKET_PING_S,
        ws_ping_timeout=WEBSOCKET_PING_S,
        ws_per_message_deflate=False,
    )
