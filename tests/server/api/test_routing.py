"""Roles: every route has one, and it is obeyed before anything else of the request is looked at."""

import inspect
import re
from collections.abc import Iterator
from functools import cache
from typing import Any

import httpx
import pytest
from fastapi import FastAPI
from starlette.responses import Response
from starlette.routing import BaseRoute

from server.access.auth import Role
from server.api.routing import MAX_BODY_BYTES, RoleRoute, Routes, UndeclaredRoleError, example_of, required_role
from tests.harness.asgisocket import AsgiSocket
from tests.harness.fakeworkshop import BASE_URL, FakeWorkshop, bearer
from tests.harness.simloop import run_simulated as run

PUBLIC = {
    ("GET", "/"),
    ("GET", "/docs"),
    ("GET", "/web/{path:path}"),
    ("GET", "/healthz"),
    ("GET", "/api/v1/openapi.json"),
    ("GET", "/api/v1/session"),
    ("POST", "/api/v1/session"),
    ("DELETE", "/api/v1/session"),
}
"""What needs no token. A route that is added here is open to everybody who reaches the daemon."""

ADMIN = {
    ("GET", "/api/v1/audit"),
    ("GET", "/api/v1/tokens"),
    ("POST", "/api/v1/tokens"),
    ("DELETE", "/api/v1/tokens/{id}"),
    ("PATCH", "/api/v1/machines/{m}/settings"),
    ("POST", "/api/v1/machines/{m}/settings/backups/{id}/restore"),
    ("PUT", "/api/v1/machines/{m}/firmware/info"),
    ("PUT", "/api/v1/machines/{m}/startup-blocks"),
    ("POST", "/api/v1/machines/{m}/restore"),
}


def routes_of(app: FastAPI) -> list[tuple[str, str, Role | None]]:
    """(method, path, role) of everything that the application answers to."""
    found: list[tuple[str, str, Role | None]] = []
    for route in app.routes:
        assert type(route).__name__ in ("RoleRoute", "APIWebSocketRoute"), f"{route} is not declared through Routes"
        role = required_role(getattr(route, "endpoint", None))
        found += [(method, getattr(route, "path", ""), role) for method in methods_of(route)]
    return found


def methods_of(route: BaseRoute) -> set[str]:
    methods: set[str] | None = getattr(route, "methods", None)
    return {"WEBSOCKET"} if methods is None else methods


@cache
def all_routes() -> list[tuple[str, str, Role | None]]:
    async def main() -> list[tuple[str, str, Role | None]]:
        async with FakeWorkshop() as workshop:
            return routes_of(workshop.app())

    return run(main())


def test_every_route_declares_its_role() -> None:
    assert [(method, path) for method, path, role in all_routes() if role is None] == []


def test_the_roles_are_those_of_the_contract() -> None:
    for method, path, role in all_routes():
        if (method, path) in PUBLIC:
            expected = Role.PUBLIC
        elif (method, path) in ADMIN:
            expected = Role.ADMIN
        elif method in ("GET", "WEBSOCKET") or path == "/api/v1/ticket":
            expected = Role.VIEWER
        else:
            expected = Role.OPERATOR
        assert role is expected, f"{method} {path}"


def test_the_lists_above_name_only_routes_that_exist() -> None:
    assert {(method, path) for method, path, _ in all_routes()} >= PUBLIC | ADMIN


def test_a_route_without_a_role_does_not_come_into_being() -> None:
    app = FastAPI()

    async def forgotten() -> Response:
        return Response()

    with pytest.raises(UndeclaredRoleError, match="/forgotten"):
        app.router.add_api_route("/forgotten", forgotten, route_class_override=RoleRoute)


def a_request(method: str, path: str) -> tuple[str, str]:
    """An address that fits the pattern of a route."""
    filled = path.replace("{m}", "router").replace("/jobs/{id}", "/jobs/17").replace("/tokens/{id}", "/tokens/t1")
    filled = filled.replace("/programs/{id}", f"/programs/{'0' * 64}").replace("/backups/{id}", "/backups/1")
    filled = filled.replace("/offsets/{name}", "/offsets/G92")
    assert not re.search(r"[{}]", filled), filled
    return method, filled


