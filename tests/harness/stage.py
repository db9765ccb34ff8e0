"""A stand-in for the daemon behind a dashboard: the pages, a machine and a job that say whatever a test wants, at once.

Not a daemon: nothing is asked of a machine and nothing is kept. For what a real one reaches seldom or slowly, every
state of a machine or an hour of messages. The one rule: what it says has the shapes of docs/api.md.
"""

import json
import mimetypes
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta
from http import HTTPStatus
from typing import Any
from urllib.parse import parse_qs, urlsplit

from websockets.datastructures import Headers
from websockets.http11 import Request, Response
from websockets.sync.server import Server, ServerConnection, serve

from server.api.webfiles import MEDIA_TYPES, web_files

BEGAN_AT = datetime(2026, 3, 1, 9, 30, tzinfo=UTC)
MILL = "mill"
EVERYTHING = ("pause", "resume", "stop", "estop", "jog", "home", "unlock", "reset", "commands", "overrides")
Json = dict[str, Any]


def state(**changes: Any) -> Json:
    """A machine that stands, as its state is told."""
    place = {"x": 12.5, "y": -3.25, "z": 5.0}
    return {
        "status": "idle",
        "position": {"machine": place, "work": place},
        "feed": 0,
        "spindle": 0,
        "overrides": {},
        "alarm": None,
        "absolute": True,
        "tool": 1,
        "tool_requested": None,
        "inputs": {"x_limit": False},
        "accessories": [],
        "homed": True,
        "pendant": False,
        "substate": None,
        "ack_s": 0.012,
        "batch_s": 0.4,
        "seq": 1,
        "at": BEGAN_AT.isoformat(),
        **changes,
    }


def job(line: int, **changes: Any) -> Json:
    """A job of 36,000 lines that is done up to `line`."""
    progress = {
        "line": line,
        "lines": 36_000,
        "acknowledged_lines": line,
        "sent_line": line + 3,
        "seconds_elapsed": line / 10,
        "seconds_left": 3600 - line / 10,
        "seconds_left_min": 3500 - line / 10,
        "seconds_left_max": 3700 - line / 10,
    }
    return {
        "id": 17,
        "status": "running",
        "program": "c0ffee",
        "program_name": "part.nc",
        "source_program": None,
        "machine": MILL,
        "progress": progress,
        "error": None,
        "tool": None,
        "hold": False,
        "cancelling": False,
        "note": None,
        "mode": "run",
        "on_error": None,
        "start_line": 1,
        "end_line": 36_000,
        "rerun_of": None,
        "created_at": BEGAN_AT.isoformat(),
        "started_at": BEGAN_AT.isoformat(),
        "ended_at": None,
        **changes,
    }


class Stage:
    """One machine in front of any number of pages; `seconds` is its clock."""

    def __init__(self) -> None:
        self.url = ""
        self.seconds = 0.0
        self.seq = 0
        self.pages: list[ServerConnection] = []
        self.machine: Json = {
            "name": MILL,
            "protocol": "grbl",
            "port": "sim:",
            "link": "connected",
            "capabilities": list(EVERYTHING),
            "travel": {},
            "state": state(),
            "active_job": None,
            "queue_length": 0,
            "link_stats": {"epoch": 1, "retries": 0, "errors": {}},
        }
        self.jobs: list[Json] = []

    def say(self, kind: str, data: Json, machine: str | None = MILL) -> None:
        """A message to every page."""
        self.seq += 1
        message = json.dumps(self._envelope(kind, data, machine))
        for page in self.pages:
            page.send(message)

    def _envelope(self, kind: str, data: Json, machine: str | None) -> Json:
        at = (BEGAN_AT + timedelta(seconds=self.seconds)).isoformat()
        return {"seq": self.seq, "type": kind, "machine": machine, "at": at, "data": data}

    def show(self, *, link: str = "connected", **changes: Any) -> None:
        """Another state of the machine."""
        told = state(**changes)
        self.machine = {**self.machine, "state": told, "link": link}
        self.say("state", {**told, "link": link})

    def run(self, states: int) -> None:
        """So many tenths of a second of a job: states, as many lines of the console, and the job once a second."""
        for at in range(states):
            self.seconds += 0.1
            place = {"x": round(self.seconds % 300, 3), "y": round(self.seconds % 70, 3), "z": -1.0}
            told = state(status="run", position={"machine": place, "work": place}, feed=1200 + at % 9, seq=self.seq)
            self.say("state", {**told, "link": "connected"})
            self.say("console", {"at": told["at"], "direction": "<", "text": f"<Run|MPos:{self.seconds:.3f},0,0>"})
            if at % 10 == 0:
                self.say("job", job(int(self.seconds * 10)))

    def answer(self, connection: ServerConnection, request: Request) -> Response | None:
        """A file, or what the API would say; None for the WebSocket."""
        path = urlsplit(request.path).path
        if path == "/api/v1/events":
            return None
        if path == "/" or path.startswith("/web/"):
            return self._page(path.removeprefix("/web/").lstrip("/") or "index.html")
        answers: dict[str, Any] = {
            "/api/v1/session": {"role": "admin", "open": True},
            f"/api/v1/machines/{MILL}": self.machine,
            f"/api/v1/machines/{MILL}/console": [],
            "/api/v1/jobs": self.jobs,
            "/api/v1/programs": [],
            f"/api/v1/programs/{job(0)['program']}/source": {"lines": []},
        }
        return _response(HTTPStatus.OK, "application/json", json.dumps(answers.get(path, [])).encode())

    @staticmethod
    def _page(name: str) -> Response:
        file = web_files().get(name)
        if file is None:
            return _response(HTTPStatus.NOT_FOUND, "text/plain", b"")
        kind = MEDIA_TYPES.get(file.suffix) or mimetypes.guess_type(name)[0] or "text/plain"
        return _response(HTTPStatus.OK, kind, file.read_bytes())

    def socket(self, connection: ServerConnection) -> None:
        """One page: greeted, then every question is answered."""
        assert connection.request is not None
        assert "topics" in parse_qs(urlsplit(connection.request.path).query)
        hello = {"role": "admin", "machines": [self.machine], "jobs": self.jobs, "queues": {MILL: []}, "problem": None}
        connection.send(json.dumps(self._envelope("hello", hello, None)))
        self.pages.append(connection)
        try:
            for text in connection:
                asked = json.loads(text)
                connection.send(json.dumps({"type": "result", "id": asked["id"], "ok": True}))
        finally:
            self.pages.remove(connection)


def _response(status: HTTPStatus, kind: str, body: bytes) -> Response:
    headers = Headers({"Content-Type": kind, "Content-Length": str(len(body)), "Connection": "close"})
    return Response(status.value, status.phrase, headers, body)


@contextmanager
def stage() -> Iterator[Stage]:
    """A stage that is open."""
    one = Stage()
    handler: Callable[[ServerConnection], None] = one.socket
    server: Server = serve(handler, "127.0.0.1", 0, process_request=one.answer, compression=None)
    one.url = f"http://127.0.0.1:{server.socket.getsockname()[1]}"
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    try:
        yield one
    finally:
        server.shutdown()
        thread.join()
