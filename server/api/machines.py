"""Routes of a machine: its state, and what an operator asks it to do.

Not what it means to a machine (`server/machine/controller.py`). The one rule: e-stop, pause, resume and stop are handed
over in the same step of the loop in which they came in; nothing is awaited before them.
"""

from collections.abc import Awaitable, Callable
from typing import Annotated

from fastapi import FastAPI, Path, Query
from starlette.responses import Response

from server.access.auth import Role
from server.api.machinemodels import (
    Accepted,
    CodeView,
    CommandsRequest,
    CommandsResult,
    ConsoleLine,
    FilesView,
    JogRequest,
    MachineView,
    RunFileRequest,
    StateView,
)
from server.api.routing import Routes, json_list, json_response
from server.api.services import MachineControl, Services
from server.problems import ProblemError

MachineName = Annotated[str, Path(pattern=r"^[a-z0-9-]{1,64}$", description="The machine's name", examples=["router"])]

MAX_CONSOLE_LINES = 1000

NEEDS_LINK = ("unknown_machine", "not_connected")
NEEDS_IDLE = (*NEEDS_LINK, "wrong_state", "machine_busy", "job_active", "alarm_active", "command_failed", "no_answer")
NEEDS_ANSWER = ("not_connected", "wrong_state", "machine_busy", "job_active", "command_failed", "no_answer")
NEEDS_RESET = ("not_connected", "wrong_state", "job_active", "no_answer")
NEEDS_JOB = ("not_connected", "wrong_state")

Act = Callable[[MachineControl], Awaitable[None] | None]
VERBS: tuple[tuple[str, str, Act, tuple[str, ...]], ...] = (
    ("estop", "Emergency stop", lambda machine: machine.estop(), ("not_connected",)),
    ("pause", "Pause after the batch in flight", lambda machine: machine.pause(), NEEDS_JOB),
    ("resume", "Go on after a pause", lambda machine: machine.resume(), NEEDS_JOB),
    ("stop", "Cancel the job after the batch in flight", lambda machine: machine.stop(), NEEDS_JOB),
    ("connect", "Open the link", lambda machine: machine.connect(), ("wrong_state",)),
    ("disconnect", "Close the link and leave it closed", lambda machine: machine.disconnect(), ("job_active",)),
    ("home", "Home the machine", lambda machine: machine.home(), (*NEEDS_IDLE[1:], "not_supported")),
    ("unlock", "Clear an alarm", lambda machine: machine.unlock(), NEEDS_ANSWER),
    ("reset", "Clear an alarm and begin with the machine anew", lambda machine: machine.reset(), NEEDS_RESET),
)
"""Verb, what it does, how, and what can stand against it."""
BY_HAND = frozenset({"home", "unlock", "reset"})
"""Verbs that need the control of the machine. What stops it needs none, nor does what goes on with a job."""


def find(services: Services, name: str) -> MachineControl:
    """The machine of this name. Raises ProblemError."""
    machine = services.machines.get(name)
    if machine is None:
        there_are = ", ".join(services.machines) or "none; add [[machine]] to the configuration"
        raise ProblemError("unknown_machine", f"There is no machine {name!r}; there are: {there_are}.")
    return machine


def accepted(machine: str, what: str) -> Response:
    """202: it is taken, the state shows when it is done."""
    return json_response({"machine": machine, "accepted": what}, 202)


def install(app: FastAPI, services: Services) -> None:
    """All routes under /machines."""
    _views(app, services)
    _verbs(app, services)
    _by_hand(app, services)
    _sd_and_tool(app, services)


def _views(app: FastAPI, services: Services) -> None:
    routes = Routes(app, "machines")

    @routes.add("GET", "/machines", role=Role.VIEWER, summary="List the machines", model=list[MachineView])
    async def list_machines() -> Response:
        return json_response([machine.view() for machine in services.machines.values()])

    @routes.add(
        "GET",
        "/machines/{m}",
        role=Role.VIEWER,
        summary="Show a machine",
        model=MachineView,
        errors=("unknown_machine",),
    )
    async def get_machine(m: MachineName) -> Response:
        return json_response(find(services, m).view())

    @routes.add(
        "GET",
        "/machines/{m}/state",
        role=Role.VIEWER,
        summary="Show the last known state of a machine",
        model=StateView,
        errors=("unknown_machine",),
    )
    async def get_state(m: MachineName) -> Response:
        return json_response(find(services, m).state_view())

    @routes.add(
        "GET",
        "/machines/{m}/console",
        role=Role.VIEWER,
        summary="Show the last messages on the wire, oldest first",
        model=list[ConsoleLine],
        errors=("unknown_machine",),
    )
    async def get_console(
        m: MachineName,
        limit: Annotated[int, Query(ge=1, le=MAX_CONSOLE_LINES, description="How many lines at most")] = 200,
    ) -> Response:
        return await json_list(find(services, m).console(limit))

    @routes.add(
        "GET",
        "/machines/{m}/codes",
        role=Role.VIEWER,
        summary="List the codes that the machine's profile knows",
        model=list[CodeView],
        errors=("unknown_machine",),
    )
    async def get_codes(m: MachineName) -> Response:
        find(services, m)
        return json_response(services.programs.codes(m))


