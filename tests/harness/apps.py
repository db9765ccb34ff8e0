"""The application for a test, made in a sixth of the time: what is worked out of a route's signature is kept.

Not another application: routes, endpoints, leases, limits and the guard are made anew each time, so that no test sees
what another one did. The one rule: what is kept depends on the source alone, and test_apps.py compares.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any, cast
from unittest.mock import patch

from fastapi import FastAPI
from fastapi.routing import APIRoute, request_response

from server import api
from server.api.routing import RoleRoute

if TYPE_CHECKING:
    from server.api.services import Services

Endpoint = Callable[..., Any]
Made = tuple[dict[str, Any], dict[str, Any]]

_made: dict[tuple[Any, ...], Made] = {}
"""By path, methods and the code of the endpoint: what it was declared with, and what became of that."""


def create_app(workshop: "Services | Any") -> FastAPI:
    """As `server.api.create_app`."""
    with patch.object(RoleRoute, "__init__", _init):
        return api.create_app(cast("Services", workshop))


def _init(
    route: RoleRoute, path: str, endpoint: Endpoint, *, dependency_overrides_provider: Any, **options: Any
) -> None:
    """FastAPI reads a signature anew for each application, a millisecond a route, and finds the same."""
    key = (path, *options["methods"], endpoint.__code__)
    declared, kept = _made.get(key, (None, {}))
    if declared != options:
        APIRoute.__init__(route, path, endpoint, dependency_overrides_provider=dependency_overrides_provider, **options)
        _made[key] = (options, dict(vars(route)))
        return
    vars(route).update(kept)
    route.endpoint = endpoint
    route.dependency_overrides_provider = dependency_overrides_provider
    route.dependant = replace(kept["dependant"], call=endpoint)
    route.app = request_response(route.get_route_handler())
