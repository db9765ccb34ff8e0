import asyncio
from typing import Any

import pytest

from server.api.machinemodels import MAX_BLOCK_CHARS, MAX_BLOCKS, ConsoleLine, FilesView, MachineView, StateView
from server.api.routing import PIECE_VALUES
from server.config.limits import LimitsConfig
from server.problems import ProblemError
from tests.harness.fakeworkshop import FakeConfig, FakeWorkshop
from tests.harness.simloop import run_simulated as run

ROUTER = "/api/v1/machines/router"


def ask(method: str, path: str, body: Any = None) -> tuple[int, Any, list[Any]]:
    """Status, JSON and what the machine was asked."""

    async def main() -> tuple[int, Any, list[Any]]:
        async with FakeWorkshop() as workshop, workshop.client() as client:
            answer = await client.request(method, path, json=body)
            return answer.status_code, answer.json(), workshop.router.calls

    return run(main())


def test_machines_are_listed_and_shown() -> None:
    async def main() -> None:
        async with FakeWorkshop("router", "lathe") as workshop, workshop.client() as client:
            listed = (await client.get("/api/v1/machines")).json()
            assert [MachineView.model_validate(machine).name for machine in listed] == ["router", "lathe"]
            assert (await client.get(ROUTER)).json() == listed[0]
            assert StateView.model_validate((await client.get(f"{ROUTER}/state")).json()).status == "run"

    run(main())


def test_a_machine_that_does_not_exist_names_those_that_do() -> None:
    for method, path in (("GET", ""), ("GET", "/state"), ("POST", "/estop"), ("GET", "/sd"), ("GET", "/settings")):
        status, body, _ = ask(method, f"/api/v1/machines/router2{path}")
        assert (status, body["code"]) == (404, "unknown_machine")
        assert "router." in body["detail"]


@pytest.mark.parametrize(
    "verb", ["estop", "pause", "resume", "stop", "connect", "disconnect", "home", "unlock", "reset"]
)
def test_verbs_are_handed_to_the_machine(verb: str) -> None:
    assert ask("POST", f"{ROUTER}/{verb}") == (202, {"machine": "router", "accepted": verb}, [(verb,)])


@pytest.mark.parametrize("verb", ["estop", "pause", "home"])
def test_a_refusal_is_409_with_the_reason(verb: str) -> None:
    async def main() -> None:
        async with FakeWorkshop() as workshop, workshop.client() as client:
            workshop.router.refusals[verb] = ProblemError("wrong_state", "Not now.")
            answer = await client.post(f"{ROUTER}/{verb}")
            assert (answer.status_code, answer.json()["detail"]) == (409, "Not now.")

    run(main())


def test_commands_run_in_order_with_a_result_for_each() -> None:
    status, body, calls = ask("POST", f"{ROUTER}/commands", {"blocks": ["G0 X0", "M5"]})
    assert (status, [result["block"] for result in body["results"]]) == (200, ["G0 X0", "M5"])
    assert calls == [("run_blocks", ["G0 X0", "M5"])]


@pytest.mark.parametrize(
    "blocks", [[], [""], ["G0"] * (MAX_BLOCKS + 1), ["G" * (MAX_BLOCK_CHARS + 1)], [7], "G0 X0", None]
)
def test_commands_that_are_none(blocks: Any) -> None:
    status, body, calls = ask("POST", f"{ROUTER}/commands", {"blocks": blocks})
    assert (status, body["code"], calls) == (422, "invalid_request", [])


def test_a_jog_and_its_end() -> None:
    assert ask("POST", f"{ROUTER}/jog", {"x": 1.5, "z": -2, "y": 0, "feed": 500})[2] == [
        ("jog", {"x": 1.5, "z": -2.0}, 500.0)
    ]
    assert ask("DELETE", f"{ROUTER}/jog") == (202, {"machine": "router", "accepted": "cancel_jog"}, [("cancel_jog",)])


