"""The WebSocket `/api/v1/events`: one reader's connection, its messages and its answers.

Not the fan-out (`server/live/hub.py`, `server/live/fanout.py`). The one rule: what this socket is sent waits in its
subscription while the peer does not read, so it stops only itself; what it says is answered in order of completion, a
stop at once.
"""

import asyncio
import json
import logging
from collections.abc import Awaitable, Callable
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any

from fastapi import FastAPI
from pydantic import ValidationError
from starlette.websockets import WebSocket, WebSocketDisconnect, WebSocketState

from server.access.auth import Principal, Role
from server.access.lease import Client, Leases
from server.api.audittrail import Trail
from server.api.clientaddress import ADDRESS_KEY
from server.api.control import client_of
from server.api.guard import PRINCIPAL_KEY
from server.api.machines import find
from server.api.messages import CLIENT_MESSAGE, ROLES, Io, Jog, JogStop, SocketQuery, Subscribe, Verb
from server.api.problems import internal_problem, invalid_request, problem_body, refuse_socket
from server.api.routing import admit, requires
from server.api.services import Json, MachineControl, Services
from server.api.socketlimit import SocketLimit
from server.api.wsaudit import MessageTrail
from server.api.wswire import wire_of
from server.jsontext import dumps
from server.live.hub import Hub
from server.live.subscription import Subscription
from server.live.textframe import text_frame
from server.machine.heldjog import HeldJogs
from server.problems import ProblemError

logger = logging.getLogger(__name__)

MAX_MESSAGE_CHARS = 16 * 1024
"""What a client says is short; a longer message ends the connection (1009)."""
MAX_ID_CHARS = 128
MAX_UNDER_WAY = 8
"""Messages of one socket that still wait for the machine; one more is refused."""
CLOSE_WITHIN_S = 1.0
"""A peer that does not read does not read the farewell either."""

POLICY_VIOLATION = 1008
TOO_BIG = 1009
INTERNAL_ERROR = 1011
TRY_AGAIN_LATER = 1013

SNAPSHOT_JOBS = 50

Said = Subscribe | Verb | Jog | JogStop | Io


async def snapshot(services: Services) -> Json:
    """Everything a page needs to show the workshop as it is now."""
    data: Json = {"machines": [machine.view() for machine in services.machines.values()], "jobs": [], "queues": {}}
    try:
        data["jobs"] = list(await services.jobs.list(None, None, SNAPSHOT_JOBS, None))
        data["queues"] = {name: list(await services.jobs.queue(name)) for name in services.machines}
    except ProblemError as problem:
        # A database that cannot answer (a damaged one) must take neither the live state nor the e-stop away.
        data["problem"] = problem_body(problem)
    return data


@dataclass(frozen=True, slots=True)
class _Start:
    """What a new reader begins with. `missed`: frames of what was published since it was last here."""

    seq: int
    resync: bool
    missed: tuple[bytes, ...] = ()

    @classmethod
    def of(cls, hub: Hub, query: SocketQuery, subscription: Subscription) -> "_Start":
        if query.since is None:
            return cls(hub.seq, resync=False)
        missed = hub.missed(query.since, subscription.wanted)
        if missed is None:
            return cls(hub.seq, resync=True)
        # A reader remembers the largest seq it saw: while the missed ones are still to come, hello must not exceed it.
        return cls(query.since, resync=False, missed=tuple(missed))


class _CutError(Exception):
    """The hub has given this reader up; `str()` says why."""


