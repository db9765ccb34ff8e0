"""Routes of what a controller tells of itself and keeps besides its settings: firmware, modal state, offsets, blocks.

Not their meaning (server/machine/panel.py). The one rule: what a block would do unasked is refused until it is forced.
"""

from typing import Annotated, Literal

from fastapi import FastAPI, Path, Request
from starlette.responses import Response

from server.access.auth import Role
from server.api.grblmodels import (
    FirmwareView,
    InfoRequest,
    ModalView,
    OffsetRequest,
    OffsetsView,
    StartupRequest,
    StartupView,
)
from server.api.machines import MachineName, find
from server.api.machinesettings import ASKING
from server.api.routing import Routes, json_response, principal_of
from server.api.services import PanelControl, Services

OffsetName = Annotated[Literal["G92", "TLO"], Path(description="The offset to clear", examples=["G92"])]


def install(app: FastAPI, services: Services) -> None:
    """All of them."""
    _firmware(app, services)
    _offsets(app, services)
    _startup(app, services)


def panel_of(services: Services, name: str) -> PanelControl:
    """The panel of this machine. Raises ProblemError."""
    find(services, name)
    return services.panels[name]


def _firmware(app: FastAPI, services: Services) -> None:
    routes = Routes(app, "firmware")

    @routes.add(
        "GET",
        "/machines/{m}/firmware",
        role=Role.VIEWER,
        summary="Show the controller's firmware",
        model=FirmwareView,
        errors=ASKING,
    )
    async def get_firmware(m: MachineName) -> Response:
        """Version, build options letter by letter, buffers. Asks the controller, so nothing may move."""
        return json_response(await panel_of(services, m).firmware())

    @routes.add(
        "PUT",
        "/machines/{m}/firmware/info",
        role=Role.ADMIN,
        summary="Write the controller's info text",
        model=FirmwareView,
        errors=ASKING,
    )
    async def put_info(m: MachineName, body: InfoRequest, request: Request) -> Response:
        """At most 80 characters, of which 76 without blanks fit a line to Grbl. Grbl drops blanks and case: `warnings`
        say what became of the text."""
        return json_response(await panel_of(services, m).write_info(body.info, by=principal_of(request).name))

    @routes.add(
        "GET",
        "/machines/{m}/modal",
        role=Role.VIEWER,
        summary="Show the modal state",
        model=ModalView,
        errors=ASKING,
    )
    async def get_modal(m: MachineName) -> Response:
        """Possible while a job runs too, not while the machine is held."""
        return json_response(await panel_of(services, m).modal())


def _offsets(app: FastAPI, services: Services) -> None:
    routes = Routes(app, "offsets")

    @routes.add(
        "GET",
        "/machines/{m}/offsets",
        role=Role.VIEWER,
        summary="Show the coordinate offsets",
        model=OffsetsView,
        errors=ASKING,
    )
    async def get_offsets(m: MachineName) -> Response:
        """Asks the controller, so nothing may move."""
        return json_response(await panel_of(services, m).offsets())

    @routes.add(
        "PATCH",
        "/machines/{m}/offsets",
        by_hand=True,
        role=Role.OPERATOR,
        summary="Set a coordinate offset",
        model=OffsetsView,
        errors=ASKING,
    )
    async def set_offset(m: MachineName, body: OffsetRequest, request: Request) -> Response:
        """Moves nothing; later moves go elsewhere. Answers with the offsets as they are then."""
        panel, by = panel_of(services, m), principal_of(request).name
        return json_response(await panel.set_offset(body.system, body.mode, body.given(), by=by))

    @routes.add(
        "DELETE",
        "/machines/{m}/offsets/{name}",
        by_hand=True,
        role=Role.OPERATOR,
        summary="Clear the G92 offset or the tool length",
        model=OffsetsView,
        errors=ASKING,
    )
    async def clear_offset(m: MachineName, name: OffsetName, request: Request) -> Response:
        """G92.1 or G49. Answers with the offsets as they are then."""
        return json_response(await panel_of(services, m).clear_offset(name, by=principal_of(request).name))


def _startup(app: FastAPI, services: Services) -> None:
    routes = Routes(app, "start-up blocks")

    @routes.add(
        "GET",
        "/machines/{m}/startup-blocks",
        role=Role.VIEWER,
        summary="Show the start-up blocks",
        model=StartupView,
        errors=ASKING,
    )
    async def get_startup_blocks(m: MachineName) -> Response:
        """What the controller executes by itself after every reset."""
        return json_response(await panel_of(services, m).startup_blocks())

    @routes.add(
        "PUT",
        "/machines/{m}/startup-blocks",
        by_hand=True,
        role=Role.ADMIN,
        summary="Change the start-up blocks",
        model=StartupView,
        errors=(*ASKING, "needs_force"),
    )
    async def put_startup_blocks(m: MachineName, body: StartupRequest, request: Request) -> Response:
        """The controller EXECUTES a block when it is written, and after every reset. One that moves, starts something
        or writes the controller's memory is refused without `force`."""
        by = principal_of(request).name
        panel = panel_of(services, m)
        return json_response(await panel.write_startup_blocks(body.blocks, force=body.force, by=by))
