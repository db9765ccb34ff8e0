"""What comes over the network, and what goes out to other systems, as any bytes.

The one rule: a client's mistake is a problem with a code, never a fault of ours; and what a machine or a person has
named can end no field, line or topic of another system.
"""

import json
from contextlib import suppress
from typing import Any

from pydantic import ValidationError

from server.api import ws
from server.api.messages import CLIENT_MESSAGE, SocketQuery
from server.jsontext import dumps
from server.outbound.feed import Notice
from server.outbound.mqtttopics import COMMANDS, Teller, Topics
from server.outbound.shdr import Device, lines
from server.problems import ProblemError
from tests.harness.fakeworkshop import FakeWorkshop
from tests.harness.simloop import SimLoop

AT = "2026-03-01T09:00:00.000Z"
STATE = {"status": "run", "link": "connected", "position": {"machine": {"x": 1.5}}, "feed": 1200.0}
PATHS = ("/api/v1/jobs", "/api/v1/audit", "/api/v1/machines/router/console", "/api/v1/jobs/17/batches")


def socket(data: bytes) -> None:
    """A message over the WebSocket (commands, jogging, levels of a changer) is valid, or refused with a code."""
    text = data.decode("utf-8", "replace")
    message = _read(text)
    if isinstance(message, ProblemError):
        assert message.status in (400, 422)
        ws.failure(text, message)
        return
    again = CLIENT_MESSAGE.validate_json(dumps(message.model_dump(exclude_unset=True)))
    assert again == message


def _read(text: str) -> Any:
    try:
        return ws._valid(ws._json_object(text))
    except ProblemError as problem:
        return problem


def query(data: bytes) -> None:
    """Any query is answered with what was asked for, or refused with a code; nothing in it is a fault of ours."""
    text = data.decode("latin-1")
    pairs = dict(part.partition("=")[::2] for part in text.split("&"))
    with suppress(ValidationError):
        SocketQuery.model_validate(pairs).filter()
    for path in PATHS:
        status, body = _asked(path, data)
        assert status in (200, 422), (path, status, body)
        if status == 422:
            assert json.loads(body)["code"] == "invalid_request"


class _Served:
    """One application for all: nothing that is asked here changes it."""

    app: Any = None
    loop: Any = None


def _asked(path: str, query_string: bytes) -> tuple[int, bytes]:
    if _Served.app is None:
        _Served.loop = SimLoop(limit_s=float("inf"))
        _Served.app = _Served.loop.run_until_complete(_served())
    return _Served.loop.run_until_complete(_exchange(path, query_string))  # type: ignore[no-any-return]


async def _served() -> Any:
    workshop = FakeWorkshop()
    await workshop.tokens.load()
    return workshop.app()


async def _exchange(path: str, query_string: bytes) -> tuple[int, bytes]:
    status, body = 0, b""

    async def receive() -> dict[str, Any]:
        return {"type": "http.request", "body": b"", "more_body": False}

    async def send(message: Any) -> None:
        nonlocal status, body
        status = message.get("status", status)
        body += message.get("body", b"")

    scope = {
        "type": "http",
        "asgi": {"version": "3.0"},
        "http_version": "1.1",
        "method": "GET",
        "scheme": "http",
        "path": path,
        "raw_path": path.encode(),
        "root_path": "",
        "query_string": query_string,
        "headers": [(b"host", b"127.0.0.1:8420")],
        "client": ("127.0.0.1", 50_000),
        "server": ("127.0.0.1", 8420),
    }
    await _Served.app(scope, receive, send)
    return status, body


def close() -> None:
    """The loop of the application, at the end."""
    if _Served.loop is not None:
        _Served.loop.close()
        _Served.app = _Served.loop = None


def outbound(data: bytes) -> None:
    """Words of a machine and of a file, told to MTConnect and MQTT: each line is a line, each payload is JSON."""
    text = data.decode("utf-8", "replace")
    alarm = {"code": text[:20], "axis": None, "message": text}
    job = {"id": 7, "status": "failed", "program_name": text, "error": {"code": text[:9], "message": text[9:]}}
    teller, device = Teller(Topics("shop")), Device()
    before: dict[str, Any] = {}
    for kind, said in (("state", {**STATE, "alarm": alarm}), ("job", job), ("alarm", {"alarm": alarm})):
        notice = Notice(kind, "router", AT, said)
        for post in teller.posts(notice):
            assert post.topic.startswith("shop/router/")
            if not post.topic.endswith("/availability"):
                json.loads(post.payload)
        device = device.told(notice)
        after = device.items(emergency=False)
        for line in lines("r_", AT, before, after):
            assert line.endswith("\n")
            assert line[:-1].isprintable()
            assert line.startswith(AT + "|r_")
        before = after
    asked = Topics("shop").command("shop/router/command", data, ["router"])
    assert asked is None or asked[1] in COMMANDS
    assert Topics("shop").command(text, b"stop", ["router"]) in (None, ("router", "stop"))
