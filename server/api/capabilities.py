"""Addresses that only other controllers can serve: on a machine without the capability they say so, with 409.

A table, no logic. The one rule: an address of the contract always exists, so that a client can tell "this machine
cannot" from "this address is wrong".
"""

from collections.abc import Awaitable, Callable
from typing import NoReturn

from fastapi import FastAPI
from starlette.responses import Response

from server.api.machines import MachineName, find
from server.api.routing import Routes
from server.api.services import Services
from server.auth import Role
from server.problems import ProblemError

ADDRESSES = (
    ("GET", "io", Role.VIEWER, "Show the pins of the tool changer"),
    ("PATCH", "io", Role.OPERATOR, "Drive the pins of the tool changer"),
)
"""Method, address, role, summary (api.md)."""


def install(app: FastAPI, services: Services) -> None:
    """All of them."""
    routes = Routes(app, "capabilities of other controllers")
    for method, name, role, summary in ADDRESSES:
        declare = routes.add(
            method, f"/machines/{{m}}/{name}", role=role, summary=summary, errors=("unknown_machine", "not_supported")
        )
        declare(_refusing(services, method, name))


def _refusing(services: Services, method: str, name: str) -> Callable[..., Awaitable[Response]]:
    async def endpoint(m: MachineName) -> NoReturn:
        """Answers 409 `not_supported` where the controller has nothing of the kind."""
        view = find(services, m).view()
        raise ProblemError(
            "not_supported",
            f"The {view['protocol']} controller of {m} has no {name}; its `capabilities` say what it has.",
            capability=name,
        )

    endpoint.__name__ = f"{method.lower()}_{name.replace('-', '_')}"
    return endpoint
