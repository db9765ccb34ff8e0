"""Every route that the application has, with everybody who may come: who is let in, and what every answer carries.

Table-driven from the application itself: a route that is added is tried here without being named. What a route does is
tested elsewhere; the bodies are nonsense on purpose, for who may not is told so whatever was sent.
"""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Any

import pytest

from server.access.auth import Role
from server.access.tokens import create_token
from server.api.guard import SAFE_METHODS, SECURITY_HEADERS, SESSION_COOKIE
from tests.harness.asgisocket import AsgiSocket
from tests.harness.fakeworkshop import FakeServerSettings, FakeWorkshop
from tests.harness.simloop import run_simulated as run
from tests.server.api.test_routing import CLOSED, a_request, all_routes

HOST = "192.168.1.5:8420"
OURS = f"http://{HOST}"
ORIGINS = {"none": None, "ours": OURS, "foreign": "http://evil.example", "null": "null"}
REBOUND = "evil.example:8420"
LONG_AGO = datetime(2020, 1, 1, tzinfo=UTC)

Answer = tuple[int, dict[str, str], str | None]


@dataclass
class House:
    """A workshop on the LAN, and the credentials of everybody who may come: headers, and the role that they give."""

    workshop: FakeWorkshop
    app: Any
    people: dict[str, tuple[dict[str, str], Role, str]]

    async def ask(self, method: str, path: str, **headers: str | None) -> Answer:
        """Status, headers and code. Straight to the application: there are thousands of these."""
        path, _, query = path.partition("?")
        sent = {"host": HOST, "content-type": "application/json", **headers}
        scope = {
            "type": "http",
            "asgi": {"version": "3.0"},
            "http_version": "1.1",
            "method": method,
            "scheme": "http",
            "path": path,
            "raw_path": path.encode(),
            "root_path": "",
            "query_string": query.encode(),
            "headers": [(name.replace("_", "-").encode(), value.encode()) for name, value in sent.items() if value],
            "client": ("192.168.1.17", 40000),
            "server": ("192.168.1.5", 8420),
        }
        got: list[Any] = []

        said = [{"type": "http.disconnect"}, {"type": "http.request", "body": b"{nonsense", "more_body": False}]

        async def receive() -> Any:
            return said.pop() if len(said) > 1 else said[0]

        async def send(message: Any) -> None:
            got.append(message)

        await self.app(scope, receive, send)
        names = {name.decode(): value.decode() for name, value in got[0]["headers"]}
        code = json.loads(got[1]["body"])["code"] if "problem+json" in names.get("content-type", "") else None
        return got[0]["status"], names, code

    def done(self) -> int:
        """How often anything was asked of the workshop."""
        shop = self.workshop
        return len(shop.router.calls) + len(shop.jobs.calls) + len(shop.programs.calls)


@pytest.fixture(scope="module")
def house() -> Iterator[House]:
    workshop = FakeWorkshop(settings=FakeServerSettings(host="0.0.0.0"))

    async def made() -> dict[str, tuple[dict[str, str], Role, str]]:
        people: dict[str, tuple[dict[str, str], Role, str]] = {"nobody": ({}, Role.PUBLIC, "unauthorized")}
        for role in (Role.VIEWER, Role.OPERATOR, Role.ADMIN):
            secret = await workshop.token(role.word)
            people[role.word] = ({"authorization": f"Bearer {secret}"}, role, "forbidden")
            signed_in = await workshop.tokens.sign_in(secret)
            assert signed_in is not None
            people[f"{role.word} by cookie"] = ({"cookie": f"{SESSION_COOKIE}={signed_in[1]}"}, role, "forbidden")
        ended = await workshop.tokens.create("ended", "admin")
        signed_in = await workshop.tokens.sign_in(ended["token"])
        assert signed_in is not None
        await workshop.tokens.revoke(ended["id"])
        _, old = create_token(workshop.database.db, "old", "admin", "1h", now=LONG_AGO)
        await workshop.tokens.load()
        cookie, forged = signed_in[1], "A" * 43
        people |= {
            "revoked": ({"authorization": f"Bearer {ended['token']}"}, Role.PUBLIC, "unauthorized"),
            "expired": ({"authorization": f"Bearer {old}"}, Role.PUBLIC, "token_expired"),
            "cookie of a revoked token": ({"cookie": f"{SESSION_COOKIE}={cookie}"}, Role.PUBLIC, "unauthorized"),
            "forged cookie": ({"cookie": f"{SESSION_COOKIE}={forged}"}, Role.PUBLIC, "unauthorized"),
            "mangled cookie": ({"cookie": f'{SESSION_COOKIE}="\x01;=='}, Role.PUBLIC, "unauthorized"),
            "token as cookie": ({"cookie": f"{SESSION_COOKIE}={old}"}, Role.PUBLIC, "unauthorized"),
            "basic": ({"authorization": "Basic YWRtaW46YWRtaW4="}, Role.PUBLIC, "unauthorized"),
        }
        return people

    people = run(made())
    # Wrong tokens are counted (ratelimit.py); here they come by the hundred.
    workshop.tokens.attempts.wrong = lambda *_arguments, **_now: None  # type: ignore[method-assign]
    yield House(workshop, workshop.app(), people)
    workshop.database.close()


