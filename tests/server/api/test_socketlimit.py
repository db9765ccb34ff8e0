"""WebSockets of one address and in all."""

import contextlib

from server.api.socketlimit import SocketLimit
from server.config.limits import LimitsConfig
from server.problems import ProblemError
from tests.harness.asgisocket import AsgiSocket
from tests.harness.fakeworkshop import FakeConfig, FakeWorkshop
from tests.harness.simloop import run_simulated

LIMITS = LimitsConfig(sockets=3, sockets_per_address=2)


def code(limit: SocketLimit, address: str) -> str | None:
    try:
        with limit.one(address):
            return None
    except ProblemError as problem:
        return problem.code


def test_of_one_address_and_in_all() -> None:
    limit = SocketLimit(lambda: LIMITS)
    with contextlib.ExitStack() as stack:
        for address in ("a", "a", "b"):
            assert code(limit, address) is None
            stack.enter_context(limit.one(address))
        assert code(limit, "a") == code(limit, "b") == code(limit, "c") == "too_many_sockets"
    assert limit.refused == {"sockets_per_address": 1, "sockets": 2}
    assert code(limit, "a") is None
    assert not limit._open, "nothing is kept of who has gone"


def test_the_one_too_many_is_refused_and_the_next_is_not() -> None:
    async def main() -> None:
        async with FakeWorkshop() as workshop:
            workshop.config = FakeConfig(limits=LIMITS)
            app = workshop.app()
            async with AsgiSocket(app), AsgiSocket(app), AsgiSocket(app) as third:
                assert (third.status, third.problem["code"]) == (429, "too_many_sockets")
                assert "limits.sockets_per_address" in third.problem["detail"]
            async with AsgiSocket(app) as again:
                assert again.status is None

    run_simulated(main())
