"""How a route is declared: with its role, its refusals and its examples, or it does not come into being.

Not the checks of Host and Origin (`guard.py`). The one rule: a role is judged before a byte of the body is read.
"""

import asyncio
import inspect
from collections.abc import Callable, Coroutine, Iterator
from contextlib import AbstractContextManager
from functools import wraps
from http import HTTPStatus
from itertools import islice
from typing import Any, TypeVar, cast

from fastapi import FastAPI, Request
from fastapi.routing import APIRoute, _endpoint_context_cache
from pydantic import BaseModel
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect
from starlette.responses import JSONResponse, Response
from starlette.types import Message, Receive

from server.access.auth import Principal, Role
from server.access.tokens import EXPIRED_DETAIL
from server.api.guard import MADE_KEY, PRINCIPAL_KEY
from server.api.problems import MEDIA_TYPE, problem_body, statuses
from server.jsontext import dumps
from server.problems import ProblemError

MAX_BODY_BYTES = 1024 * 1024
"""Enough for any request but the upload of a program, which is streamed and has its own limit."""
PIECE_VALUES = 100
"""Of a list, written at once: a third of a millisecond where each is a thousand characters."""
ROLE_ATTRIBUTE = "millstream_role"
BY_HAND_ATTRIBUTE = "millstream_by_hand"
STREAMED_ATTRIBUTE = "millstream_streamed"

Endpoint = TypeVar("Endpoint", bound=Callable[..., Any])

EVERYWHERE = ("bad_host", "internal")
WHEN_CLOSED = ("unauthorized", "token_expired", "too_many_attempts", "forbidden")


class UndeclaredRoleError(Exception):
    """A route without a role: our bug, found when the application is built."""


def requires(role: Role) -> Callable[[Endpoint], Endpoint]:
    """Declare the role that an endpoint needs."""

    def mark(endpoint: Endpoint) -> Endpoint:
        setattr(endpoint, ROLE_ATTRIBUTE, role)
        return endpoint

    return mark


def required_role(endpoint: Any) -> Role | None:
    """The role that an endpoint declares, None if it declares none."""
    role = getattr(endpoint, ROLE_ATTRIBUTE, None)
    return role if isinstance(role, Role) else None


def admit(principal: Principal, role: Role) -> None:
    """Raises ProblemError when `principal` may not do what needs `role`."""
    if principal.role >= role:
        return
    if principal.refused is not None:
        raise ProblemError(principal.refused, EXPIRED_DETAIL)
    if principal.role is Role.PUBLIC:
        raise ProblemError(
            "unauthorized",
            "Send a token as `Authorization: Bearer …`, or sign in. `millstream token create` makes one.",
        )
    raise ProblemError(
        "forbidden",
        f"This needs the role {role.word}; the token {principal.name!r} has {principal.role.word}.",
        role=principal.role.word,
        needed=role.word,
    )


def principal_of(request: Request) -> Principal:
    """Who is asking, as the guard found out."""
    principal = request.scope[PRINCIPAL_KEY]
    assert isinstance(principal, Principal)
    return principal


def control_of(request: Request) -> AbstractContextManager[None]:
    """The control of the machine that a request is about, as `application.build` gives it."""
    control: Callable[[Request], AbstractContextManager[None]] = request.app.state.control
    return control(request)


async def still_there(request: Request) -> None:
    """Raises ClientDisconnect where nobody waits for the answer any more."""
    if await request.is_disconnected():
        raise ClientDisconnect


class RoleRoute(APIRoute):
    """A route that lets nobody in below its role and no body above its limit."""

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        handler = super().get_route_handler()
        role = required_role(self.endpoint)
        if role is None:
            raise UndeclaredRoleError(f"{self.path} declares no role")
        # At the first request to an endpoint FastAPI would read and parse the file that it stands in, to name it in
        # errors that we do not raise: 20 ms of the loop and a look at the disk, and an e-stop is a first request, too.
        _endpoint_context_cache[id(self.endpoint)] = {"function": self.name}
        streamed = getattr(self.endpoint, STREAMED_ATTRIBUTE, False)

        async def guarded(request: Request) -> Response:
            admit(principal_of(request), role)
            if not streamed:
                request = Request(request.scope, _bounded(request.receive))
            response = await handler(request)
            if response.status_code == HTTPStatus.CREATED:
                _note_made(request, response)
            return response

        return guarded


def _in_control(endpoint: Endpoint) -> Endpoint:
    """The endpoint with the control of its machine. That is taken when the request has been read and is as documented:
    one that is slow to come, or wrong, takes it from nobody."""
    signature = inspect.signature(endpoint)
    asks = "request" in signature.parameters

    @wraps(endpoint)
    async def controlled(request: Request, **given: Any) -> Response:
        with control_of(request):
            response: Response = await (endpoint(request=request, **given) if asks else endpoint(**given))
        return response

    if not asks:
        ours = inspect.Parameter("request", inspect.Parameter.KEYWORD_ONLY, annotation=Request)
        signature = signature.replace(parameters=[*signature.parameters.values(), ours])
    controlled.__signature__ = signature  # type: ignore[attr-defined]
    return cast(Endpoint, controlled)


def _note_made(request: Request, response: Response) -> None:
    """What a request has made stands in its Location; the audit names it."""
    kind, _, id_ = response.headers.get("location", "").removeprefix("/api/v1/").partition("/")
    if id_:
        request.scope[MADE_KEY] = ("job" if kind == "jobs" else "target", id_)


def _bounded(receive: Receive) -> Receive:
    taken_bytes = 0

    async def bounded() -> Message:
        nonlocal taken_bytes
        message = await receive()
        taken_bytes += len(message.get("body", b""))
        if taken_bytes > MAX_BODY_BYTES:
            raise HTTPException(413)
        return message

    return bounded


