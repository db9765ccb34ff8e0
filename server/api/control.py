"""Routes of the control of a machine, and how a request tells which client it is.

Not the lease (server/access/lease.py). The one rule: a client is told apart by what nobody else can have: its token, or
its session; what it calls itself only tells apart those who share one.
"""

import re
from urllib.parse import parse_qs

from fastapi import FastAPI, Request
from starlette.datastructures import Headers
from starlette.responses import Response
from starlette.types import Scope

from server.access.auth import Principal, Role
from server.access.lease import Client, Leases
from server.api.accessmodels import ControlRequest, ControlView
from server.api.clientaddress import ADDRESS_KEY, UNKNOWN
from server.api.guard import MADE_KEY, PRINCIPAL_KEY, UNAUDITED_KEY
from server.api.machines import MachineName, find
from server.api.routing import Routes, json_response
from server.api.services import Json, Services
from server.problems import ProblemError

CLIENT_HEADER = "millstream-client"
CLIENT_PARAMETER = "client"
CLIENT_ID = re.compile(r"[A-Za-z0-9._-]{1,64}")
WITHOUT = "local"


def client_of(scope: Scope) -> Client:
    """Who moves machines by this request, or over this socket. Raises ProblemError."""
    principal: Principal = scope[PRINCIPAL_KEY]
    address = scope.get(ADDRESS_KEY, UNKNOWN)
    named = Headers(scope=scope).get(CLIENT_HEADER)
    if named is None and scope["type"] == "websocket":  # a browser cannot set its headers
        named = next(iter(parse_qs(scope["query_string"].decode("latin-1")).get(CLIENT_PARAMETER, ())), None)
    if named is not None and CLIENT_ID.fullmatch(named) is None:
        raise ProblemError("invalid_request", "Millstream-Client is 1 to 64 letters, digits, '.', '_' and '-'.")
    mark = f"client {named}" if named is not None else f"session {principal.session}"
    if named is None and principal.session is None:
        mark = f"address {address}"
    return Client((principal.token_id or WITHOUT, mark), principal.name, named or address or "this computer")


def install(app: FastAPI, services: Services, leases: Leases) -> None:
    """The routes /machines/{m}/control."""
    routes = Routes(app, "by hand")

    def view(machine: str, client: Client) -> Json:
        lease = leases.holder(machine)
        holder = None if lease is None else lease.view()
        return {"machine": machine, "holder": holder, "yours": leases.has(machine, client)}

    @routes.add(
        "GET",
        "/machines/{m}/control",
        role=Role.VIEWER,
        summary="Who moves the machine by hand",
        model=ControlView,
        errors=("unknown_machine",),
    )
    async def get_control(m: MachineName, request: Request) -> Response:
        find(services, m)
        return json_response(view(m, client_of(request.scope)))

    @routes.add(
        "POST",
        "/machines/{m}/control",
        role=Role.OPERATOR,
        summary="Take the control, or keep it",
        model=ControlView,
        errors=("unknown_machine", "control_held"),
    )
    async def take_control(m: MachineName, request: Request, body: ControlRequest | None = None) -> Response:
        """Not needed to move a machine that nobody else moves. Repeated within 30 seconds it keeps the control without
        a move; `takeover` takes it from who has it, and everybody is told."""
        find(services, m)
        client = client_of(request.scope)
        request.scope[UNAUDITED_KEY] = leases.has(m, client)
        before = leases.take(m, client, takeover=body is not None and body.takeover)
        if before is not None:
            request.scope[MADE_KEY] = ("target", f"from {before.name}")
            said = f"{client.name} has taken the control of {m} from {before.name}."
            services.hub.publish("log", m, {"level": "warning", "kind": "control", "message": said})
        return json_response(view(m, client))

    @routes.add(
        "DELETE",
        "/machines/{m}/control",
        role=Role.OPERATOR,
        summary="Give the control back",
        status=204,
        errors=("unknown_machine", "control_held"),
    )
    async def release_control(m: MachineName, request: Request) -> Response:
        """Harmless where nobody has it."""
        find(services, m)
        leases.release(m, client_of(request.scope))
        return Response(status_code=204)
