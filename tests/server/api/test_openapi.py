"""The OpenAPI document is complete: nobody has to read the code to write a client."""

import re
from collections.abc import Callable, Iterator
from functools import cache
from typing import Any

import pytest

from server.api.application import description
from server.api.messages import SOCKET_TEXT, Jog, JogStop, Subscribe, Verb
from server.background.childworker import ChildEndedError
from server.problems import CODES
from tests.harness.fakeworkshop import FakeWorkshop
from tests.harness.simloop import run_simulated as run
from tools.openapi import COMMAND, STORED, readable

NOT_FIELDS = ("example", "examples", "default", "enum", "additionalProperties", "patternProperties")
"""The values of a map with free names are the services' to judge."""
METHODS = {"GET", "POST", "PUT", "PATCH", "DELETE"}


@cache
def document() -> dict[str, Any]:
    async def main() -> dict[str, Any]:
        async with FakeWorkshop() as workshop, workshop.client() as client:
            answer: dict[str, Any] = (await client.get("/api/v1/openapi.json")).json()
            return answer

    return run(main())


@cache
def served() -> set[tuple[str, str]]:
    async def main() -> set[tuple[str, str]]:
        async with FakeWorkshop() as workshop:
            routes = workshop.app().routes
            return {
                (method, getattr(route, "path", "").replace(":path", ""))
                for route in routes
                for method in getattr(route, "methods", ())
            }

    return run(main())


OPERATIONS = [
    (method.upper(), path, operation)
    for path, item in document()["paths"].items()
    for method, operation in item.items()
]
each = pytest.mark.parametrize(("method", "path", "operation"), OPERATIONS, ids=[f"{m} {p}" for m, p, _ in OPERATIONS])


def resolve(schema: dict[str, Any]) -> dict[str, Any]:
    while "$ref" in schema:
        schema = document()["components"]["schemas"][schema["$ref"].rpartition("/")[2]]
    return schema


def test_every_route_is_described_and_nothing_else() -> None:
    assert {(method, path) for method, path, _ in OPERATIONS} == served()
    assert len(OPERATIONS) > 50


@each
def test_summary_role_and_name(method: str, path: str, operation: dict[str, Any]) -> None:
    assert re.fullmatch(r"[A-Z][^.]{4,80}", operation["summary"])
    assert operation["tags"]
    role = operation["x-required-role"]
    assert role in ("public", "viewer", "operator", "admin")
    assert operation["security"] == ([] if role == "public" else [{"token": []}, {"session": []}])
    assert ("no token" if role == "public" else f"`{role}`") in operation["description"]


def test_operation_ids_are_unique() -> None:
    ids = [operation["operationId"] for _, _, operation in OPERATIONS]
    assert len(ids) == len(set(ids))


@each
def test_answers_have_a_schema_and_an_example(method: str, path: str, operation: dict[str, Any]) -> None:
    good = {status: answer for status, answer in operation["responses"].items() if status < "400"}
    assert len(good) <= 1
    for status, answer in good.items():
        if status == "204":
            assert "content" not in answer
            continue
        for media in answer["content"].values():
            assert resolve(media["schema"])
            assert media["example"] not in (None, "")
    if not good:
        assert "409" in operation["responses"], "an address that only ever refuses says so"


@each
def test_refusals_are_problems_with_examples(method: str, path: str, operation: dict[str, Any]) -> None:
    bad = {status: answer for status, answer in operation["responses"].items() if status >= "400"}
    assert {"421", "500"} <= set(bad)
    if operation["x-required-role"] != "public":
        assert {"401", "403"} <= set(bad)
    if operation.get("parameters"):
        assert "422" in bad
    if "application/json" in operation.get("requestBody", {}).get("content", {}):
        assert {"400", "413", "422"} <= set(bad)
    if method != "GET":
        assert "bad_origin" in bad["403"]["content"]["application/problem+json"]["examples"]
    for status, answer in bad.items():
        assert set(answer["content"]) == {"application/problem+json"}
        media = answer["content"]["application/problem+json"]
        assert media["schema"] == {"$ref": "#/components/schemas/Problem"}
        for code, example in media["examples"].items():
            assert CODES[code][0] == int(status) == example["value"]["status"]
            assert example["value"]["code"] == code


@each
def test_bodies_have_a_schema_and_an_example(method: str, path: str, operation: dict[str, Any]) -> None:
    for media in operation.get("requestBody", {}).get("content", {}).values():
        assert media["schema"]
        assert media["example"]


@each
def test_parameters_are_described(method: str, path: str, operation: dict[str, Any]) -> None:
    for parameter in operation.get("parameters", ()):
        assert parameter["description"], parameter["name"]


def test_it_is_made_when_somebody_asks_and_not_by_the_loop_that_keeps_the_machines(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Making it takes half a second: neither a start waits for that, nor a machine. And it is made once."""
    asked: list[object] = []

    async def elsewhere(fn: Callable[[], str]) -> str:
        asked.append(fn)
        if len(asked) == 1:
            raise ChildEndedError("the process for describer ended with -9 before its answer")
        return "{}"

    async def main() -> list[tuple[int, str]]:
        async with FakeWorkshop() as workshop:
            monkeypatch.setattr(workshop.describer, "run", elsewhere)
            made = description.cache_info().misses
            async with workshop.client() as client:
                answers = [await client.get("/api/v1/openapi.json") for _ in range(3)]
            assert description.cache_info().misses == made
            return [(answer.status_code, answer.json().get("code", "")) for answer in answers]

    assert run(main()) == [(503, "process_ended"), (200, ""), (200, "")]
    assert asked == [description, description]


def test_nothing_of_the_framework_is_in_it() -> None:
    assert "ValidationError" not in str(document())


def test_every_schema_that_is_pointed_to_is_there() -> None:
    pointed = set(re.findall(r"#/components/schemas/(\w+)", str(document())))
    assert pointed <= set(document()["components"]["schemas"])


def test_the_websocket_is_described_with_every_message() -> None:
    assert SOCKET_TEXT in document()["info"]["description"]
    for model in (Subscribe, Verb, Jog, JogStop):
        for word in model.model_fields["type"].annotation.__args__:
            assert word in SOCKET_TEXT


def test_a_change_of_the_document_is_seen_in_review() -> None:
    assert STORED.read_text(encoding="utf-8") == readable(), f"the API has changed; write the document anew: {COMMAND}"


@each
def test_whole_numbers_of_an_address_fit_everywhere(method: str, path: str, operation: dict[str, Any]) -> None:
    """A number past 2^53 is another one in JavaScript, and past 2^63 an error in the database."""
    schemas = [parameter["schema"] for parameter in operation.get("parameters", ())]
    for schema in schemas:
        for number in whole_numbers(schema):
            assert number.get("maximum", 2**54) <= 2**53, (path, number)


def whole_numbers(schema: Any) -> Iterator[dict[str, Any]]:
    if isinstance(schema, list):
        for inner in schema:
            yield from whole_numbers(inner)
    elif isinstance(schema, dict):
        if schema.get("type") == "integer":
            yield schema
        for name, inner in schema.items():
            if name not in NOT_FIELDS:
                yield from whole_numbers(inner)


@each
def test_operations_have_a_name_for_clients(method: str, path: str, operation: dict[str, Any]) -> None:
    assert re.fullmatch(r"[a-z]+(_[a-z0-9]+)*", operation["operationId"])