def json_response(value: Any, status: int = 200, headers: dict[str, str] | None = None) -> Response:
    """An answer in JSON. What the services say is passed on as it is; the models describe it and tests compare."""
    return Response(dumps(value), status, headers, "application/json")


async def json_list(values: Iterator[Any]) -> Response:
    """A list of many in JSON, written in pieces: between two of them the loop has a turn for the machines."""
    pieces: list[str] = []
    while piece := list(islice(values, PIECE_VALUES)):
        pieces.append(dumps(piece)[1:-1])
        await asyncio.sleep(0)
    return Response(f"[{','.join(pieces)}]", media_type="application/json")


class Routes:
    """Declares routes of one part of the API, completely."""

    def __init__(self, app: FastAPI, tag: str, prefix: str = "/api/v1") -> None:
        self._app = app
        self._tag = tag
        self._prefix = prefix

    def add(
        self,
        method: str,
        path: str,
        *,
        role: Role,
        summary: str,
        model: Any = None,
        status: int = 200,
        errors: tuple[str, ...] = (),
        streamed: bool = False,
        by_hand: bool = False,
        content: dict[str, Any] | None = None,
        openapi_extra: dict[str, Any] | None = None,
    ) -> Callable[[Endpoint], Endpoint]:
        """Declare an endpoint. `model` describes its JSON answer; `content` one that is not JSON. `by_hand`: it moves
        the machine `m`, and one client at a time may do so (server/access/lease.py)."""

        def declare(endpoint: Endpoint) -> Endpoint:
            requires(role)(endpoint)
            setattr(endpoint, STREAMED_ATTRIBUTE, streamed)
            setattr(endpoint, BY_HAND_ATTRIBUTE, by_hand)
            called = _in_control(endpoint) if by_hand else endpoint
            codes = (*errors, *EVERYWHERE, *(WHEN_CLOSED if role is not Role.PUBLIC else ()))
            codes += ("control_held",) if by_hand else ()
            codes += () if method == "GET" else ("bad_origin",)
            codes += ("invalid_request",) if _takes_input(endpoint) else ()
            codes += ("malformed_json", "too_large") if _takes_json(endpoint) else ()
            self._app.router.add_api_route(
                self._prefix + path,
                called,
                route_class_override=RoleRoute,
                tags=[self._tag],
                methods=[method],
                summary=summary,
                description=_description(endpoint, role),
                status_code=status,
                response_model=None,
                response_class=Response if model is None else JSONResponse,
                responses={status: _success(model, content), **_refusals(codes)},
                openapi_extra={"x-required-role": role.word, "x-needs-control": by_hand, **(openapi_extra or {})},
                operation_id=endpoint.__name__,
            )
            return endpoint

        return declare


def _description(endpoint: Any, role: Role) -> str:
    needs = "Needs no token." if role is Role.PUBLIC else f"Needs the role `{role.word}`."
    return f"{inspect.getdoc(endpoint) or ''}\n\n{needs}".strip()


def _takes_input(endpoint: Any) -> bool:
    return any(name != "request" for name in inspect.signature(endpoint).parameters)


def _takes_json(endpoint: Any) -> bool:
    annotations = (parameter.annotation for parameter in inspect.signature(endpoint).parameters.values())
    return any("BaseModel" in str(_bases(annotation)) for annotation in annotations)


def _bases(annotation: Any) -> list[type]:
    options = getattr(annotation, "__args__", (annotation,))
    return [base for option in options if isinstance(option, type) for base in option.__mro__]


def _success(model: Any, content: dict[str, Any] | None) -> dict[str, Any]:
    if content is not None:
        return {"description": "Done", "content": content}
    if model is None:
        return {"description": "Done"}
    return {"description": "Done", "model": model, "content": {"application/json": {"example": example_of(model)}}}


def example_of(model: Any) -> Any:
    """The first example of a response model; a list of one for a list."""
    items = getattr(model, "__args__", None)
    if items:
        return [example_of(items[0])]
    assert issubclass(model, BaseModel)
    extra = model.model_config.get("json_schema_extra")
    assert isinstance(extra, dict), f"{model.__name__} has no example"
    examples = extra["examples"]
    assert isinstance(examples, list)
    return examples[0]


def _refusals(codes: tuple[str, ...]) -> dict[int | str, dict[str, Any]]:
    answers: dict[int | str, dict[str, Any]] = {}
    for status, grouped in statuses(codes).items():
        examples = {}
        for code in grouped:
            problem = ProblemError(code, EXAMPLE_DETAILS.get(code, "What happened, where, and what to do now."))
            examples[code] = {"summary": problem.title, "value": problem_body(problem)}
        answers[status] = {
            "description": "; ".join(f"`{code}`" for code in grouped),
            "content": {
                MEDIA_TYPE: {"schema": {"$ref": "#/components/schemas/Problem"}, "examples": examples},
            },
        }
    return answers


EXAMPLE_DETAILS = {
    "unauthorized": "Send a token as `Authorization: Bearer …`, or sign in.",
    "forbidden": "This needs the role operator; the token 'screen' has viewer.",
    "unknown_machine": "There is no machine 'router2'; there are: router.",
    "not_connected": "router is not connected; it is retried every few seconds. Check the cable and the port.",
    "job_active": "Job 17 is using router. Pause or cancel it first.",
    "alarm_active": "router is in alarm: end limit switch hit (axis x). Clear it with unlock.",
    "disk_full": "The disk is full after 104857600 bytes; nothing of the upload was kept. Free some space.",
    "preflight_failed": "The program has 2 errors for router; see `report`.",
}
"""Typical words for the examples in the OpenAPI document."""
