"""What of requests and messages goes into the audit, and how it is read again."""

import csv
from typing import Any

import pytest

from server.access.audit import Wanted
from server.access.ratelimit import BURST
from server.api.accessmodels import AuditView
from server.api.audit import CSV_COLUMNS, as_csv
from server.problems import ProblemError
from tests.harness.asgisocket import AsgiSocket
from tests.harness.fakeworkshop import FakeServerSettings, FakeWorkshop, bearer
from tests.harness.simloop import run_simulated as run

AUDIT = "/api/v1/audit"
ON_THE_LAN = FakeServerSettings(host="0.0.0.0")
JOG = {"type": "jog", "x": 1, "feed": 600}


async def rows(workshop: FakeWorkshop, **wanted: Any) -> list[dict[str, Any]]:
    """What was kept, the oldest first."""
    found = await workshop.audit.find(Wanted(**wanted), None, 100)
    assert [AuditView.model_validate(row).id for row in found] == [row["id"] for row in found]
    return found[::-1]


def short(row: dict[str, Any]) -> tuple[Any, ...]:
    return (row["name"], row["via"], row["method"], row["route"], row["machine"], row["status"], row["code"])


def test_a_row_for_each_request_that_changes_something_with_its_outcome() -> None:
    async def main() -> None:
        async with FakeWorkshop(settings=ON_THE_LAN) as workshop, workshop.client() as client:
            client.headers.update(bearer(await workshop.token("operator")))
            workshop.router.refusals["unlock"] = ProblemError("wrong_state", "No.")
            home, unlock = "/api/v1/machines/{m}/home", "/api/v1/machines/{m}/unlock"
            await client.get("/api/v1/machines")
            await client.post(home.replace("{m}", "router"))
            await client.post(unlock.replace("{m}", "router"))
            await client.post("/api/v1/tokens", content=b"{nonsense")
            await client.post("/api/v1/machines/router/jog", json={"x": "far"})
            await client.post("/api/v1/nowhere")
            await client.put(home.replace("{m}", "router"))
            who = ("a operator", "bearer", "POST")
            assert [short(row) for row in await rows(workshop)] == [
                (*who, home, "router", 202, None),
                (*who, unlock, "router", 409, "wrong_state"),
                (*who, "/api/v1/tokens", None, 403, "forbidden"),
                (*who, "/api/v1/machines/{m}/jog", "router", 422, "invalid_request"),
            ]
            first = (await rows(workshop, code="wrong_state"))[0]
            assert (first["address"], first["token"]) == ("127.0.0.1", (await workshop.tokens.list())[0]["id"])

    run(main())


def test_no_way_to_write_a_number_keeps_a_request_out_of_it() -> None:
    async def main() -> None:
        async with FakeWorkshop() as workshop, workshop.client() as client:
            for id_ in ("7", "007", "0" * 5000 + "7", "9" * 5000, "-1", "\u0667"):
                await client.post(f"/api/v1/jobs/{id_}/pause")
            assert [row["job"] for row in await rows(workshop)] == [7, 7, 7, None, None, None]

    run(main())


def test_what_was_made_is_named() -> None:
    async def main() -> None:
        async with FakeWorkshop() as workshop, workshop.client() as client:
            await client.post("/api/v1/jobs", json={"program": "0" * 64, "machine": "router"})
            await client.post("/api/v1/jobs/99/cancel")
            await client.post("/api/v1/jobs/99999999999999999999999999/cancel")
            uploaded = await client.post("/api/v1/programs?name=a.nc", content=b"G0 X0")
            made = await client.post("/api/v1/tokens", json={"name": "x", "role": "viewer"})
            found = await rows(workshop)
            assert [row["job"] for row in found] == [17, 99, None, None, None]
            assert [row["target"] for row in found[-2:]] == [uploaded.json()["id"], made.json()["id"]]
            assert {row["via"] for row in found} == {"local"}

    run(main())


def test_no_secret_is_in_it() -> None:
    async def main() -> None:
        async with FakeWorkshop(settings=ON_THE_LAN) as workshop, workshop.client() as client:
            secret = await workshop.token("admin")
            await client.post("/api/v1/session", json={"token": secret})
            made = await client.post(f"/api/v1/tokens?x={secret}", json={"name": "x", "role": "viewer"})
            cookie = client.cookies["millstream_session"]
            client.cookies.clear()
            await client.post("/api/v1/session", json={"token": "mill_wrong"})
            dump = "\n".join(line for line in workshop.database.db.conn.iterdump() if '"audit"' in line)
            assert len(dump.splitlines()) >= 3
            for word in (secret, made.json()["token"], "mill_wrong", cookie):
                assert word not in dump
            found = await rows(workshop)
            assert [(row["name"], row["via"], row["code"]) for row in found] == [
                ("a admin", "bearer", None),
                ("a admin", "session", None),
                ("nobody", "nobody", "unauthorized"),
            ]

    run(main())


