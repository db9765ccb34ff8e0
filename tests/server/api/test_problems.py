"""Whatever goes wrong, the client gets problem+json with a stable code, and never a framework's own shape."""

from collections.abc import Callable, Iterator
from typing import Any

import httpx
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from starlette.exceptions import HTTPException
from starlette.types import Message
from starlette.websockets import WebSocket

from server.api.problems import problem_body, refuse_socket
from server.problems import CODES, ProblemError
from tests.harness.fakeworkshop import BASE_URL, FakeWorkshop
from tests.harness.simloop import run_simulated as run

JSON = {"content-type": "application/json"}


def is_problem(answer: httpx.Response, status: int, code: str) -> dict[str, Any]:
    """Asserts the shape of RFC 9457 and our code."""
    assert answer.headers["content-type"] == "application/problem+json", answer.text
    body: dict[str, Any] = answer.json()
    assert (answer.status_code, body["status"], body["code"]) == (status, status, code), answer.text
    assert body["type"] == f"/docs#problem-{code}"
    assert body["title"] == CODES[code][1]
    assert body["detail"].endswith((".", "…", ")")), body["detail"]
    return body


Ask = Callable[..., httpx.Response]


@pytest.fixture(scope="module")
def ask() -> Iterator[Ask]:
    """One request to an application that all tests share: it takes longer to build than to answer."""
    workshop = FakeWorkshop()
    app = workshop.app()

    async def asking(method: str, path: str, **options: Any) -> httpx.Response:
        async with httpx.AsyncClient(transport=httpx.ASGITransport(app), base_url=BASE_URL) as client:
            return await client.request(method, path, **options)

    yield lambda method, path, **options: run(asking(method, path, **options))
    workshop.database.close()


def test_no_such_address(ask: Ask) -> None:
    for path in (
        "/nothing",
        "/api/v1/nothing",
        "/api/v1/machines/",
        "/api/v2/machines",
        "/web/",
        "/%00",
        "/api/v1//jobs",
    ):
        is_problem(ask("GET", path), 404, "not_found")


def test_no_such_method_says_which_there_are(ask: Ask) -> None:
    answer = ask("PUT", "/healthz")
    is_problem(answer, 405, "method_not_allowed")
    assert answer.headers["allow"] == "GET"
    is_problem(ask("GET", "/api/v1/machines/router/estop"), 405, "method_not_allowed")
    for path, methods in (("control", "DELETE, GET, POST"), ("jog", "DELETE, POST"), ("io", "GET, PATCH")):
        answer = ask("PUT", f"/api/v1/machines/router/{path}")
        assert (answer.status_code, answer.headers["allow"]) == (405, methods)


@pytest.mark.parametrize(
    "body",
    [b"{", b"", b"nope", b"\xff\xfe\x00", b'{"program": ', b"[" * 100_000, b'{"a": 1} {"b": 2}'],
)
def test_a_body_that_is_not_json(ask: Ask, body: bytes) -> None:
    answer = ask("POST", "/api/v1/jobs", content=body, headers=JSON)
    if body == b"":
        is_problem(answer, 422, "invalid_request")
    else:
        is_problem(answer, 400, "malformed_json")


def test_json_of_the_wrong_shape_names_the_fields(ask: Ask) -> None:
    problem = is_problem(ask("POST", "/api/v1/jobs", json={"machine": 7, "end_lin": 9}), 422, "invalid_request")
    assert {error["field"] for error in problem["errors"]} == {"body.program", "body.machine", "body.end_lin"}
    assert "this field does not exist" in problem["detail"]


@pytest.mark.parametrize(
    ("value", "said"),
    [
        ('"3"', "a whole number is needed, not a text"),
        ("3.5", "a whole number is needed, not a decimal number"),
        ("true", "a whole number is needed, not true or false"),
        ("[1]", "a whole number is needed, not a list"),
        ("{}", "a whole number is needed, not an object"),
    ],
)
def test_a_wrong_type_is_told_in_the_words_of_json(ask: Ask, value: str, said: str) -> None:
    answer = ask("POST", "/api/v1/jobs/1/move", content=f'{{"position": {value}}}', headers=JSON)
    body = is_problem(answer, 422, "invalid_request")
    assert body["errors"] == [{"field": "body.position", "message": said}]


def test_json_without_its_content_type_says_what_to_do(ask: Ask) -> None:
    answer = ask("POST", "/api/v1/jobs", content=b'{"program": "x"}', headers={"content-type": "text/plain"})
    assert "Content-Type: application/json" in is_problem(answer, 422, "invalid_request")["detail"]