@pytest.mark.parametrize(("method", "path", "role"), CLOSED, ids=[f"{method} {path}" for method, path, _ in CLOSED])
def test_each_route_with_everybody_and_from_everywhere(house: House, method: str, path: str, role: Role) -> None:
    async def main() -> None:
        for who, (credentials, has, code) in house.people.items():
            for origin, value in ORIGINS.items():
                before = house.done()
                status, headers, said = await house.ask(*a_request(method, path), origin=value, **credentials)
                case = f"{who}, Origin {origin}: {status} {said}"
                if method not in SAFE_METHODS and origin in ("foreign", "null"):
                    assert (status, said) == (403, "bad_origin"), case
                elif has < role:
                    assert (status, said) == (403 if code == "forbidden" else 401, code), case
                else:
                    assert status not in (401, 403, 421), case
                if status in (401, 403):
                    assert house.done() == before, f"{case}: and done all the same"
                carries_what_every_answer_carries(path, headers)

    run(main())


ALL = [(method, path) for method, path, _ in all_routes() if method != "WEBSOCKET"]


def test_under_a_rebound_name_nothing_answers(house: House) -> None:
    async def main() -> None:
        credentials, _, _ = house.people["admin"]
        before = house.done()
        for method, path in ALL:
            filled = a_request(method, path.replace("{path:path}", "app.js"))
            for host in (REBOUND, "", "192.168.1.5.evil.example", "user@192.168.1.5", "0.0.0.0:8420"):
                status, headers, code = await house.ask(*filled, host=host, **credentials)
                assert (status, code) == (421, "bad_host"), f"{filled} {host!r}"
                carries_what_every_answer_carries(path, headers)
        assert house.done() == before

    run(main())


def carries_what_every_answer_carries(path: str, headers: dict[str, str]) -> None:
    assert {name: headers.get(name.lower()) for name in SECURITY_HEADERS} == SECURITY_HEADERS
    stored = headers.get("cache-control", "")
    if path.startswith("/api/") and "etag" not in headers:
        assert stored == "no-store", f"{path}: {stored}"
    else:
        assert stored in ("no-store", "no-cache", "private, no-cache"), f"{path}: {stored}"
    assert "access-control-allow-origin" not in headers
    assert "server" not in headers


@pytest.mark.parametrize(
    ("method", "path", "status"),
    [
        ("GET", "/", 200),
        ("GET", "/web/app.js", 200),
        ("GET", "/nowhere", 404),
        ("GET", "/web/../server/access/auth.py", 404),
        ("GET", "/web/%2e%2e/pyproject.toml", 404),
        ("GET", "/web//etc/passwd", 404),
        ("GET", "/web/app.js\x00.png", 404),
        ("GET", "/api/v1/nowhere", 404),
        ("TRACE", "/api/v1/machines", 405),
        ("OPTIONS", "/api/v1/machines", 405),
        ("POST", "/healthz", 405),
        ("GET", "/api/v1/programs/..%2f..%2fmillstream.db", 422),
    ],
)
def test_pages_and_errors_carry_the_headers_too(house: House, method: str, path: str, status: int) -> None:
    async def main() -> None:
        credentials, _, _ = house.people["admin"]
        got, headers, _ = await house.ask(method, path, **credentials)
        assert got == status
        carries_what_every_answer_carries(path, headers)

    run(main())


def test_an_error_of_ours_carries_them_and_tells_nothing(house: House) -> None:
    async def main() -> None:
        credentials, _, _ = house.people["admin"]
        house.workshop.jobs.refusals["get"] = RuntimeError("the inside of the house")
        status, headers, code = await house.ask("GET", "/api/v1/jobs/17", **credentials)
        assert (status, code) == (500, "internal")
        carries_what_every_answer_carries("/api/", headers)
        house.workshop.jobs.refusals.clear()

    run(main())


@pytest.mark.parametrize("origin", ["foreign", "null"])
def test_the_websocket_with_everybody(house: House, origin: str) -> None:
    async def main() -> None:
        for who, (credentials, has, code) in house.people.items():
            base = {"host": HOST, **credentials}
            async with AsgiSocket(house.app, headers={**base, "origin": ORIGINS[origin] or ""}) as socket:
                assert (socket.status, socket.problem["code"]) == (403, "bad_origin"), who
            async with AsgiSocket(house.app, headers={**base, "host": REBOUND}) as socket:
                assert (socket.status, socket.problem["code"]) == (421, "bad_host"), who
            async with AsgiSocket(house.app, headers={**base, "origin": OURS}) as socket:
                if has is Role.PUBLIC:
                    assert (socket.status, socket.problem["code"]) == (401, code), who
                    continue
                assert (await socket.hear())["data"]["role"] == has.word
                result = await socket.ask({"type": "estop"})
                assert result["ok"] is (has >= Role.OPERATOR), who

    run(main())


def test_a_socket_ends_with_its_token() -> None:
    async def main() -> None:
        at = LONG_AGO
        async with FakeWorkshop(settings=FakeServerSettings(host="0.0.0.0")) as workshop:
            workshop.tokens._clock = lambda: at
            made = await workshop.tokens.create("guest", "operator", "1h")
            bearer = {"authorization": f"Bearer {made['token']}"}
            async with AsgiSocket(workshop.app(), headers=bearer) as socket:
                await socket.hear()
                at += timedelta(hours=1)
                await socket.say({"type": "pause", "machine": "router"})
                assert await socket.hear() is None
                assert socket.closed == (1008, "The token of this connection was revoked or has expired.")
            assert workshop.router.calls == []

    run(main())
