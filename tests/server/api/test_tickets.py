"""A WebSocket opened with a ticket: whose it is, what it is not good for, and where it does not stand."""

import logging

import pytest

from server.api.guard import take_ticket
from tests.harness.asgisocket import AsgiSocket
from tests.harness.fakeworkshop import FakeServerSettings, FakeWorkshop, bearer
from tests.harness.simloop import run_simulated as run

TICKET = "/api/v1/ticket"
ON_THE_LAN = FakeServerSettings(host="0.0.0.0")


def test_a_ticket_opens_one_socket_with_the_role_of_who_asked() -> None:
    async def main() -> None:
        async with FakeWorkshop(settings=ON_THE_LAN) as workshop, workshop.client() as client:
            app = workshop.app()
            assert (await client.post(TICKET)).status_code == 401
            answer = await client.post(TICKET, headers=bearer(await workshop.token("operator")))
            query = {"ticket": answer.json()["ticket"], "topics": "job"}
            async with AsgiSocket(app, query=query, headers={"origin": "http://evil.example"}) as socket:
                assert socket.problem["code"] == "bad_origin", "and it is not used up by that"
            async with AsgiSocket(app, query=query) as socket:
                assert (await socket.hear())["data"]["role"] == "operator"
                assert (await socket.ask({"type": "pause", "machine": "router"}))["ok"]
            async with AsgiSocket(app, query=query) as socket:
                assert (socket.status, socket.problem["code"]) == (401, "unauthorized")

    run(main())


def test_it_is_good_for_nothing_else_and_ends_with_the_token_behind_it() -> None:
    async def main() -> None:
        async with FakeWorkshop(settings=ON_THE_LAN) as workshop, workshop.client() as client:
            made = await workshop.tokens.create("guest", "admin")
            ticket = (await client.post(TICKET, headers=bearer(made["token"]))).json()["ticket"]
            assert (await client.get("/api/v1/machines", params={"ticket": ticket})).status_code == 401
            assert (await client.get("/api/v1/machines", headers=bearer(ticket))).status_code == 401
            await workshop.tokens.revoke(made["id"])
            async with AsgiSocket(workshop.app(), query={"ticket": ticket}) as socket:
                assert socket.status == 401

    run(main())


def test_it_is_in_no_log_and_in_no_row(caplog: pytest.LogCaptureFixture) -> None:
    async def main() -> str:
        async with FakeWorkshop(settings=ON_THE_LAN) as workshop, workshop.client() as client:
            ticket = (await client.post(TICKET, headers=bearer(await workshop.token("admin")))).json()["ticket"]
            async with AsgiSocket(workshop.app(), query={"ticket": ticket}) as socket:
                await socket.ask({"type": "pause", "machine": "router"})
            assert ticket not in "\n".join(workshop.database.db.conn.iterdump())
            return str(ticket)

    with caplog.at_level(logging.DEBUG):
        ticket = run(main())
    assert ticket not in caplog.text


def test_it_is_taken_out_of_the_address() -> None:
    scope = {"query_string": b"topics=state%2Cjob&ticket=secret&since=5&ticket=another"}
    assert take_ticket(scope) == "secret"
    assert scope["query_string"] == b"topics=state%2Cjob&since=5"
    assert take_ticket(scope) is None
