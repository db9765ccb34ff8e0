"""A `requests` session whose requests end in an ASGI application, on a loop with simulated time.

For tools that only know `requests`. Not a network, not a thread: the loop runs until the answer is there, and all that
happens meanwhile (a machine answering, a timer) happens in simulated time. The one rule: a request without the
`known` token comes from an address of its own, or a tool that tries wrong ones would be taken for one who guesses them.
"""

import asyncio
import ipaddress
from io import BytesIO
from typing import Any
from urllib.parse import unquote, urlsplit

import requests
from requests.adapters import HTTPAdapter
from starlette.types import ASGIApp, Message
from urllib3 import HTTPHeaderDict, HTTPResponse

FIRST_ADDRESS = int(ipaddress.IPv4Address("10.0.0.1"))


class AsgiAdapter(HTTPAdapter):
    """Mount it on a session for `http://`."""

    def __init__(self, app: ASGIApp, loop: asyncio.AbstractEventLoop, known: str) -> None:
        super().__init__()
        self._app = app
        self._loop = loop
        self._known = f"Bearer {known}"
        self.sent = 0

    def send(self, request: requests.PreparedRequest, *_: Any, **__: Any) -> requests.Response:
        self.sent += 1
        answer = self._loop.run_until_complete(_exchange(self._app, self._scope(request), _body(request)))
        return self.build_response(request, answer)

    def _scope(self, request: requests.PreparedRequest) -> dict[str, Any]:
        parts = urlsplit(request.url or "")
        number = 0 if request.headers.get("Authorization") == self._known else self.sent
        headers = [(_latin(name).lower(), _latin(value)) for name, value in request.headers.items()]
        return {
            "type": "http",
            "asgi": {"version": "3.0"},
            "http_version": "1.1",
            "method": request.method,
            "scheme": "http",
            "path": unquote(parts.path),
            "raw_path": parts.path.encode(),
            "root_path": "",
            "query_string": parts.query.encode(),
            "headers": [*headers, (b"host", parts.netloc.encode())],
            "client": (str(ipaddress.IPv4Address(FIRST_ADDRESS + number)), 50_000),
            "server": ("127.0.0.1", 8420),
            "extensions": {},
        }


def _latin(text: str | bytes) -> bytes:
    return text if isinstance(text, bytes) else text.encode("latin-1")


def _body(request: requests.PreparedRequest) -> bytes:
    body = request.body
    if body is None:
        return b""
    return body.encode() if isinstance(body, str) else bytes(body)


async def _exchange(app: ASGIApp, scope: dict[str, Any], body: bytes) -> HTTPResponse:
    content = BytesIO()
    headers = HTTPHeaderDict()
    status = 0
    waiting: list[Message] = [{"type": "http.request", "body": body, "more_body": False}]
    done = asyncio.Event()

    async def receive() -> Message:
        if waiting:
            return waiting.pop()
        await done.wait()
        return {"type": "http.disconnect"}

    async def send(message: Message) -> None:
        nonlocal status
        if message["type"] == "http.response.start":
            status = message["status"]
            for name, value in message["headers"]:
                headers.add(name.decode("latin-1"), value.decode("latin-1"))
        else:
            content.write(message.get("body", b""))
            if not message.get("more_body"):
                done.set()

    await app(scope, receive, send)
    content.seek(0)
    return HTTPResponse(content, headers, status, preload_content=False)
