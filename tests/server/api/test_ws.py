"""The WebSocket, spoken to over ASGI in simulated time."""

import asyncio
import contextlib
from collections.abc import AsyncIterator
from typing import Any

import pytest

from server.api.machinemodels import MachineView
from server.api.models import JobView
from server.api.ws import MAX_MESSAGE_CHARS, MAX_UNDER_WAY
from server.live.hub import REPLAY_LIMIT
from server.live.subscription import QUEUE_LIMIT
from server.machine.heldjog import HEARTBEAT_S
from server.problems import ProblemError
from tests.harness.asgisocket import AsgiSocket
from tests.harness.fakeworkshop import FIRST_SEQ, FakeWorkshop, bearer, settle
from tests.harness.simloop import run_simulated as run


@contextlib.asynccontextmanager
async def connected(
    workshop: FakeWorkshop, *, role: str | None = None, greet: bool = True, **query: Any
) -> AsyncIterator[AsgiSocket]:
    """A reader; its `hello` is read away unless `greet` is False."""
    headers = bearer(await workshop.token(role)) if role is not None else {}
    async with AsgiSocket(workshop.app(), query=query, headers=headers) as socket:
        if greet:
            assert (await socket.hear())["type"] == "hello"
        yield socket


# --- what comes -----------------------------------------------------------------------------------------------


def test_hello_is_first_and_shows_everything() -> None:
    async def main() -> None:
        async with FakeWorkshop("router", "lathe") as workshop, connected(workshop, greet=False) as socket:
            workshop.hub.publish("job", "router", {"id": 1})
            hello = await socket.hear()
            assert hello["type"] == "hello"
            assert hello["seq"] == FIRST_SEQ
            assert set(hello) == {"seq", "type", "machine", "at", "data"}
            assert [MachineView.model_validate(one).name for one in hello["data"]["machines"]] == ["router", "lathe"]
            assert [JobView.model_validate(one).id for one in hello["data"]["jobs"]] == [17]
            waiting = [{"id": 18, "program_name": "part.nc", "hold": True}]
            assert hello["data"]["queues"] == {"router": waiting, "lathe": waiting}
            assert hello["data"]["resync"] is False
            assert hello["data"]["role"] == "admin"
            assert (await socket.hear())["seq"] == FIRST_SEQ + 1

    run(main())


def test_what_happens_while_the_snapshot_is_made_is_not_lost() -> None:
    async def main() -> None:
        async with FakeWorkshop() as workshop:
            listing = workshop.jobs.list

            async def slow(*arguments: Any) -> Any:
                workshop.hub.publish("job", "router", {"id": 99})
                await asyncio.sleep(1)
                return await listing(*arguments)

            workshop.jobs.list = slow  # type: ignore[method-assign]
            async with connected(workshop) as socket:
                assert (await socket.hear())["data"] == {"id": 99}

    run(main())


def test_a_database_that_cannot_answer_takes_the_live_state_from_nobody() -> None:
    async def main() -> None:
        async with FakeWorkshop() as workshop:
            workshop.jobs.refusals["list"] = ProblemError("disk_full", "The disk is full.")
            async with connected(workshop, greet=False) as socket:
                data = (await socket.hear())["data"]
                assert (len(data["machines"]), data["jobs"], data["problem"]["code"]) == (1, [], "disk_full")
                assert (await socket.ask({"type": "estop"}))["ok"]

    run(main())


def test_an_error_of_ours_in_the_snapshot_closes_the_connection_and_says_so() -> None:
    async def main() -> None:
        async with FakeWorkshop() as workshop:
            workshop.jobs.refusals["list"] = RuntimeError("secret of the house")
            async with connected(workshop, greet=False) as socket:
                assert await socket.hear() is None
                assert socket.closed == (1011, "internal error")
            assert workshop.hub.readers == 0

    run(main())


def test_events_come_as_they_happen() -> None:
    async def main() -> None:
        async with FakeWorkshop() as workshop, connected(workshop) as socket:
            for topic in ("job", "queue", "console", "alarm", "tool", "io", "program", "log"):
                workshop.hub.publish(topic, "router", {"of": topic})
                heard = await socket.hear()
                assert (heard["type"], heard["machine"], heard["data"]) == (topic, "router", {"of": topic})

    run(main())


