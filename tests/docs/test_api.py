"""docs/api.md against the application: routes with their roles, error codes, WebSocket types."""

import typing
from types import SimpleNamespace

from fastapi import FastAPI
from fastapi.routing import APIRoute

from jobs.job import ERROR_CODES, Status
from server.api import create_app
from server.api.messages import ROLES
from server.api.routing import required_role
from server.config.model import Config
from server.live.subscription import TOPICS
from server.problems import CODES
from tests.harness.docs import page, rows


def application() -> FastAPI:
    """All routes, with nothing behind them."""
    services = SimpleNamespace(config=Config(), tokens=SimpleNamespace(identify=None), machines={})
    return create_app(typing.cast(typing.Any, services))


def test_every_route_with_its_role_and_no_other() -> None:
    routes = set()
    for route in application().routes:
        if isinstance(route, APIRoute):
            role = required_role(route.endpoint)
            assert role is not None
            routes |= {(method, route.path, role.word) for method in route.methods}
    table = rows(page("api.md"), "method", "path", "role", "what")
    assert {(row[0], row[1], row[2]) for row in table} == routes
    assert all(row[3] for row in table)


def test_every_error_code_with_status_and_title() -> None:
    table = rows(page("api.md"), "code", "status", "title")
    assert {row[0]: (int(row[1]), row[2]) for row in table} == CODES


def test_every_error_of_a_job() -> None:
    assert {row[0] for row in rows(page("api.md"), "error.code", "meaning")} == set(ERROR_CODES)


def test_every_status_of_a_job_is_told() -> None:
    text = page("api.md")
    assert [status for status in Status if status not in text] == []


def test_every_type_of_the_websocket() -> None:
    assert {row[0] for row in rows(page("api.md"), "type", "data")} == {*TOPICS, "hello", "result"}


def test_every_message_of_a_client_with_its_role() -> None:
    spoken = {
        (word, role.word)
        for model, role in ROLES.items()
        for word in typing.get_args(model.model_fields["type"].annotation)
    }
    assert {(row[0], row[1]) for row in rows(page("api.md"), "client's type", "role", "what")} == spoken