def _verbs(app: FastAPI, services: Services) -> None:
    routes = Routes(app, "machines")
    for verb, summary, act, errors in VERBS:
        endpoint = _verb(services, verb, act)
        declare = routes.add(
            "POST",
            f"/machines/{{m}}/{verb}",
            role=Role.OPERATOR,
            summary=summary,
            model=Accepted,
            status=202,
            errors=("unknown_machine", *errors),
            by_hand=verb in BY_HAND,
        )
        declare(endpoint)


def _verb(services: Services, verb: str, act: Act) -> Callable[..., Awaitable[Response]]:
    async def endpoint(m: MachineName) -> Response:
        waiting = act(find(services, m))
        if waiting is not None:
            await waiting
        return accepted(m, verb)

    endpoint.__name__ = f"{verb}_machine"
    return endpoint


def _by_hand(app: FastAPI, services: Services) -> None:
    routes = Routes(app, "by hand")

    @routes.add(
        "POST",
        "/machines/{m}/commands",
        role=Role.OPERATOR,
        summary="Run blocks by hand",
        model=CommandsResult,
        errors=(*NEEDS_IDLE, "too_many_blocks"),
        by_hand=True,
    )
    async def run_commands(m: MachineName, body: CommandsRequest) -> Response:
        """Possible when no job runs. Answers when the blocks are executed, with a result for each."""
        if len(body.blocks) > (most := services.config.limits.blocks_per_command):
            detail = f"{len(body.blocks)} blocks; limits.blocks_per_command allows {most}. Send more as a program."
            raise ProblemError("too_many_blocks", detail)
        return json_response({"results": await find(services, m).run_blocks(body.blocks)})

    @routes.add(
        "POST",
        "/machines/{m}/jog",
        role=Role.OPERATOR,
        summary="Move by a distance",
        model=Accepted,
        status=202,
        errors=NEEDS_IDLE,
        by_hand=True,
    )
    async def jog(m: MachineName, body: JogRequest) -> Response:
        """A relative move of one or more axes; possible when the machine is idle."""
        await find(services, m).jog(body.axes(), body.feed)
        return accepted(m, "jog")

    @routes.add(
        "DELETE",
        "/machines/{m}/jog",
        role=Role.OPERATOR,
        summary="End a jog",
        model=Accepted,
        status=202,
        errors=NEEDS_LINK,
    )
    async def cancel_jog(m: MachineName) -> Response:
        """What is still to be sent of a jog is not sent any more."""
        find(services, m).cancel_jog()
        return accepted(m, "cancel_jog")


def _sd_and_tool(app: FastAPI, services: Services) -> None:
    routes = Routes(app, "SD card and tools")

    @routes.add(
        "GET",
        "/machines/{m}/sd",
        role=Role.VIEWER,
        summary="List the SD card",
        model=FilesView,
        errors=(*NEEDS_LINK, "machine_busy", "job_active", "not_supported", "no_answer"),
    )
    async def list_sd(m: MachineName) -> Response:
        """Asks the machine, so it must not be executing anything."""
        return json_response(await find(services, m).list_files())

    @routes.add(
        "POST",
        "/machines/{m}/sd/run",
        role=Role.OPERATOR,
        summary="Run a program from the SD card",
        model=Accepted,
        status=202,
        errors=(*NEEDS_IDLE, "not_supported"),
        by_hand=True,
    )
    async def run_sd(m: MachineName, body: RunFileRequest) -> Response:
        """The machine reads the program itself; state and tool requests come while it runs."""
        await find(services, m).run_file(body.name)
        return accepted(m, "run")

    @routes.add(
        "POST",
        "/machines/{m}/tool/confirm",
        role=Role.OPERATOR,
        summary="The requested tool is in the spindle",
        model=Accepted,
        status=202,
        errors=(*NEEDS_LINK, "wrong_state"),
    )
    async def confirm_tool(m: MachineName) -> Response:
        """A job that waits for the tool goes on: the machine may start to move."""
        await find(services, m).confirm_tool()
        return accepted(m, "confirm_tool")