def test_the_query_narrows_what_comes() -> None:
    async def main() -> None:
        async with FakeWorkshop() as workshop, connected(workshop, topics="alarm,tool", machines="router") as socket:
            workshop.hub.publish("job", "router", {})
            workshop.hub.publish("alarm", "lathe", {})
            workshop.hub.publish("tool", "router", {"tool": 3})
            assert (await socket.hear())["data"] == {"tool": 3}

    run(main())


def test_the_rate_of_states_is_kept() -> None:
    async def main() -> None:
        async with FakeWorkshop() as workshop, connected(workshop, rate=5) as socket:
            for number in range(1000):
                workshop.hub.publish("state", "router", {"n": number})
                await asyncio.sleep(0.001)
            await asyncio.sleep(1)
            assert socket.unheard() in (6, 7)
            heard = [(await socket.hear())["data"]["n"] for _ in range(socket.unheard())]
            assert heard[-1] == 999

    run(main())


@pytest.mark.parametrize(
    "query",
    [
        {"topics": "nonsense"},
        {"rate": 0},
        {"rate": "fast"},
        {"rate": "nan"},
        {"rate": 1000},
        {"since": -1},
        {"since": "x"},
        {"machines": "NO"},
        {"sinec": 5},
    ],
)
def test_a_query_that_is_none_is_refused_with_a_problem(query: dict[str, Any]) -> None:
    async def main() -> None:
        async with FakeWorkshop() as workshop, AsgiSocket(workshop.app(), query=query) as socket:
            assert (socket.status, socket.problem["code"]) == (422, "invalid_request")
            assert workshop.hub.readers == 0

    run(main())


# --- coming back ----------------------------------------------------------------------------------------------


def test_since_replays_what_was_missed() -> None:
    async def main() -> None:
        async with FakeWorkshop() as workshop:
            seen = workshop.hub.publish("job", "router", {"n": 1})
            for number in (2, 3):
                workshop.hub.publish("job", "router", {"n": number})
                workshop.hub.publish("state", "router", {})
            async with connected(workshop, since=seen, greet=False) as socket:
                hello = await socket.hear()
                assert (hello["data"]["resync"], hello["seq"]) == (False, seen)
                workshop.hub.publish("job", "router", {"n": 4})
                assert [(await socket.hear())["data"]["n"] for _ in range(3)] == [2, 3, 4]

    run(main())


def test_a_connection_that_breaks_in_the_replay_can_begin_it_again() -> None:
    """The largest `seq` a reader has seen is always enough to go on from."""

    async def main() -> None:
        async with FakeWorkshop() as workshop:
            first = workshop.hub.seq
            expected = [workshop.hub.publish("job", "router", {}) for _ in range(50)]
            heard: list[int] = []
            since = first
            while len(heard) < 50:
                async with connected(workshop, since=since, greet=False) as socket:
                    since = max(since, (await socket.hear())["seq"])
                    for _ in range(7):
                        if len(heard) < 50:
                            heard.append((await socket.hear())["seq"])
                            since = max(since, heard[-1])
            assert heard == expected

    run(main())


@pytest.mark.parametrize("since", [0, FIRST_SEQ - 1, FIRST_SEQ + REPLAY_LIMIT + 1000])
def test_what_is_not_known_any_more_is_a_resync(since: int) -> None:
    async def main() -> None:
        async with FakeWorkshop() as workshop:
            for _ in range(3):
                workshop.hub.publish("job", "router", {})
            async with connected(workshop, since=since, greet=False) as socket:
                hello = await socket.hear()
                assert (hello["type"], hello["data"]["resync"], hello["seq"]) == ("hello", True, workshop.hub.seq)
                assert hello["data"]["machines"]
                await settle()
                assert socket.unheard() == 0

    run(main())


# --- a reader that does not read ------------------------------------------------------------------------------


