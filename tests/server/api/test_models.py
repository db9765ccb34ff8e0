"""Requests are judged by JSON's own types: no text is taken for a number, none for true or false."""

from typing import Any

import pytest
from pydantic import BaseModel, ValidationError

from server.api import (
    accessmodels,
    grblmodels,
    iomodels,
    machinemodels,
    messages,
    models,
    recovermodels,
    settingmodels,
)
from server.api.grblmodels import CheckModeRequest, CoolantRequest, OverridesRequest
from server.api.iomodels import PinsRequest, ToolRequest, ToolsRequest
from server.api.machinemodels import JogRequest
from server.api.messages import CLIENT_MESSAGE, SocketQuery
from server.api.models import PROGRAM_ID, JobRequest, MoveRequest
from server.api.recovermodels import RecoverRequest
from tests.harness.fakeworkshop import FakeWorkshop
from tests.harness.simloop import run_simulated as run

MODULES = (accessmodels, grblmodels, iomodels, machinemodels, messages, models, recovermodels, settingmodels)
SAID = [
    one
    for module in MODULES
    for one in vars(module).values()
    if isinstance(one, type) and issubclass(one, BaseModel) and one.__module__ == module.__name__
    if one.model_config.get("extra") == "forbid"
]
"""Everything that a client says."""
JOB = {"program": PROGRAM_ID, "machine": "router"}
TOOL = {"number": 1, "pocket": 1}

WRONG: list[tuple[type[BaseModel], dict[str, Any]]] = [
    *((JobRequest, {**JOB, "start_line": value}) for value in ("3", True, 3.5)),
    *((JobRequest, {**JOB, "hold": value}) for value in ("true", 1, 0, "false")),
    (JobRequest, {**JOB, "ignored_errors": ["20"]}),
    (JobRequest, {**JOB, "note": 7}),
    (MoveRequest, {"position": "1"}),
    (RecoverRequest, {"line": "601"}),
    (RecoverRequest, {"action": "from_line", "clearance": "20"}),
    (RecoverRequest, {"action": "from_line", "operator_done": "yes"}),
    (JogRequest, {"x": 1.0, "feed": "500"}),
    (JogRequest, {"x": True, "feed": 500}),
    (OverridesRequest, {"feed": "110"}),
    (OverridesRequest, {"rapid": "50"}),
    (CheckModeRequest, {"on": "on"}),
    (CoolantRequest, {"flood": 1}),
    (ToolRequest, {"tool": "3"}),
    (ToolsRequest, {"tools": [{**TOOL, "diameter": "6"}]}),
    (ToolsRequest, {"tools": [{**TOOL, "pocket": "1"}]}),
    (PinsRequest, {"pins": {"tool-changed": "true"}}),
]
RIGHT: list[tuple[type[BaseModel], dict[str, Any]]] = [
    (JobRequest, {**JOB, "start_line": 3.0, "end_line": 4}),
    (MoveRequest, {"position": 1.0}),
    (JogRequest, {"x": 1, "feed": 500}),
    (RecoverRequest, {"action": "from_line", "clearance": 20}),
    (OverridesRequest, {"feed": 110.0}),
    (ToolsRequest, {"tools": [{**TOOL, "diameter": 6}]}),
]


@pytest.mark.parametrize("model", SAID, ids=[one.__name__ for one in SAID])
def test_every_request_and_message_is_strict(model: type[BaseModel]) -> None:
    assert bool(model.model_config.get("strict")) is (model is not SocketQuery), "a query has nothing but text"
    assert model.model_config.get("allow_inf_nan") is False


def test_there_are_requests() -> None:
    assert {JobRequest, JogRequest, ToolsRequest, SocketQuery} <= set(SAID)


@pytest.mark.parametrize(("model", "body"), WRONG)
def test_another_type_is_refused(model: type[BaseModel], body: dict[str, Any]) -> None:
    with pytest.raises(ValidationError) as refused:
        model.model_validate(body)
    assert [error["type"] for error in refused.value.errors()] != ["missing"]


@pytest.mark.parametrize(("model", "body"), RIGHT)
def test_a_number_is_a_number_however_it_is_written(model: type[BaseModel], body: dict[str, Any]) -> None:
    said = model.model_validate(body)
    assert all(getattr(said, field) == value for field, value in body.items() if field != "tools")


@pytest.mark.parametrize(
    "message",
    [
        {"type": "subscribe", "rate": "5"},
        {"type": "jog", "x": 1, "feed": "600"},
        {"type": "jog", "x": 1, "feed": 600, "hold": "true"},
        {"type": "io", "pins": {}, "connect": 1},
        {"type": "estop", "id": 1.5},
    ],
)
def test_messages_of_the_websocket_are_judged_alike(message: dict[str, Any]) -> None:
    with pytest.raises(ValidationError):
        CLIENT_MESSAGE.validate_python(message)


def test_the_refusal_names_the_field_and_what_it_should_be() -> None:
    async def main() -> None:
        async with FakeWorkshop() as workshop, workshop.client() as client:
            answer = await client.post("/api/v1/jobs", json={**JOB, "start_line": "3"})
            problem = answer.json()
            assert (answer.status_code, problem["code"]) == (422, "invalid_request")
            assert problem["errors"] == [
                {"field": "body.start_line", "message": "a whole number is needed, not a text"},
            ]
            assert workshop.jobs.calls == []

    run(main())
