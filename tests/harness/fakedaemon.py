"""A daemon that answers as told, for tests of what talks to one. It remembers every request."""

import json
from collections.abc import Mapping
from typing import Any

import httpx

STATE: dict[str, Any] = {
    "status": "idle",
    "position": {"machine": {"x": 1.5, "z": 5.0}, "work": {"x": 1.5, "z": 5.0}},
    "feed": None,
    "spindle": None,
    "overrides": {},
    "alarm": None,
    "absolute": True,
    "tool": None,
    "inputs": {},
    "accessories": [],
    "homed": None,
    "pendant": False,
    "substate": None,
    "seq": 7,
    "at": "2026-03-01T09:30:00.250Z",
}


def machine(name: str = "router", **changes: Any) -> dict[str, Any]:
    """A machine as the API shows it."""
    return {
        "name": name,
        "protocol": "elvinto",
        "port": "/dev/ttyUSB0",
        "link": "connected",
        "capabilities": ["estop", "pause"],
        "state": STATE,
        "active_job": None,
        "queue_length": 0,
        "link_stats": {},
        **changes,
    }


def job(line: int = 0, status: str = "running", **changes: Any) -> dict[str, Any]:
    """A job of 10 lines as the API shows it."""
    return {
        "id": 17,
        "status": status,
        "program": "c0ffee",
        "machine": "router",
        "progress": {
            "line": line,
            "lines": 10,
            "acknowledged_lines": line,
            "seconds_elapsed": 1.0,
            "seconds_left": 61.0,
            "seconds_left_min": 55.0,
            "seconds_left_max": 70.0,
        },
        "error": None,
        **changes,
    }


def problem(status: int, code: str, detail: str, **extra: Any) -> httpx.Response:
    """A refusal."""
    body = {"type": f"/docs#problem-{code}", "title": f"Title of {code}", "status": status, "code": code}
    return httpx.Response(status, json={**body, "detail": detail, **extra})


class FakeDaemon(httpx.BaseTransport):
    """Answers by method and path: JSON, a response, an exception to raise, or Turns of those."""

    def __init__(self, answers: Mapping[str, Any] | None = None) -> None:
        self.answers = {"GET /machines": [machine()], **(answers or {})}
        self.requests: list[httpx.Request] = []

    def handle_request(self, request: httpx.Request) -> httpx.Response:
        request.read()
        self.requests.append(request)
        key = f"{request.method} {request.url.raw_path.decode().partition('?')[0].removeprefix('/api/v1')}"
        answer = self.answers.get(key, problem(404, "not_found", f"Nothing is at {key}."))
        if isinstance(answer, Turns):
            answer = answer.next()
        if isinstance(answer, Exception):
            raise answer
        return answer if isinstance(answer, httpx.Response) else httpx.Response(200, json=answer)

    def made(self) -> list[str]:
        """The requests by method and path."""
        return [f"{one.method} {one.url.raw_path.decode().removeprefix('/api/v1')}" for one in self.requests]

    def body(self, index: int = -1) -> Any:
        """The JSON of a request."""
        return json.loads(self.requests[index].content)


class Turns:
    """One answer after the other; the last stays."""

    def __init__(self, *answers: Any) -> None:
        self._answers = list(answers)

    def next(self) -> Any:
        """The answer whose turn it is."""
        return self._answers.pop(0) if len(self._answers) > 1 else self._answers[0]