def test_a_reader_that_does_not_read_is_disconnected_and_slows_nobody() -> None:
    async def main() -> None:
        async with FakeWorkshop() as workshop, connected(workshop) as good, connected(workshop) as stuck:
            loop = asyncio.get_running_loop()
            stuck.reading.clear()
            begin = loop.time()
            for number in range(QUEUE_LIMIT + 10):
                workshop.hub.publish("job", "router", {"n": number})
                assert (await good.hear())["data"]["n"] == number
            assert loop.time() == begin
            await asyncio.sleep(2)
            assert workshop.hub.readers == 1
            assert workshop.hub.cut_readers == 1
            assert stuck.ended

    run(main())


def test_a_slow_reader_that_comes_back_misses_nothing() -> None:
    async def main() -> None:
        async with FakeWorkshop() as workshop:
            async with connected(workshop) as stuck:
                stuck.reading.clear()
                since = workshop.hub.seq
                expected = [workshop.hub.publish("job", "router", {}) for _ in range(QUEUE_LIMIT + 10)]
                await asyncio.sleep(2)
            async with connected(workshop, since=since) as again:
                assert [(await again.hear())["seq"] for _ in expected] == expected

    run(main())


def test_states_alone_never_cut_a_reader() -> None:
    async def main() -> None:
        async with FakeWorkshop() as workshop, connected(workshop) as slow:
            slow.reading.clear()
            for number in range(QUEUE_LIMIT * 3):
                workshop.hub.publish("state", "router", {"n": number})
                if number % 100 == 0:
                    await asyncio.sleep(0.01)
            await asyncio.sleep(60)
            assert not slow.ended
            slow.reading.set()
            states = [(await slow.hear())["data"]["n"]]
            with contextlib.suppress(TimeoutError):
                while True:
                    states.append((await slow.hear())["data"]["n"])
            assert states[-1] == QUEUE_LIMIT * 3 - 1
            assert len(states) <= 2

    run(main())


def test_a_revoked_token_ends_the_connection_at_the_next_message() -> None:
    async def main() -> None:
        async with FakeWorkshop() as workshop:
            made = await workshop.tokens.create("screen", "operator")
            await workshop.token("admin")
            async with AsgiSocket(workshop.app(), headers=bearer(made["token"])) as socket:
                await socket.hear()
                await workshop.tokens.revoke(made["id"])
                workshop.hub.publish("job", "router", {"secret": True})
                assert await socket.hear() is None
                assert socket.closed is not None
                assert socket.closed[0] == 1008

    run(main())


def test_a_revoked_token_stops_no_machine_over_an_old_connection() -> None:
    async def main() -> None:
        async with FakeWorkshop() as workshop:
            made = await workshop.tokens.create("screen", "operator")
            await workshop.token("admin")
            async with AsgiSocket(workshop.app(), headers=bearer(made["token"])) as socket:
                await socket.hear()
                await workshop.tokens.revoke(made["id"])
                await socket.say({"type": "estop", "id": 1})
                assert await socket.hear() is None
                assert workshop.router.calls == []

    run(main())


# --- what is said ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("verb", ["pause", "resume", "stop", "estop"])
def test_verbs_are_answered_with_a_result(verb: str) -> None:
    async def main() -> None:
        async with FakeWorkshop() as workshop, connected(workshop) as socket:
            for message in ({"type": verb, "id": "a1"}, {"type": verb, "id": 7, "machine": "router"}):
                assert await socket.ask(message) == {"type": "result", "id": message["id"], "ok": True}
            assert workshop.router.names() == [verb, verb]

    run(main())


def test_a_refusal_is_the_result() -> None:
    async def main() -> None:
        async with FakeWorkshop() as workshop, connected(workshop) as socket:
            workshop.router.refusals["pause"] = ProblemError("wrong_state", "No job runs.")
            result = await socket.ask({"type": "pause", "id": 1})
            assert (result["ok"], result["error"]["code"], result["error"]["status"]) == (False, "wrong_state", 409)

    run(main())


def test_estop_without_a_name_is_for_all_and_one_refusal_spares_none() -> None:
    async def main() -> None:
        async with FakeWorkshop("one", "two", "three") as workshop, connected(workshop) as socket:
            workshop.machines["one"].refusals["estop"] = ProblemError("not_connected", "one is away.")
            result = await socket.ask({"type": "estop", "id": 1})
            assert [machine.names() for machine in workshop.machines.values()] == [["estop"]] * 3
            assert (result["ok"], result["error"]["refused"], result["error"]["machines"]) == (False, 1, 3)
            workshop.machines["one"].refusals["estop"] = RuntimeError("a fault of ours")
            assert (await socket.ask({"type": "estop"}))["error"]["code"] == "internal"
            assert [machine.names() for machine in workshop.machines.values()] == [["estop"] * 2] * 3
            await socket.ask({"type": "estop", "machine": "two"})
            assert workshop.machines["two"].names() == ["estop"] * 3

    run(main())