def test_what_is_wrong_with_a_body_as_a_whole_is_said(ask: Ask) -> None:
    answer = ask("POST", "/api/v1/machines/router/jog", json={"feed": 500})
    detail = is_problem(answer, 422, "invalid_request")["detail"]
    assert "name at least one of the axes" in detail
    assert "Content-Type" not in detail


@pytest.mark.parametrize(
    ("path", "field"),
    [
        ("/api/v1/jobs?limit=0", "query.limit"),
        ("/api/v1/jobs?limit=x", "query.limit"),
        ("/api/v1/jobs?before=-1", "query.before"),
        ("/api/v1/jobs/seventeen", "path.id"),
        ("/api/v1/jobs/99999999999999999999", "path.id"),
        ("/api/v1/machines/No_Such", "path.m"),
        ("/api/v1/programs/..%2f..%2fetc", None),
        ("/api/v1/programs/xyz", "path.id"),
    ],
)
def test_parameters_of_the_wrong_shape(ask: Ask, path: str, field: str | None) -> None:
    answer = ask("GET", path)
    if field is None:
        is_problem(answer, 404, "not_found")
    else:
        assert is_problem(answer, 422, "invalid_request")["errors"][0]["field"] == field


def test_numbers_that_are_none(ask: Ask) -> None:
    for number in ("NaN", "Infinity", "-Infinity", "1e999"):
        body = f'{{"x": {number}, "feed": 500}}'.encode()
        is_problem(ask("POST", "/api/v1/machines/router/jog", content=body, headers=JSON), 422, "invalid_request")


def test_an_error_of_ours_is_a_problem_too_and_says_nothing_of_the_inside() -> None:
    async def main() -> None:
        async with FakeWorkshop() as workshop, workshop.client() as client:
            workshop.router.refusals["home"] = RuntimeError("secret of the house")
            answer = await client.post("/api/v1/machines/router/home")
            is_problem(answer, 500, "internal")
            assert "secret" not in answer.text

    run(main())


def test_a_refusal_of_a_service_is_passed_on_with_what_belongs_to_it() -> None:
    async def main() -> None:
        async with FakeWorkshop() as workshop, workshop.client() as client:
            refusal = ProblemError("preflight_failed", "Two errors.", report={"errors": [1, 2]})
            workshop.jobs.refusals["create"] = refusal
            answer = await client.post("/api/v1/jobs", json={"program": "p", "machine": "router"})
            assert is_problem(answer, 422, "preflight_failed")["report"] == {"errors": [1, 2]}

    run(main())


@pytest.mark.parametrize("code", sorted(CODES))
def test_what_belongs_to_a_problem_cannot_hide_what_it_is(code: str) -> None:
    body = problem_body(ProblemError(code, "Detail.", type="no", status=1, title="no", report={}))
    assert (body["type"], body["status"], body["title"]) == (f"/docs#problem-{code}", *CODES[code])
    assert body["report"] == {}


@settings(max_examples=100, deadline=None)
@given(
    method=st.sampled_from(["GET", "POST", "PUT", "PATCH", "DELETE", "HEAD", "OPTIONS", "TRACE", "BREW"]),
    path=st.sampled_from(["/api/v1/jobs", "/api/v1/machines/router/jog", "/api/v1/session", "/api/v1/programs", "/"]),
    body=st.binary(max_size=64),
    content_type=st.sampled_from(
        ["application/json", "multipart/form-data", "multipart/form-data; boundary=x", "a", ""]
    ),
)
def test_no_request_gets_an_internal_error(ask: Ask, method: str, path: str, body: bytes, content_type: str) -> None:
    headers = {"content-type": content_type} if content_type else {}
    answer = ask(method, path, content=body, headers=headers)
    assert answer.status_code < 500, answer.text
    if answer.status_code >= 400 and method != "HEAD":
        assert answer.headers["content-type"] == "application/problem+json"


def test_a_framework_error_without_a_code_of_ours_is_an_internal_one() -> None:
    async def main() -> None:
        async with FakeWorkshop() as workshop, workshop.client() as client:
            workshop.router.refusals["home"] = HTTPException(418)
            is_problem(await client.post("/api/v1/machines/router/home"), 500, "internal")

    run(main())


def test_a_server_that_can_only_close_a_handshake_closes_it() -> None:
    sent: list[Message] = []

    async def send(message: Message) -> None:
        sent.append(message)

    async def receive() -> Message:
        return {"type": "websocket.connect"}

    async def main() -> None:
        socket = WebSocket({"type": "websocket", "path": "/", "headers": [], "extensions": {}}, receive, send)
        await refuse_socket(socket, ProblemError("forbidden", "No."))

    run(main())
    assert [message["type"] for message in sent] == ["websocket.close"]
