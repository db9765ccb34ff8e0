import pytest

from server.api.capabilities import ADDRESSES
from tests.harness.fakeworkshop import FakeWorkshop
from tests.harness.simloop import run_simulated as run


@pytest.mark.parametrize(("method", "name"), [(method, name) for method, name, _, _ in ADDRESSES])
def test_what_this_controller_cannot_do_is_said(method: str, name: str) -> None:
    async def main() -> None:
        async with FakeWorkshop() as workshop, workshop.client() as client:
            answer = await client.request(method, f"/api/v1/machines/router/{name}", json={})
            assert (answer.status_code, answer.json()["code"]) == (409, "not_supported")
            assert answer.json()["capability"] == name
            assert "elvinto" in answer.json()["detail"]

    run(main())
