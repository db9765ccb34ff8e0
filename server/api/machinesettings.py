"""Routes of a controller's settings and their backups.

Not their meaning (server/machine/storedsettings.py). The one rule: what is written to a controller needs an admin, and
the answer says of each setting what became of it.
"""

from typing import Annotated

from fastapi import FastAPI, Path, Request
from starlette.responses import Response

from server.access.auth import Role
from server.api.machines import MachineName, find
from server.api.routing import Routes, json_response, principal_of
from server.api.services import Services, SettingsControl
from server.api.settingmodels import (
    BackupHead,
    BackupView,
    RestoreResult,
    SettingsRequest,
    SettingsResult,
    SettingsView,
)

BackupId = Annotated[int, Path(ge=1, le=2**53, description="The backup's id", examples=[12])]

ASKING = (
    "unknown_machine", "not_supported", "not_connected", "wrong_state", "machine_busy", "job_active", "alarm_active",
    "command_failed", "no_answer",
)  # fmt: skip
"""What can stand against every question to a controller."""


def install(app: FastAPI, services: Services) -> None:
    """The routes under /machines/{m}/settings."""
    _settings(app, services)
    _backups(app, services)


def settings_of(services: Services, name: str) -> SettingsControl:
    """Those of this machine. Raises ProblemError."""
    find(services, name)
    return services.panels[name].settings


def _settings(app: FastAPI, services: Services) -> None:
    routes = Routes(app, "settings")

    @routes.add(
        "GET",
        "/machines/{m}/settings",
        role=Role.VIEWER,
        summary="Show the controller's settings",
        model=SettingsView,
        errors=ASKING,
    )
    async def get_settings(m: MachineName) -> Response:
        """Each with name, unit, range and meaning where they are known. Asks the controller, so nothing may move."""
        return json_response(await settings_of(services, m).all())

    @routes.add(
        "PATCH",
        "/machines/{m}/settings",
        role=Role.ADMIN,
        summary="Change the controller's settings",
        model=SettingsResult,
        errors=(*ASKING, "disk_full"),
    )
    async def change_settings(m: MachineName, body: SettingsRequest, request: Request) -> Response:
        """All are judged before the first is written, and a backup is kept. They are written one by one, each read
        back. The first that fails ends it: the problem has `results` of all and the id of the `backup`."""
        by = principal_of(request).name
        return json_response(await settings_of(services, m).change(body.texts(), by=by))


def _backups(app: FastAPI, services: Services) -> None:
    routes = Routes(app, "settings")

    @routes.add(
        "GET",
        "/machines/{m}/settings/backups",
        role=Role.VIEWER,
        summary="List the backups of the settings, newest first",
        model=list[BackupHead],
        errors=("unknown_machine", "not_supported"),
    )
    async def list_backups(m: MachineName) -> Response:
        return json_response(await settings_of(services, m).backups())

    @routes.add(
        "GET",
        "/machines/{m}/settings/backups/{id}",
        role=Role.VIEWER,
        summary="Show a backup, compared with the present settings",
        model=BackupView,
        errors=("unknown_machine", "unknown_backup", "not_supported"),
    )
    async def get_backup(m: MachineName, id: BackupId) -> Response:
        """Without a machine that can be asked it is shown all the same, not compared."""
        return json_response(await settings_of(services, m).backup(id))

    @routes.add(
        "POST",
        "/machines/{m}/settings/backups/{id}/restore",
        role=Role.ADMIN,
        summary="Write the settings of a backup",
        model=RestoreResult,
        errors=(*ASKING, "unknown_backup", "disk_full"),
    )
    async def restore_backup(m: MachineName, id: BackupId, request: Request) -> Response:
        """Only what differs is written; what is there now is kept in a backup first. Its end is that of a change."""
        by = principal_of(request).name
        return json_response(await settings_of(services, m).restore(id, by=by))