class EventSocket:
    """One connected reader; an `Outlet` of the fan-out."""

    def __init__(
        self,
        socket: WebSocket,
        services: Services,
        held: HeldJogs,
        principal: Principal,
        trail: Trail,
        leases: Leases,
        client: Client,
    ) -> None:
        self._socket = socket
        self._leases = leases
        self._client = client
        self._trail = MessageTrail(trail, socket.scope, principal)
        self._services = services
        self._held = held
        self._principal = principal
        self._wire = wire_of(socket.scope)
        self._revoked = asyncio.Event()
        self._under_way: set[asyncio.Task[None]] = set()
        self._changing: set[str] = set()

    @property
    def takes(self) -> bool:
        """Whether the peer reads what it is sent."""
        return self._wire.has_room

    def write(self, data: bytes) -> None:
        """Send frames, unless the reader may not see them any more."""
        if self._services.tokens.still_good(self._principal):
            self._wire.write_frames(data)
        else:
            self._revoked.set()

    async def run(self, query: SocketQuery) -> None:
        """Serve this reader until it goes or is cut."""
        hub = self._services.hub
        subscription = hub.subscribe(query.filter())
        # In the same step as the subscription: nothing falls between, and nothing comes twice.
        start = _Start.of(hub, query, subscription)
        self._leases.socket_opened(self._client)
        try:
            await self._socket.accept()
            await self._until_one_ends(
                self._write(start, subscription), self._read(subscription), self._watch(subscription)
            )
        finally:
            self._wire.on_room = None
            self._held.release_all(self)
            self._leases.socket_closed(self._client)
            for machine in self._changing:
                self._services.changers[machine].leave(self)
            for task in self._under_way:
                task.cancel()
            hub.unsubscribe(subscription)

    async def _write(self, start: "_Start", subscription: Subscription) -> None:
        """`hello` with the snapshot, then what was missed, then what happens, until the token is revoked."""
        data = {**await snapshot(self._services), "resync": start.resync, "role": self._principal.role.word}
        hello = self._services.hub.envelope("hello", data, seq=start.seq)
        self._wire.on_room = subscription.wake
        subscription.begin(self, (text_frame(hello), *start.missed))
        await self._revoked.wait()
        raise ProblemError("unauthorized", "The token of this connection was revoked or has expired.")

    async def _until_one_ends(self, *work: Awaitable[None]) -> None:
        tasks = [asyncio.ensure_future(one) for one in work]
        try:
            done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
        for task in done:
            error = task.exception()
            match error:
                case None | WebSocketDisconnect():
                    pass
                case _CutError():
                    await self._close(TRY_AGAIN_LATER, str(error))
                case ProblemError():
                    await self._close(POLICY_VIOLATION, error.detail)
                case _:
                    logger.error("unexpected error in a WebSocket", exc_info=error)
                    await self._close(INTERNAL_ERROR, "internal error")

    async def _close(self, code: int, reason: str) -> None:
        if self._socket.application_state is not WebSocketState.CONNECTED:
            return
        try:
            async with asyncio.timeout(CLOSE_WITHIN_S):
                await self._socket.close(code, reason[:100])
        except (TimeoutError, WebSocketDisconnect, RuntimeError):
            logger.info("a WebSocket reader did not take the farewell: %s", reason)

    async def _watch(self, subscription: Subscription) -> None:
        """Ends the connection when the hub gives it up."""
        await subscription.until_cut()
        raise _CutError(subscription.cut_reason)

    async def _read(self, subscription: Subscription) -> None:
        while True:
            message = await self._socket.receive()
            if message["type"] == "websocket.disconnect":
                raise WebSocketDisconnect(message.get("code", 1005))
            text = message.get("text")
            if text is None or len(text) > MAX_MESSAGE_CHARS:
                await self._close(TOO_BIG, f"messages are JSON texts of at most {MAX_MESSAGE_CHARS} characters")
                return
            self._take(text, subscription)

    def _take(self, text: str, subscription: Subscription) -> None:
        """Act on one message of the client; nothing is awaited here, so nothing can stand before an e-stop."""
        id_: Any = None
        message: Said | None = None
        try:
            spoken = _json_object(text)
            id_ = spoken.get("id")
            message = _valid(spoken)
            if not self._services.tokens.still_good(self._principal):
                raise ProblemError("unauthorized", "The token of this connection was revoked or has expired.")
            admit(self._principal, ROLES[type(message)])
            if isinstance(message, Jog) and len(self._under_way) >= MAX_UNDER_WAY:
                raise ProblemError("machine_busy", f"{MAX_UNDER_WAY} jogs of this connection still wait for their end.")
            answer = self._act(message, subscription)
        except ProblemError as problem:
            subscription.push(failure(id_, problem))
            self._trail.note(message, problem)
            return
        except Exception as error:  # noqa: BLE001 - the outermost loop of a message
            fault = our_fault(error)
            subscription.push(failure(id_, fault))
            self._trail.note(message, fault)
            return
        if answer is None:
            subscription.push(success(id_))
            self._trail.note(message)
        else:
            self._answer_later(id_, message, answer, subscription)

    def _act(self, message: Said, subscription: Subscription) -> Awaitable[None] | None:
        match message:
            case Subscribe():
                subscription.narrow(message.applied_to(subscription.wanted))
            case Verb(type="estop", machine=None):
                self._stop_all()
            case Verb():
                VERBS[message.type](find(self._services, self._machine(message.machine)))
            case Jog():
                return self._jog(self._machine(message.machine), message)
            case Io():
                machine = self._machine(message.machine)
                self._changing.add(machine)
                self._services.changers[machine].drive(message.pins, by=self)
            case JogStop():
                self._held.release(self._machine(message.machine), self)
        return None

    async def _jog(self, machine: str, jog: Jog) -> None:
        with self._leases.use(machine, self._client):
            if jog.hold:
                await self._held.beat(machine, self, jog.axes(), jog.feed)
            else:
                await find(self._services, machine).jog(jog.axes(), jog.feed)

    def _machine(self, name: str | None) -> str:
        """The machine that is meant. Raises ProblemError where that is not clear."""
        machines = self._services.machines
        if name is not None:
            find(self._services, name)
            return name
        if len(machines) != 1:
            raise ProblemError("invalid_request", f"Say which `machine`; there are: {', '.join(machines) or 'none'}.")
        return next(iter(machines))

    def _stop_all(self) -> None:
        """E-stop of every machine; what one of them cannot do does not keep it from the others."""
        refusals = []
        for machine in self._services.machines.values():
            try:
                machine.estop()
            except ProblemError as problem:
                refusals.append(problem)
            except Exception as error:  # noqa: BLE001 - a fault with one machine must not spare the next
                refusals.append(our_fault(error))
        if refusals:
            detail = " ".join(problem.detail for problem in refusals)
            raise ProblemError(refusals[0].code, detail, refused=len(refusals), machines=len(self._services.machines))

    def _answer_later(self, id_: Any, message: Said, answer: Awaitable[None], subscription: Subscription) -> None:
        audited = self._trail.begun(message)

        async def answered() -> None:
            refused: ProblemError | None = None
            try:
                await answer
            except asyncio.CancelledError:
                audited(None, gone=True)
                raise
            except ProblemError as problem:
                refused = problem
            except Exception as error:  # noqa: BLE001 - the outermost loop of a message
                refused = our_fault(error)
            subscription.push(success(id_) if refused is None else failure(id_, refused))
            audited(refused)

        task = asyncio.get_running_loop().create_task(answered())
        self._under_way.add(task)
        task.add_done_callback(self._under_way.discard)


