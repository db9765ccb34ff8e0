"""Routes of a controller's modes and of what is pressed at it while it works.

Not their meaning (server/machine/panel.py, server/machine/switches.py). The one rule: what goes out on the real-time
lane waits for nothing before its byte is written.
"""

from fastapi import FastAPI, Request
from starlette.responses import Response

from server.access.auth import Role
from server.api.grblmodels import (
    CheckModeRequest,
    CoolantRequest,
    CoolantResult,
    DefaultsRequest,
    DefaultsResult,
    OverridesRequest,
    OverridesResult,
)
from server.api.machinemodels import Accepted
from server.api.machines import MachineName, accepted
from server.api.machinesettings import ASKING
from server.api.registers import panel_of
from server.api.routing import Routes, json_response, principal_of
from server.api.services import Services

PRESSING = ("unknown_machine", "not_supported", "not_connected")


def install(app: FastAPI, services: Services) -> None:
    """All of them."""
    _modes(app, services)
    _pressed(app, services)


def _modes(app: FastAPI, services: Services) -> None:
    routes = Routes(app, "modes")

    @routes.add(
        "POST",
        "/machines/{m}/check-mode",
        by_hand=True,
        role=Role.OPERATOR,
        summary="Switch the check mode",
        model=Accepted,
        status=202,
        errors=ASKING,
    )
    async def check_mode(m: MachineName, body: CheckModeRequest) -> Response:
        """The controller parses and moves nothing. Switched off it resets itself; the state shows when it is back."""
        await panel_of(services, m).check_mode(on=body.on)
        return accepted(m, "check_mode")

    @routes.add(
        "POST",
        "/machines/{m}/sleep",
        by_hand=True,
        role=Role.OPERATOR,
        summary="Send the controller to sleep",
        model=Accepted,
        status=202,
        errors=ASKING,
    )
    async def sleep(m: MachineName, request: Request) -> Response:
        """Motors, spindle and coolant off. Only a reset wakes it up, in alarm: its position may be lost."""
        await panel_of(services, m).sleep(by=principal_of(request).name)
        return accepted(m, "sleep")

    @routes.add(
        "POST",
        "/machines/{m}/restore",
        role=Role.ADMIN,
        summary="Restore the controller's defaults",
        model=DefaultsResult,
        errors=(*ASKING, "disk_full"),
    )
    async def restore_defaults(m: MachineName, body: DefaultsRequest, request: Request) -> Response:
        """Settings, offsets or everything as the firmware delivers them. A backup is kept first; then the controller
        resets itself."""
        by = principal_of(request).name
        return json_response(await panel_of(services, m).restore(body.what, body.confirm, by=by))


def _pressed(app: FastAPI, services: Services) -> None:
    routes = Routes(app, "real-time")

    @routes.add(
        "PATCH",
        "/machines/{m}/overrides",
        role=Role.OPERATOR,
        summary="Change feed, rapid and spindle overrides",
        model=OverridesResult,
        status=202,
        errors=PRESSING,
    )
    async def set_overrides(m: MachineName, body: OverridesRequest) -> Response:
        """At once, also while a job runs. They change in steps of 10 and 1 percent; the newest request counts."""
        return json_response(panel_of(services, m).switches.override(body.wishes()), 202)

    @routes.add(
        "POST",
        "/machines/{m}/coolant",
        role=Role.OPERATOR,
        summary="Switch flood and mist",
        model=CoolantResult,
        errors=(*PRESSING, "wrong_state", "alarm_active", "command_failed", "no_answer"),
    )
    async def set_coolant(m: MachineName, body: CoolantRequest) -> Response:
        """Also while a job runs. Answers when the reports show it."""
        return json_response(await panel_of(services, m).switches.coolant(body.wishes()))

    @routes.add(
        "POST",
        "/machines/{m}/spindle-stop",
        by_hand=True,
        role=Role.OPERATOR,
        summary="Stop the spindle of a held machine, or start it again",
        model=Accepted,
        status=202,
        errors=(*PRESSING, "wrong_state", "alarm_active"),
    )
    async def spindle_stop(m: MachineName) -> Response:
        """Resuming starts the spindle too. Grbl 1.1 moves on before it turns: start it with this first, and wait."""
        panel_of(services, m).switches.spindle_stop()
        return accepted(m, "spindle_stop")

    @routes.add(
        "POST",
        "/machines/{m}/door",
        role=Role.OPERATOR,
        summary="Do what the opened safety door does",
        model=Accepted,
        status=202,
        errors=(*PRESSING, "wrong_state", "alarm_active"),
    )
    async def safety_door(m: MachineName) -> Response:
        """Motion stops, spindle and coolant go off. The byte is sent in every state; where the controller ignores it
        the answer says so."""
        panel_of(services, m).switches.door()
        return accepted(m, "door")