@pytest.mark.parametrize("verb", ["pause", "resume", "stop", "jog_stop"])
def test_with_several_machines_one_must_be_named(verb: str) -> None:
    async def main() -> None:
        async with FakeWorkshop("one", "two") as workshop, connected(workshop) as socket:
            result = await socket.ask({"type": verb, "id": 1})
            assert result["error"]["code"] == "invalid_request"
            assert "one, two" in result["error"]["detail"]
            result = await socket.ask({"type": verb, "machine": "three"})
            assert result["error"]["code"] == "unknown_machine"
            assert not any(machine.calls for machine in workshop.machines.values())

    run(main())


def test_estop_never_waits_behind_other_messages() -> None:
    async def main() -> None:
        async with FakeWorkshop() as workshop, connected(workshop) as socket:
            never = asyncio.Event()
            workshop.router.while_jogging = never.wait
            for number in range(MAX_UNDER_WAY):
                await socket.say({"type": "jog", "x": 1, "feed": 100, "id": number})
            before = asyncio.get_running_loop().time()
            assert (await socket.ask({"type": "estop", "id": "stop"}))["id"] == "stop"
            assert asyncio.get_running_loop().time() == before
            refused = await socket.ask({"type": "jog", "x": 1, "feed": 100})
            assert refused["error"]["code"] == "machine_busy", "what waits for the machine is bounded"

    run(main())


@pytest.mark.parametrize(
    "message",
    [
        "nonsense",
        "[]",
        "7",
        "[" * 5000,
        {"type": "fly"},
        {},
        {"type": "pause", "machine": "../x"},
        {"type": "pause", "mashine": "router"},
        {"type": "jog", "x": 1},
        {"type": "jog", "feed": 100},
        {"type": "jog", "x": 0, "feed": 100, "hold": True},
        {"type": "jog", "x": True, "feed": 100},
        {"type": "jog", "x": 1, "feed": 100, "hold": "yes"},
        {"type": "subscribe", "topics": ["nonsense"]},
        {"type": "subscribe", "rate": 0},
        '{"type": "jog", "x": NaN, "feed": 100}',
        '{"type": "jog", "x": 1, "feed": 1e999}',
    ],
)
def test_messages_that_are_none_are_answered_and_do_nothing(message: Any) -> None:
    async def main() -> None:
        async with FakeWorkshop() as workshop, connected(workshop) as socket:
            await socket.say(message if isinstance(message, str) else {**message, "id": 5})
            result = await socket.hear_type("result")
            assert result["ok"] is False
            assert result["error"]["code"] in ("malformed_json", "invalid_request")
            if isinstance(message, dict):
                assert result["id"] == 5
            assert workshop.router.calls == []
            assert (await socket.ask({"type": "pause"}))["ok"], "and the connection goes on"

    run(main())


def test_an_id_that_is_none_is_not_echoed() -> None:
    async def main() -> None:
        async with FakeWorkshop() as workshop, connected(workshop) as socket:
            for bad in ({"a": 1}, "x" * 129, [1], 1.5):
                result = await socket.ask({"type": "pause", "id": bad})
                assert (result["ok"], result["id"]) == (False, None)

    run(main())


def test_a_message_that_is_too_long_ends_the_connection() -> None:
    async def main() -> None:
        async with FakeWorkshop() as workshop, connected(workshop) as socket:
            await socket.say(" " * (MAX_MESSAGE_CHARS + 1))
            assert await socket.hear() is None
            assert socket.closed is not None
            assert socket.closed[0] == 1009
            assert workshop.router.calls == []

    run(main())