VERBS: dict[str, Callable[[MachineControl], None]] = {
    "estop": lambda machine: machine.estop(),
    "pause": lambda machine: machine.pause(),
    "resume": lambda machine: machine.resume(),
    "stop": lambda machine: machine.stop(),
}


def _json_object(text: str) -> Json:
    """The JSON object in a message. Raises ProblemError."""
    try:
        spoken = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise ProblemError("malformed_json", f"The message is not JSON: {error}.") from error
    if not isinstance(spoken, dict):
        raise ProblemError("malformed_json", 'A message is a JSON object with a "type".')
    return spoken


def _valid(spoken: Json) -> Said:
    try:
        return CLIENT_MESSAGE.validate_python(spoken)
    except ValidationError as error:
        raise invalid_request(error.errors(include_url=False)) from error


def our_fault(error: Exception) -> ProblemError:
    """The log gets the error, the client a problem."""
    logger.error("unexpected error in a message of a WebSocket", exc_info=error)
    return internal_problem()


def success(id_: Any) -> bytes:
    """The answer to a message that was obeyed, framed."""
    return _framed({"type": "result", "id": _bounded(id_), "ok": True})


def failure(id_: Any, problem: ProblemError) -> bytes:
    """The answer to a message that was refused, framed."""
    return _framed({"type": "result", "id": _bounded(id_), "ok": False, "error": problem_body(problem)})


def _framed(answer: Json) -> bytes:
    return text_frame(dumps(answer))


def _bounded(id_: Any) -> str | int | None:
    """A client's id goes back to it as it came, unless it is nothing that can be an id."""
    return id_ if isinstance(id_, str | int) and len(str(id_)) <= MAX_ID_CHARS else None


def install(app: FastAPI, services: Services, leases: Leases) -> None:
    """The route of the WebSocket."""
    held = HeldJogs(lambda name: find(services, name))
    trail = Trail(lambda: services.audit)
    limit = app.state.sockets = SocketLimit(lambda: services.config.limits)

    @requires(Role.VIEWER)
    async def events(socket: WebSocket) -> None:
        principal = socket.scope[PRINCIPAL_KEY]
        with ExitStack() as place:
            try:
                admit(principal, Role.VIEWER)
                query = _query(socket)
                client = client_of(socket.scope)
                place.enter_context(limit.one(socket.scope[ADDRESS_KEY]))
            except ProblemError as problem:
                await refuse_socket(socket, problem)
                return
            await EventSocket(socket, services, held, principal, trail, leases, client).run(query)

    app.router.add_api_websocket_route("/api/v1/events", events)


def _query(socket: WebSocket) -> SocketQuery:
    try:
        return SocketQuery.model_validate(dict(socket.query_params))
    except ValidationError as error:
        raise invalid_request(error.errors(include_url=False)) from error
