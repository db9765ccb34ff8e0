"""The ASGI application: all routes behind the guard.

Not the server that speaks HTTP (uvicorn). The one rule: what takes long is done here, before anything is served, or in
another process: the loop that answers requests also keeps the machines. Describing all routes takes a good part of a
second, and no start waits for that: it is done when somebody asks.
"""

from contextlib import AbstractContextManager, nullcontext
from functools import cache
from importlib import import_module
from importlib.metadata import version
from typing import cast

from fastapi import FastAPI, Request

from server.access.auth import Principal
from server.access.lease import Leases
from server.api import (
    access,
    audit,
    control,
    io,
    jobs,
    machines,
    machinesettings,
    problems,
    programs,
    registers,
    switches,
    system,
    ws,
)
from server.api.audittrail import Trail
from server.api.clientaddress import Proxies
from server.api.control import client_of
from server.api.guard import Guard, HostRule
from server.api.openapi import document
from server.api.services import Services
from server.clock import rfc3339, utc_now
from server.jsontext import dumps

LATE_IMPORTS = ("anyio._backends._asyncio",)
"""What the first request that asks whether its client is still there would import: 20 ms of the loop, with a job under
way as well."""


def build(services: Services) -> FastAPI:
    """Put the application together. Of `services` only the configuration must be there already."""
    app = _routes(services)
    settings = services.config.server

    async def identify(*, bearer: str | None, cookie: str | None, address: str) -> Principal | None:
        return await services.tokens.identify(bearer=bearer, cookie=cookie, address=address)

    def controlled(request: Request) -> AbstractContextManager[None]:
        machine = request.path_params["m"]
        # What is wrong with the name the route itself says.
        known = machine in services.machines
        return app.state.leases.use(machine, client_of(request.scope)) if known else nullcontext()

    app.state.control = controlled

    def redeem(ticket: str) -> Principal | None:
        return services.tokens.redeem(ticket)

    app.add_middleware(
        Guard,
        hosts=HostRule(settings.host, settings.allowed_hosts),
        identify=identify,
        redeem=redeem,
        proxies=Proxies(settings.trusted_proxies),
        record=Trail(lambda: services.audit).request,
    )
    for name in LATE_IMPORTS:
        import_module(name)
    return app


@cache
def description() -> str:
    """The OpenAPI document as text, of routes that serve nobody: it depends on no workshop, so one is made for all."""
    return dumps(document(_routes(cast(Services, None))))


def _routes(services: Services) -> FastAPI:
    app = FastAPI(
        title="millstream",
        version=version("millstream"),
        openapi_url=None,
        docs_url=None,
        redoc_url=None,
        redirect_slashes=False,
    )
    leases = app.state.leases = Leases(
        lambda name, holder: services.machines[name].show_control(holder), lambda: rfc3339(utc_now())
    )
    problems.install(app)
    system.install(app, services, description)
    for part in (access, audit, machines, registers, machinesettings, switches, io, programs, jobs):
        part.install(app, services)
    control.install(app, services, leases)
    ws.install(app, services, leases)
    return app