@pytest.mark.parametrize(
    "body",
    [
        {"x": 1},
        {"feed": 500},
        {"x": 0, "feed": 500},
        {"x": 1, "feed": 0},
        {"x": 1, "feed": -5},
        {"x": 1e9, "feed": 5},
        {"x": 1, "feed": 5, "u": 3},
        {"x": "one", "feed": 5},
        {"x": True, "feed": 5},
        {"x": "1", "feed": 5},
        {"x": 1, "feed": "500"},
        [],
    ],
)
def test_jogs_that_are_none(body: Any) -> None:
    status, answer, calls = ask("POST", f"{ROUTER}/jog", body)
    assert (status, answer["code"], calls) == (422, "invalid_request", [])


def test_the_sd_card() -> None:
    status, body, _ = ask("GET", f"{ROUTER}/sd")
    assert (status, FilesView.model_validate(body).names) == (200, ["part1.nc"])
    assert ask("POST", f"{ROUTER}/sd/run", {"name": "деталь 1.nc"})[2] == [("run_file", "деталь 1.nc")]
    assert ask("POST", f"{ROUTER}/sd/run", {"name": ""})[0] == 422


def test_the_tool_is_confirmed() -> None:
    assert ask("POST", f"{ROUTER}/tool/confirm")[2] == [("confirm_tool",)]


def test_a_long_console_leaves_the_loop_to_others_in_between() -> None:
    async def main() -> list[int]:
        turns = [0]

        async def count() -> None:
            while True:
                turns[0] += 1
                await asyncio.sleep(0)

        async with FakeWorkshop() as workshop, workshop.client() as client:
            await client.get(f"{ROUTER}/console?limit=1")
            counting = asyncio.ensure_future(count())
            taken = []
            for limit in (1, PIECE_VALUES, PIECE_VALUES + 1, 1000):
                turns[0] = 0
                assert len((await client.get(f"{ROUTER}/console?limit={limit}")).json()) == limit
                taken.append(turns[0])
            counting.cancel()
        return [turns - taken[0] for turns in taken]

    assert run(main()) == [0, 0, 1, 1000 / PIECE_VALUES - 1]


def test_the_console() -> None:
    status, body, calls = ask("GET", f"{ROUTER}/console?limit=5")
    assert (status, ConsoleLine.model_validate(body[0]).direction, calls) == (200, "<", [("console", 5)])
    assert ask("GET", f"{ROUTER}/console?limit=100000")[0] == 422


def test_stops_do_not_wait_for_a_command_under_way() -> None:
    """A command by hand that lasts for minutes, and a stop over another connection of the same client."""
    import asyncio

    async def main() -> None:
        async with FakeWorkshop() as workshop, workshop.client() as client:
            never = asyncio.Event()
            workshop.router.while_jogging = never.wait
            jogging = asyncio.ensure_future(client.post(f"{ROUTER}/jog", json={"x": 1, "feed": 5}))
            await asyncio.sleep(60)
            before = asyncio.get_running_loop().time()
            assert (await client.post(f"{ROUTER}/estop")).status_code == 202
            assert asyncio.get_running_loop().time() == before
            assert not jogging.done()
            never.set()
            await jogging

    run(main())


def test_the_codes_of_the_profile() -> None:
    status, body, _ = ask("GET", f"{ROUTER}/codes")
    assert (status, body) == (200, [{"code": "G0", "text": ""}])
    assert ask("GET", "/api/v1/machines/nobody/codes")[0] == 404


def test_blocks_of_one_command_are_bounded() -> None:
    async def main() -> None:
        async with FakeWorkshop() as workshop, workshop.client() as client:
            workshop.config = FakeConfig(limits=LimitsConfig(blocks_per_command=2))
            answer = await client.post("/api/v1/machines/router/commands", json={"blocks": ["G0"] * 3})
            assert (answer.status_code, answer.json()["code"]) == (422, "too_many_blocks")
            assert "limits.blocks_per_command" in answer.json()["detail"]
            assert workshop.router.calls == []

    run(main())