def test_strangers_cannot_fill_it() -> None:
    async def main() -> None:
        async with FakeWorkshop(settings=ON_THE_LAN) as workshop, workshop.client() as client:
            for number in range(5 * BURST):
                await client.post("/api/v1/machines/router/home")
                await client.post("/api/v1/machines/router/home", headers=bearer(f"guess {number}"))
            assert len(await rows(workshop)) == BURST

    run(main())


def test_messages_of_a_socket_a_hold_is_one_row() -> None:
    async def main() -> None:
        async with FakeWorkshop() as workshop, AsgiSocket(workshop.app()) as socket:
            await socket.ask({"type": "subscribe", "topics": ["job"]})
            await socket.ask({"type": "pause", "machine": "router"})
            workshop.router.refusals["stop"] = ProblemError("wrong_state", "No.")
            await socket.ask({"type": "stop", "machine": "router"})
            for _ in range(5):
                await socket.ask({**JOG, "hold": True})
            await socket.ask({"type": "jog_stop"})
            await socket.ask(JOG)
            await socket.ask({"type": "estop"})
            await socket.say("{nonsense")
            await socket.disconnect()
            found = [(row["route"], row["machine"], row["status"], row["code"]) for row in await rows(workshop)]
            assert found == [
                ("pause", "router", 200, None),
                ("stop", "router", 409, "wrong_state"),
                ("jog", None, 200, None),
                ("jog_stop", None, 200, None),
                ("jog", None, 200, None),
                ("estop", None, 200, None),
            ]

    run(main())


def test_a_stop_does_not_wait_for_the_audit() -> None:
    async def main() -> None:
        async with FakeWorkshop() as workshop, workshop.client() as client:
            seen = []

            def note(entry: Any) -> None:
                seen.append((entry.route, workshop.router.names()))

            workshop.audit.note = note  # type: ignore[method-assign]
            await client.post("/api/v1/machines/router/estop")
            assert seen == [("/api/v1/machines/{m}/estop", ["estop"])]

    run(main())


@pytest.mark.parametrize("value", ["=1", "＝1", "＋1", "－1", "＠A1", " =1", "\t=1", "\tx", "\rx", "\n=1", "\u200b＝1"])
def test_no_cell_begins_a_formula_however_it_is_written(value: str) -> None:
    rows = [dict.fromkeys(CSV_COLUMNS, value)]
    (row,) = csv.DictReader(as_csv(rows).splitlines())
    assert row["name"].startswith("'")
    assert not set(row["name"]) & set("\t\r\n\u200b")


@pytest.mark.parametrize("name", ["=HYPERLINK(1)", "+1", "-1", "@SUM(A1)", '"a",b', "＝1"])
def test_as_a_table_for_a_spreadsheet_nothing_is_a_formula(name: str) -> None:
    async def main() -> None:
        async with FakeWorkshop(settings=ON_THE_LAN) as workshop, workshop.client() as client:
            made = await workshop.tokens.create(name, "admin")
            client.headers.update(bearer(made["token"]))
            await client.post("/api/v1/machines/router/home")
            answer = await client.get(AUDIT, params={"format": "csv"})
            assert answer.headers["content-type"] == "text/csv; charset=utf-8"
            assert answer.headers["content-disposition"] == 'attachment; filename="audit.csv"'
            (row,) = csv.DictReader(answer.text.splitlines())
            assert row["name"] == (name if name[0] == '"' else f"'{name}")
            assert row["route"] == "/api/v1/machines/{m}/home"

    run(main())


def test_filters_and_pages() -> None:
    async def main() -> None:
        async with FakeWorkshop("router", "lathe") as workshop, workshop.client() as client:
            for machine in ("router", "lathe", "router"):
                await client.post(f"/api/v1/machines/{machine}/home")

            async def numbers(**wanted: Any) -> list[int]:
                answer = await client.get(AUDIT, params=wanted)
                return [row["id"] for row in answer.json()]

            assert await numbers(machine="router") == [3, 1]
            assert await numbers(limit=1) == [3]
            assert await numbers(before=3) == [2, 1]
            assert await numbers(since="2000-01-01T00:00:00Z") == [3, 2, 1]
            assert await numbers(until="2000-01-01T00:00:00") == []
            for no_time in ("yesterday", "0", "1e9"):  # nor seconds since 1970
                assert (await client.get(AUDIT, params={"since": no_time})).status_code == 422

    run(main())


def test_the_pins_of_a_changer_are_one_row_for_each_connection() -> None:
    class Changer:
        def drive(self, *_: Any, **__: Any) -> None: ...
        def leave(self, *_: Any) -> None: ...

    async def main() -> None:
        async with FakeWorkshop() as workshop:
            workshop.changers = {"router": Changer()}  # type: ignore[attr-defined]
            for _ in range(2):
                async with AsgiSocket(workshop.app()) as socket:
                    for level in (True, False, True):
                        pins = {"tool-changed": level}
                        await socket.ask({"type": "io", "machine": "router", "pins": pins})
            assert [row["route"] for row in await rows(workshop)] == ["io", "io"]

    run(main())
