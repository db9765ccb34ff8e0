"""Refusals as HTTP: `application/problem+json` (RFC 9457) for everything that goes wrong, whoever noticed it.

Not the list of codes (`server/problems.py`). The one rule: no client ever sees a framework's own error shape.
"""

import logging
from collections.abc import Mapping
from http import HTTPStatus
from typing import Any

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from starlette.exceptions import HTTPException
from starlette.responses import Response
from starlette.routing import Match
from starlette.websockets import WebSocket

from server.jsontext import dumps
from server.problems import CODES, ProblemError

logger = logging.getLogger(__name__)

MEDIA_TYPE = "application/problem+json"
TYPE_PREFIX = "/docs#problem-"
"""`type` of a problem: the address of its explanation in the daemon's own documentation."""
PROBLEM_KEY = "millstream.problem"
"""Where in a request's scope the code of its refusal stands, for the audit."""
MAX_ECHO_CHARS = 200
"""A client's own words are shown back to it only this far."""

NEEDED = {
    "int_type": "a whole number",
    "float_type": "a number",
    "bool_type": "true or false",
    "string_type": "a text",
    "list_type": "a list",
    "dict_type": "an object",
    "model_type": "an object",
    "model_attributes_type": "an object",
}
"""What pydantic asks for, by the type of its error, in the words of JSON."""

WHAT_TO_DO = {
    HTTPStatus.NOT_FOUND: ("not_found", "Nothing is at {path}. All addresses are listed at /docs."),
    HTTPStatus.METHOD_NOT_ALLOWED: ("method_not_allowed", "{path} does not take {method}. See /docs."),
    HTTPStatus.BAD_REQUEST: ("malformed_json", "The body could not be read as JSON; send UTF-8 encoded JSON."),
    HTTPStatus.REQUEST_ENTITY_TOO_LARGE: ("too_large", "The body is larger than this address takes."),
}


def problem_body(problem: ProblemError) -> dict[str, Any]:
    """The JSON object of a problem (RFC 9457 §3), our `code` and what belongs to it beside the standard members."""
    return {
        **problem.extra,
        "type": TYPE_PREFIX + problem.code,
        "title": problem.title,
        "status": problem.status,
        "code": problem.code,
        "detail": problem.detail,
    }


def problem_response(problem: ProblemError, headers: Mapping[str, str] | None = None) -> Response:
    """The answer to a request that is refused."""
    extra = dict(headers or {})
    if problem.status == HTTPStatus.UNAUTHORIZED:
        extra["WWW-Authenticate"] = 'Bearer realm="millstream"'
    if (wait_s := problem.extra.get("retry_after_s")) is not None:
        extra["Retry-After"] = str(wait_s)
    return Response(dumps(problem_body(problem)), problem.status, extra, MEDIA_TYPE)


async def refuse_socket(socket: WebSocket, problem: ProblemError) -> None:
    """Refuse a WebSocket's handshake with a problem, or with a bare refusal where the server cannot say more."""
    if "websocket.http.response" in socket.scope.get("extensions", {}):
        await socket.send_denial_response(problem_response(problem))
    else:
        await socket.close()


def internal_problem() -> ProblemError:
    """What a client is told about a fault of ours; the log has the rest."""
    return ProblemError(
        "internal", "Something went wrong in the daemon; its log says what. The machine was left as it is."
    )


def install(app: FastAPI) -> None:
    """Make `app` answer with problems only."""
    app.add_exception_handler(ProblemError, _on_problem)
    app.add_exception_handler(RequestValidationError, _on_invalid)
    app.add_exception_handler(HTTPException, _on_http)


async def _on_problem(request: Request, error: Exception) -> Response:
    assert isinstance(error, ProblemError)
    return _answered(request, error)


async def _on_invalid(request: Request, error: Exception) -> Response:
    assert isinstance(error, RequestValidationError)
    return _answered(request, invalid_request(error.errors()))


def _answered(request: Request, problem: ProblemError, headers: Mapping[str, str] | None = None) -> Response:
    request.scope[PROBLEM_KEY] = problem.code
    return problem_response(problem, headers)


async def _on_http(request: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)
    if error.status_code not in WHAT_TO_DO:
        logger.error("a framework's error without a code of ours: %s", error)
        return _answered(request, internal_problem())
    code, detail = WHAT_TO_DO[HTTPStatus(error.status_code)]
    path = request.url.path[:MAX_ECHO_CHARS]
    headers = error.headers if code != "method_not_allowed" else {"Allow": _methods(request)}
    return _answered(request, ProblemError(code, detail.format(path=path, method=request.method)), headers)


def _methods(request: Request) -> str:
    """All methods of this address (RFC 9110 §15.5.6): each of ours has a route of its own."""
    there = [one for one in request.app.routes if one.matches(request.scope)[0] is not Match.NONE]
    return ", ".join(sorted({method for one in there for method in getattr(one, "methods", ())}))


def invalid_request(errors: Any) -> ProblemError:
    """Pydantic's list of errors as one problem: `errors` names each field and what is wrong with it."""
    if any(error["type"] == "json_invalid" for error in errors):
        return ProblemError("malformed_json", f"The body is not JSON: {errors[0]['ctx']['error']}.")
    fields = [
        {"field": ".".join(str(part) for part in error["loc"])[:MAX_ECHO_CHARS], "message": _sentence(error)}
        for error in errors
    ]
    named = "; ".join(f"{field['field']}: {field['message']}" for field in fields[:3])
    return ProblemError("invalid_request", f"{named}. What is expected is described at /docs.", errors=fields)


def _json_type(value: object) -> str:
    match value:
        case bool():
            return "true or false"
        case str():
            return "a text"
        case int():
            return "a whole number"
        case float():
            return "a decimal number"
        case list():
            return "a list"
        case dict():
            return "an object"
        case _:
            return "null"


def _sentence(error: Mapping[str, Any]) -> str:
    if error["type"] in NEEDED and error["loc"] != ("body",):
        return f"{NEEDED[error['type']]} is needed, not {_json_type(error.get('input'))}"
    if error["type"] == "extra_forbidden":
        return "this field does not exist"
    if error["type"] == "value_error":
        return str(error.get("ctx", {}).get("error", error["msg"]))[
            :MAX_ECHO_CHARS
        ]  # our own words, without pydantic's before them
    if error["loc"] == ("body",):
        return "a JSON object is needed, sent with Content-Type: application/json"
    return str(error["msg"])[:MAX_ECHO_CHARS]


def statuses(codes: tuple[str, ...]) -> dict[int, list[str]]:
    """The codes by HTTP status, as the OpenAPI document groups them."""
    grouped: dict[int, list[str]] = {}
    for code in codes:
        grouped.setdefault(CODES[code][0], []).append(code)
    return dict(sorted(grouped.items()))