@pytest.mark.parametrize(
    "message", [{"type": "estop"}, {"type": "pause"}, {"type": "jog", "x": 1, "feed": 100}, {"type": "jog_stop"}]
)
def test_a_viewer_may_look_and_choose_what_comes_but_move_nothing(message: dict[str, Any]) -> None:
    async def main() -> None:
        async with FakeWorkshop() as workshop, connected(workshop, role="viewer") as socket:
            assert (await socket.ask(message))["error"]["code"] == "forbidden"
            assert workshop.router.calls == []
            assert (await socket.ask({"type": "subscribe", "topics": ["job"]}))["ok"]

    run(main())


def test_subscribing_changes_only_what_is_named() -> None:
    async def main() -> None:
        async with FakeWorkshop() as workshop, connected(workshop, topics="job,alarm", rate=5) as socket:
            assert (await socket.ask({"type": "subscribe", "machines": ["lathe"]}))["ok"]
            workshop.hub.publish("job", "router", {})
            workshop.hub.publish("tool", "lathe", {})
            workshop.hub.publish("alarm", "lathe", {"mine": True})
            assert (await socket.hear())["data"] == {"mine": True}

    run(main())


def test_an_error_of_ours_is_an_answer_too() -> None:
    async def main() -> None:
        async with FakeWorkshop() as workshop, connected(workshop) as socket:
            workshop.router.refusals["jog"] = RuntimeError("secret of the house")
            result = await socket.ask({"type": "jog", "x": 1, "feed": 100, "id": 3})
            assert (result["id"], result["error"]["code"]) == (3, "internal")
            assert "secret" not in str(result)
            workshop.router.refusals["pause"] = RuntimeError("secret of the house")
            result = await socket.ask({"type": "pause", "id": 4})
            assert (result["id"], result["error"]["code"]) == (4, "internal")

    run(main())


# --- jogs -----------------------------------------------------------------------------------------------------


def test_a_jog_by_a_distance() -> None:
    async def main() -> None:
        async with FakeWorkshop() as workshop, connected(workshop) as socket:
            result = await socket.ask({"type": "jog", "machine": "router", "x": 1, "y": -2, "feed": 600, "id": 1})
            assert result == {"type": "result", "id": 1, "ok": True}
            assert workshop.router.calls == [("jog", {"x": 1.0, "y": -2.0}, 600.0)]

    run(main())


HELD = {"type": "jog", "machine": "router", "x": 1, "feed": 600, "hold": True}


def test_a_held_jog_lives_from_its_repetition() -> None:
    async def main() -> None:
        async with FakeWorkshop() as workshop, connected(workshop) as socket:
            for _ in range(10):
                assert (await socket.ask(HELD))["ok"]
                await asyncio.sleep(0.1)
            await asyncio.sleep(HEARTBEAT_S)
            calls = len(workshop.router.calls)
            assert workshop.router.names()[-1] == "cancel_jog"
            assert workshop.router.names().count("jog") >= 6
            await asyncio.sleep(10)
            assert len(workshop.router.calls) == calls

    run(main())


def test_a_held_jog_ends_with_its_key() -> None:
    async def main() -> None:
        async with FakeWorkshop() as workshop, connected(workshop) as socket:
            await socket.ask(HELD)
            await socket.ask({"type": "jog_stop", "machine": "router"})
            assert workshop.router.names() == ["jog", "cancel_jog"]
            await asyncio.sleep(1)
            assert workshop.router.names() == ["jog", "cancel_jog"]

    run(main())


def test_a_held_jog_ends_with_its_socket() -> None:
    async def main() -> None:
        async with FakeWorkshop() as workshop:
            async with connected(workshop) as socket:
                await socket.ask(HELD)
            assert workshop.router.names() == ["jog", "cancel_jog"]
            await asyncio.sleep(1)
            assert workshop.router.names() == ["jog", "cancel_jog"]

    run(main())


def test_a_held_jog_of_a_reader_that_is_cut_ends_too() -> None:
    async def main() -> None:
        async with FakeWorkshop() as workshop, connected(workshop) as socket:
            await socket.ask(HELD)
            socket.reading.clear()
            for _ in range(QUEUE_LIMIT + 10):
                workshop.hub.publish("job", "router", {})
            await asyncio.sleep(2)
            assert workshop.router.names()[-1] == "cancel_jog"

    run(main())
