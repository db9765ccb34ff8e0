"""Applications whose signatures were read before are like any other, and have nothing of one another."""

from typing import Any, cast

import pytest
from fastapi.routing import APIRoute

from server import api
from server.api.openapi import document
from server.api.services import Services
from tests.harness.apps import create_app
from tests.harness.fakeworkshop import FakeWorkshop, bearer
from tests.harness.simloop import run_simulated as run

MADE_ANEW = {"endpoint", "dependant", "app", "dependency_overrides_provider"}
READ = ("path_params", "query_params", "header_params", "cookie_params", "body_params", "dependencies")


def routes(app: Any) -> list[APIRoute]:
    return [route for route in app.routes if isinstance(route, APIRoute)]


def workshop() -> FakeWorkshop:
    async def main() -> FakeWorkshop:
        return FakeWorkshop()

    return run(main())


def same(one: Any, other: Any) -> bool:
    """Fields of models say in their text all that they hold."""
    return one == other or repr(one) == repr(other)


def test_what_is_kept_is_what_would_be_read() -> None:
    first, again, anew = create_app(workshop()), create_app(workshop()), api.create_app(cast(Services, workshop()))
    assert document(again) == document(anew)
    assert len(routes(again)) == len(routes(anew)) > 80
    for kept, read in zip(routes(again), routes(anew), strict=True):
        assert vars(kept).keys() == vars(read).keys()
        differing = [name for name, value in vars(kept).items() if not same(value, vars(read)[name])]
        assert set(differing) <= MADE_ANEW, f"{kept.path}: {differing}"
        for name in READ:
            assert same(getattr(kept.dependant, name), getattr(read.dependant, name)), (kept.path, name)
    for kept, before in zip(routes(again), routes(first), strict=True):
        assert kept.endpoint is kept.dependant.call
        assert all(getattr(kept, name) is not getattr(before, name) for name in MADE_ANEW), kept.path


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_each_asks_its_own_workshop(order: tuple[int, int]) -> None:
    async def main() -> list[list[str]]:
        async with FakeWorkshop() as one, FakeWorkshop() as other:
            workshops = (one, other)
            clients = [each.client() for each in workshops]
            signed = [bearer(await each.token("operator")) for each in workshops]
            for number in order:
                answer = await clients[number].post("/api/v1/machines/router/home", headers=signed[number])
                assert answer.status_code == 202
            assert [each.app().state.leases.holder("router") for each in workshops] == [None, None]
            return [each.router.names() for each in workshops]

    assert run(main()) == [["home"], ["home"]]
