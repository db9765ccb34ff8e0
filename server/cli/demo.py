"""`millstream demo`: the whole thing on one command. Daemon, virtual ElVinto mill, a sample program that starts.

Not a second daemon: the demo talks to the real one over HTTP, as everybody does. The one rule: nothing is left
behind; data lies in a temporary folder unless one is named.
"""

import asyncio
import contextlib
import socket
import tempfile
import threading
from collections.abc import Iterator, Mapping
from importlib import resources
from pathlib import Path
from typing import Annotated, Any

import typer

from server.cli.common import BrokenOffError, CliError, ExitCode, say, warn
from server.cli.daemon import Daemon, Surroundings, machine_path
from server.cli.jobs import upload
from server.cli.progress import POLL_S, describe, follow
from server.cli.serve import RunningDaemon, bind, loop_factory, running
from server.config.model import Config, MachineConfig, ServerConfig

HOST = "127.0.0.1"
MACHINE = "mill"
SAMPLE = "rose.nc"
PORTS_TRIED = 50
CONNECT_WITHIN_S = 20.0
DEFAULT_SPEED = 4.0
"""The sample takes some four minutes on a real mill: one minute here."""


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(demo)


def demo(
    port: Annotated[
        int, typer.Option(min=0, max=65535, help="Of the dashboard; the next free one if it is taken.")
    ] = 8420,
    speed: Annotated[
        float, typer.Option(min=0.01, max=10_000, help="How many times faster than life the mill moves.")
    ] = DEFAULT_SPEED,
    data_dir: Annotated[Path | None, typer.Option(help="Keep the data here instead of throwing it away.")] = None,
    once: Annotated[bool, typer.Option("--once", help="Stop when the job has ended.")] = False,
) -> None:
    """Start the daemon with a virtual ElVinto mill and run a sample program on it."""
    listener = _free_listener(port)
    with _folder(data_dir) as folder, asyncio.Runner(loop_factory=loop_factory()) as runner:
        job = runner.run(_demo(_config(listener, folder, speed), listener, once=once))
    if once and (job is None or job["status"] != "completed"):
        raise CliError(ExitCode.FAILED, "The demo's job was not completed.")


async def _demo(config: Config, listener: socket.socket, *, once: bool) -> Mapping[str, Any] | None:
    async with running(config, listener) as daemon:
        say(f"Dashboard: {daemon.url}")
        job = await _worked(daemon)
        if job is not None:
            say(f"{SAMPLE}: {describe(job)}, the last line done is {job['progress']['line']}")
            if not once:
                say("The daemon stays up; Ctrl-C stops it.")
                await daemon.stopped()
        return job


async def _worked(daemon: RunningDaemon) -> Mapping[str, Any] | None:
    """Run the sample from a thread, as a client beside the daemon; None when the daemon was stopped meanwhile."""
    stopping = threading.Event()

    def sleep(seconds: float) -> None:
        if stopping.wait(seconds):
            raise BrokenOffError

    client = asyncio.create_task(asyncio.to_thread(_client, daemon.url, sleep))
    stopped = asyncio.create_task(daemon.stopped())
    await asyncio.wait((client, stopped), return_when=asyncio.FIRST_COMPLETED)
    stopping.set()
    if not client.done():
        warn("millstream: stopping")
    try:
        return await client
    except CliError:
        if stopped.done():
            return None
        raise
    finally:
        stopped.cancel()


def _client(url: str, sleep: Any) -> Mapping[str, Any]:
    with Daemon(url, Surroundings(environ={})) as daemon:
        _await_link(daemon, sleep)
        with resources.as_file(resources.files("server") / "samples" / SAMPLE) as path:
            program = upload(daemon, path)
        # The sample homes the mill first, and a check warns of that on this controller: it is meant here.
        job = daemon.post("/jobs", {"program": program["id"], "machine": MACHINE, "force": True})
        return follow(lambda: daemon.get(f"/jobs/{job['id']}"), SAMPLE, sleep=sleep)


def _await_link(daemon: Daemon, sleep: Any) -> None:
    waited_s = 0.0
    while daemon.get(machine_path(MACHINE))["link"] != "connected":
        if waited_s > CONNECT_WITHIN_S:
            raise CliError(ExitCode.FAILED, "The virtual mill does not answer.")
        sleep(POLL_S)
        waited_s += POLL_S


def _config(listener: socket.socket, folder: Path, speed: float) -> Config:
    port = listener.getsockname()[1]
    machine = MachineConfig(name=MACHINE, protocol="elvinto", port=f"sim:?speed_factor={speed}")
    return Config(server=ServerConfig(host=HOST, port=port, data_dir=folder, log_level="warning"), machine=(machine,))


def _free_listener(port: int) -> socket.socket:
    for tried in range(port, min(port + PORTS_TRIED, 65536)):
        with contextlib.suppress(CliError):
            listener = bind(HOST, tried)
            if tried != port:
                warn(f"Port {port} is taken by another program; this demo uses {tried}.")
            return listener
    raise CliError(ExitCode.FAILED, f"Ports {port} to {port + PORTS_TRIED - 1} are all taken; say another: --port.")


@contextlib.contextmanager
def _folder(data_dir: Path | None) -> Iterator[Path]:
    if data_dir is not None:
        yield data_dir
        return
    with tempfile.TemporaryDirectory(prefix="millstream-demo-") as folder:
        yield Path(folder)