CLOSED = [(method, path, role) for method, path, role in all_routes() if role and method != "WEBSOCKET"]


@pytest.fixture(scope="module")
def guarded() -> Iterator[tuple[FakeWorkshop, httpx.ASGITransport, dict[str, str]]]:
    """A workshop, its application, and a token of each role."""
    workshop = FakeWorkshop()

    async def tokens() -> dict[str, str]:
        return {word: await workshop.token(word) for word in ("viewer", "operator", "admin")}

    yield workshop, httpx.ASGITransport(workshop.app()), run(tokens())
    workshop.database.close()


@pytest.mark.parametrize(("method", "path", "role"), CLOSED, ids=[f"{method} {path}" for method, path, _ in CLOSED])
def test_each_closed_route_refuses_whoever_is_below_its_role(
    guarded: tuple[FakeWorkshop, httpx.ASGITransport, dict[str, str]], method: str, path: str, role: Role
) -> None:
    """The bodies are nonsense on purpose: who may not is told so, whatever was sent."""
    workshop, transport, secrets = guarded

    async def main() -> None:
        async with httpx.AsyncClient(transport=transport, base_url=BASE_URL) as client:
            answer = await client.request(*a_request(method, path), content=b"{nonsense")
            assert (answer.status_code, answer.json()["code"]) == (401, "unauthorized")
            assert answer.headers["www-authenticate"].startswith("Bearer")
            for word, secret in secrets.items():
                before = len(workshop.router.calls) + len(workshop.jobs.calls) + len(workshop.programs.calls)
                answer = await client.request(*a_request(method, path), content=b"{nonsense", headers=bearer(secret))
                refused = answer.status_code == 403 and answer.json()["code"] == "forbidden"
                assert refused == (Role[word.upper()] < role), f"{word}: {answer.status_code}"
                after = len(workshop.router.calls) + len(workshop.jobs.calls) + len(workshop.programs.calls)
                assert after == before or not refused, "refused, and done all the same"

    run(main())


def test_the_websocket_needs_a_role_too() -> None:
    async def main() -> None:
        async with FakeWorkshop() as workshop:
            await workshop.token("viewer")
            async with AsgiSocket(workshop.app()) as socket:
                assert (socket.status, socket.problem["code"]) == (401, "unauthorized")
                assert socket.response_headers["content-type"] == "application/problem+json"

    run(main())


def test_a_body_that_is_too_large_is_not_read_to_its_end() -> None:
    async def main() -> None:
        sent = 0

        async def endless() -> Any:
            nonlocal sent
            while True:
                sent += 65536
                yield b" " * 65536

        async with FakeWorkshop() as workshop, workshop.client() as client:
            answer = await client.post("/api/v1/jobs", content=endless(), headers={"content-type": "application/json"})
            assert (answer.status_code, answer.json()["code"]) == (413, "too_large")
            assert sent <= MAX_BODY_BYTES + 2 * 65536

    run(main())


def test_examples_are_taken_from_the_models() -> None:
    from server.api.models import JobView

    assert example_of(JobView)["id"] == 17
    assert example_of(list[JobView]) == [example_of(JobView)]


def test_declaring_marks_the_endpoint() -> None:
    app = FastAPI()
    routes = Routes(app, "test", prefix="")

    @routes.add("GET", "/it", role=Role.ADMIN, summary="It")
    async def it() -> Response:
        """What it does."""
        return Response()

    assert required_role(it) is Role.ADMIN
    assert required_role(print) is None


def test_no_first_request_reads_our_source_from_the_disk(monkeypatch: pytest.MonkeyPatch) -> None:
    """It would be 20 ms of the loop that keeps the machines, and the first request may be an e-stop."""
    read: list[str] = []

    def getsourcelines(of: Any) -> tuple[list[str], int]:
        read.append(of.__name__)
        return [], 0

    monkeypatch.setattr(inspect, "getsourcelines", getsourcelines)

    async def main() -> None:
        async with FakeWorkshop() as workshop, workshop.client() as client:
            (machine, *_) = workshop.machines
            assert (await client.post(f"/api/v1/machines/{machine}/estop")).status_code == 202
            assert (await client.get("/api/v1/machines")).status_code == 200

    run(main())
    assert read == []
