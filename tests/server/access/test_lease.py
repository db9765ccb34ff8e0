"""Who may move a machine by hand: between two clients, and never in the way of one."""

import asyncio
import contextlib
from typing import Any

import pytest

from server.access.lease import LEASE_S, Client, Leases
from server.problems import ProblemError
from tests.harness.simloop import run_simulated

ANNA, BERT = Client(("t1", "session a"), "Anna", "10.0.0.1"), Client(("t2", "session b"), "Bert", "10.0.0.2")
AT = "2026-03-01T09:30:00.000Z"
VIEW = {"name": "Anna", "client": "10.0.0.1", "since": AT}


class Shown:
    def __init__(self) -> None:
        self.told: list[tuple[str, dict[str, Any] | None]] = []
        self.leases = Leases(lambda machine, holder: self.told.append((machine, holder)), lambda: AT)

    def names(self) -> list[str | None]:
        return [None if holder is None else holder["name"] for _, holder in self.told]


def refused(leases: Leases, client: Client) -> bool:
    try:
        leases.take("router", client)
    except ProblemError as problem:
        return problem.code == "control_held"
    return False


def test_the_refusal_says_who_has_it_and_how_to_take_it_over() -> None:
    async def main() -> None:
        leases = Shown().leases
        leases.take("router", ANNA)
        with pytest.raises(ProblemError) as refusal:
            leases.take("router", BERT)
        assert "Anna (10.0.0.1)" in refusal.value.detail
        assert 'POST /api/v1/machines/router/control {"takeover": true}' in refusal.value.detail
        assert refusal.value.extra == {"holder": VIEW}

    run_simulated(main())


def test_the_first_has_it_and_loses_it_by_silence() -> None:
    async def main() -> None:
        shown = Shown()
        shown.leases.take("router", ANNA)
        assert shown.told == [("router", VIEW)]
        await asyncio.sleep(LEASE_S - 1)
        assert refused(shown.leases, BERT)
        shown.leases.take("router", ANNA)
        await asyncio.sleep(LEASE_S - 1)
        assert refused(shown.leases, BERT)
        shown.leases.take("lathe", BERT)
        await asyncio.sleep(2)
        assert not refused(shown.leases, BERT)
        assert shown.names() == ["Anna", "Bert", None, "Bert"], "renewing is no news"

    run_simulated(main())


def test_it_is_taken_over_openly() -> None:
    async def main() -> None:
        shown = Shown()
        shown.leases.take("router", ANNA)
        assert shown.leases.take("router", BERT, takeover=True) == ANNA
        assert shown.leases.take("router", BERT, takeover=True) is None, "it is his already"
        assert shown.names() == ["Anna", "Bert"]
        with pytest.raises(ProblemError):
            shown.leases.release("router", ANNA)
        shown.leases.release("router", BERT)
        shown.leases.release("router", BERT)
        assert shown.names() == ["Anna", "Bert", None]
        await asyncio.sleep(2 * LEASE_S)
        assert len(shown.told) == 3

    run_simulated(main())


def test_while_a_block_is_executed_nobody_has_fallen_silent() -> None:
    async def main() -> None:
        shown = Shown()
        with shown.leases.use("router", ANNA):
            await asyncio.sleep(10 * LEASE_S)
            assert refused(shown.leases, BERT)
        await asyncio.sleep(LEASE_S - 1)
        assert refused(shown.leases, BERT)
        await asyncio.sleep(2)
        assert not refused(shown.leases, BERT)

    run_simulated(main())


def test_what_the_machine_refuses_takes_nothing() -> None:
    async def main() -> None:
        shown = Shown()
        with pytest.raises(ProblemError), shown.leases.use("router", BERT):
            raise ProblemError("alarm_active", "No.")
        assert shown.leases.holder("router") is None
        shown.leases.take("router", ANNA)
        with pytest.raises(ProblemError), shown.leases.use("router", ANNA):
            raise ProblemError("alarm_active", "No.")
        assert refused(shown.leases, BERT), "she had it before"

    run_simulated(main())


def test_a_use_that_ends_after_a_takeover_changes_nothing() -> None:
    async def main() -> None:
        shown = Shown()
        with shown.leases.use("router", ANNA):
            shown.leases.take("router", BERT, takeover=True)
        assert shown.leases.has("router", BERT)
        shown.leases.release("router", BERT)
        with contextlib.suppress(ZeroDivisionError), shown.leases.use("router", ANNA):
            shown.leases.take("router", BERT, takeover=True)
            raise ZeroDivisionError
        assert shown.leases.has("router", BERT)

    run_simulated(main())


def test_with_its_last_socket_a_client_is_gone() -> None:
    async def main() -> None:
        shown = Shown()
        for _ in range(2):
            shown.leases.socket_opened(ANNA)
        shown.leases.take("router", ANNA)
        shown.leases.take("lathe", ANNA)
        with shown.leases.use("lathe", ANNA):
            shown.leases.socket_closed(ANNA)
            assert refused(shown.leases, BERT)
            shown.leases.socket_closed(ANNA)
            assert shown.leases.has("lathe", ANNA), "its block is still being executed"
        assert not refused(shown.leases, BERT)

    run_simulated(main())
