"""Routes of a machine's tool changer: its pins, the person who changes tools, the tool table.

Not their meaning (server/changer/toolchanger.py). The one rule: only inputs are driven from outside; what the daemon
drives is refused with 409.
"""

from fastapi import FastAPI
from starlette.responses import Response

from server.access.auth import Role
from server.api.iomodels import After, IoView, PinsRequest, ToolRequest, ToolsRequest, ToolsView
from server.api.machinemodels import Accepted
from server.api.machines import MachineName, accepted, find
from server.api.models import JobEventView
from server.api.routing import Routes, json_response
from server.api.services import ChangerControl, Services


def changer_of(services: Services, name: str) -> ChangerControl:
    """The tool changer of this machine. Raises ProblemError."""
    find(services, name)
    return services.changers[name]


def install(app: FastAPI, services: Services) -> None:
    """All of them."""
    _pins(app, services)
    _people(app, services)
    _table(app, services)


def _pins(app: FastAPI, services: Services) -> None:
    routes = Routes(app, "tool changer")

    @routes.add(
        "GET",
        "/machines/{m}/io",
        role=Role.VIEWER,
        summary="Show the pins of the tool changer",
        model=IoView,
        errors=("unknown_machine",),
    )
    async def get_io(m: MachineName) -> Response:
        return json_response(changer_of(services, m).io_view())

    @routes.add(
        "PATCH",
        "/machines/{m}/io",
        role=Role.OPERATOR,
        summary="Drive inputs of the tool changer",
        model=IoView,
        errors=("unknown_machine", "wrong_state"),
    )
    async def drive_io(m: MachineName, body: PinsRequest) -> Response:
        """All levels in one step. A job that waits for the tool may start to move."""
        changer = changer_of(services, m)
        changer.drive(body.pins)
        return json_response(changer.io_view())

    @routes.add(
        "GET",
        "/machines/{m}/io/events",
        role=Role.VIEWER,
        summary="Show what happened at the tool changer",
        model=list[JobEventView],
        errors=("unknown_machine",),
    )
    async def get_io_events(m: MachineName, after: After = 0) -> Response:
        """Every change of a pin and of a state, and what came of it, with a job or without."""
        return json_response(await changer_of(services, m).events(after))


def _people(app: FastAPI, services: Services) -> None:
    routes = Routes(app, "tool changer")

    @routes.add(
        "POST",
        "/machines/{m}/tool/fail",
        role=Role.OPERATOR,
        summary="The tool cannot be changed: the job fails",
        model=Accepted,
        status=202,
        errors=("unknown_machine", "wrong_state"),
    )
    async def fail_tool(m: MachineName) -> Response:
        changer_of(services, m).fail()
        return accepted(m, "fail_tool")

    @routes.add(
        "POST",
        "/machines/{m}/tool/clear-fault",
        role=Role.OPERATOR,
        summary="Forget the fault of the tool changer",
        model=Accepted,
        status=202,
        errors=("unknown_machine", "wrong_state"),
    )
    async def clear_fault(m: MachineName) -> Response:
        changer_of(services, m).clear_fault()
        return accepted(m, "clear_fault")

    @routes.add(
        "POST",
        "/machines/{m}/tool/set",
        role=Role.OPERATOR,
        summary="Say which tool is in the spindle",
        model=Accepted,
        status=202,
        errors=("unknown_machine", "wrong_state"),
    )
    async def set_tool(m: MachineName, body: ToolRequest) -> Response:
        """Where nobody knows it after a change that was broken off, or it was changed by hand. Nothing moves."""
        changer_of(services, m).set_tool(body.tool)
        return accepted(m, "set_tool")


def _table(app: FastAPI, services: Services) -> None:
    routes = Routes(app, "tool changer")

    @routes.add(
        "GET",
        "/machines/{m}/tools",
        role=Role.VIEWER,
        summary="Show the tool table",
        model=ToolsView,
        errors=("unknown_machine",),
    )
    async def get_tools(m: MachineName) -> Response:
        return json_response(changer_of(services, m).tools_view())

    @routes.add(
        "PUT",
        "/machines/{m}/tools",
        role=Role.OPERATOR,
        summary="Replace the tool table",
        model=ToolsView,
        errors=("unknown_machine", "wrong_state"),
    )
    async def put_tools(m: MachineName, body: ToolsRequest) -> Response:
        """Lines of the text that are not understood are left out and come back as `warnings`."""
        tools = None if body.tools is None else [tool.model_dump() for tool in body.tools]
        return json_response(changer_of(services, m).replace_table(body.text, tools))
