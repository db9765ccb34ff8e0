"""`millstream watch`: what the machines are doing, live, over the WebSocket.

Not a dashboard: one line that is written over, or one JSON object a message. The one rule: a broken connection is
taken up again with `since=`, so that no job or alarm event is missed.
"""

import json
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager
from typing import Annotated, Any
from urllib.parse import urlencode

import typer
from rich.live import Live
from rich.text import Text
from websockets.exceptions import ConnectionClosed, InvalidHandshake, InvalidStatus
from websockets.sync.client import ClientConnection, connect

from server.cli.common import DEFAULT_URL, CliError, ExitCode, Json, Machine, Url, safe, say, say_json, terminal
from server.cli.daemon import Daemon, unreachable
from server.cli.machines import position_text
from server.cli.progress import ENDED, describe, left

TOPICS = "state,job,alarm,tool,queue"
RETRY_S = 1.0
MAX_MESSAGE_BYTES = 16 * 1024 * 1024
"""The snapshot of `hello` holds every machine and queue."""

Event = Mapping[str, Any]
Open = Callable[[str, str | None], AbstractContextManager[ClientConnection]]


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(watch)


def watch(
    ctx: typer.Context,
    machine: Machine = None,
    rate: Annotated[float, typer.Option(min=0.1, max=60, help="Most state messages a second.")] = 5.0,
    url: Url = DEFAULT_URL,
    as_json: Json = False,
) -> None:
    """Show live what the machines are doing, until Ctrl-C."""
    with Daemon.of(ctx, url) as daemon:
        daemon.get("/machines")  # wrong address, wrong token: told like everywhere else
        query = {"topics": TOPICS, "rate": rate} | ({"machines": machine} if machine is not None else {})
        events = listen(daemon.url, daemon.token, query)
        try:
            _show_json(events) if as_json else _show(events, machine)
        except KeyboardInterrupt:
            return


def listen(url: str, token: str | None, query: Mapping[str, object], *, open_: Open | None = None) -> Iterator[Event]:
    """The daemon's events, for ever; after a break from where it was. Raises CliError when it refuses."""
    since: int | None = None
    first = True
    while True:
        address = (
            "ws"
            + url.removeprefix("http")
            + "/api/v1/events?"
            + urlencode({**query, **({"since": since} if since else {})})
        )
        try:
            with (open_ or _open)(address, token) as connection:
                for message in connection:
                    event = json.loads(message)
                    since = max(since or 0, event.get("seq") or 0)
                    first = False
                    yield event
        except InvalidStatus as refusal:
            raise _refused(refusal, url) from refusal
        except (OSError, ConnectionClosed, InvalidHandshake) as error:
            if first:
                raise unreachable(url, "no WebSocket there") from error
        time.sleep(RETRY_S)


def _open(address: str, token: str | None) -> ClientConnection:
    headers = {"Authorization": f"Bearer {token}"} if token else {}
    # No proxy of the environment, as in daemon.py.
    return connect(address, additional_headers=headers, max_size=MAX_MESSAGE_BYTES, proxy=None)


def _refused(refusal: InvalidStatus, url: str) -> CliError:
    try:
        problem = json.loads(refusal.response.body or b"")
        return CliError(ExitCode.FAILED, f"{safe(problem['title'])}: {safe(problem['detail'])}", problem)
    except (ValueError, KeyError, TypeError):
        return unreachable(url, f"the WebSocket is refused (status {refusal.response.status_code})")


def _show_json(events: Iterator[Event]) -> None:
    for event in events:
        say_json(event)


def _show(events: Iterator[Event], machine: str | None) -> None:
    board = Board(machine)
    console = terminal()
    if not console.is_terminal:
        for event in events:
            line = board.take(event)
            if line is not None:
                say(line)
        return
    with Live(console=console, auto_refresh=False) as live:
        for event in events:
            board.take(event)
            live.update(Text("\n".join(board.lines())), refresh=True)


class Board:
    """The latest of each machine, as lines of text."""

    def __init__(self, only: str | None = None) -> None:
        self._only = only
        self._states: dict[str, Event] = {}
        self._jobs: dict[str, Event] = {}

    def take(self, event: Event) -> str | None:
        """Note an event; the line of its machine when that has something new to say."""
        data = event.get("data") or {}
        machine = event.get("machine")
        match event.get("type"):
            case "hello":
                self._snapshot(data)
                return "\n".join(self.lines()) or None
            case "state" if machine is not None:
                self._states[machine] = data
            case "job" if machine is not None:
                self._jobs[machine] = data
            case "alarm" | "tool":
                return safe(f"{machine}: {event['type']} {json.dumps(data, ensure_ascii=False)}")
            case _:
                return None
        return self._line(machine)

    def _snapshot(self, data: Event) -> None:
        self._states = {one["name"]: one["state"] for one in data["machines"] if self._only in (None, one["name"])}
        # The newest come first; what has ended is of no interest to somebody who begins to watch.
        self._jobs = {one["machine"]: one for one in reversed(data["jobs"]) if one["status"] not in ENDED}

    def lines(self) -> list[str]:
        """One line a machine."""
        return [self._line(name) for name in sorted(self._states)]

    def _line(self, name: str) -> str:
        state = self._states.get(name, {})
        parts = [safe(name), safe(state.get("status", "?")), position_text(state)]
        if state.get("feed") is not None:
            parts.append(f"F{state['feed']:.0f}")
        if state.get("spindle") is not None:
            parts.append(f"S{state['spindle']:.0f}")
        if state.get("alarm"):
            parts.append(f"ALARM {safe(state['alarm'].get('message', ''))}")
        job = self._jobs.get(name)
        if job and "progress" in job:
            progress = job["progress"]
            parts.append(f"job {job['id']} {describe(job)} {progress['line']}/{progress['lines']}")
            parts.append(left(progress))
        return "  ".join(part for part in parts if part)
