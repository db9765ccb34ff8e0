from collections.abc import AsyncIterator
from typing import Any

import httpx
import pytest

from server.api.models import PROGRAM_ID, CheckView, ProgramView, SourceView
from server.api.upload import PIECE_BYTES
from server.problems import ProblemError
from tests.harness.fakeworkshop import FakeServerSettings, FakeWorkshop
from tests.harness.simloop import run_simulated as run

PROGRAMS = "/api/v1/programs"
ONE = f"{PROGRAMS}/{PROGRAM_ID}"


def ask(method: str, path: str) -> tuple[int, Any, list[Any]]:
    async def main() -> tuple[int, Any, list[Any]]:
        async with FakeWorkshop() as workshop, workshop.client() as client:
            answer = await client.request(method, path)
            return answer.status_code, answer.json() if answer.content else None, workshop.programs.calls

    return run(main())


def test_the_body_is_the_file_itself() -> None:
    """As `curl --data-binary @part.nc` sends it: with a content type of forms that means nothing here."""

    async def main() -> None:
        async with FakeWorkshop() as workshop, workshop.client() as client:
            for content_type in ("application/x-www-form-urlencoded", "application/octet-stream", "text/plain"):
                headers = {"content-type": content_type}
                answer = await client.post(f"{PROGRAMS}?name=part.nc", content=b"G21\nM30\n", headers=headers)
                assert answer.status_code == 201
                assert ProgramView.model_validate(answer.json()).name == "part.nc"
                assert answer.headers["location"] == ONE
                assert workshop.programs.kept == {"part.nc": b"G21\nM30\n"}

    run(main())


def test_a_form_with_the_file() -> None:
    async def main() -> None:
        async with FakeWorkshop() as workshop, workshop.client() as client:
            files = {"other": (None, b"ignored"), "file": ("C:\\cam\\part.nc", b"G21\r\nM30\r\n", "text/plain")}
            answer = await client.post(PROGRAMS, files=files)
            assert (answer.status_code, answer.json()["name"]) == (201, "part.nc")
            await client.post(f"{PROGRAMS}?name=mine.nc", files=files)
            assert workshop.programs.kept == {"part.nc": b"G21\r\nM30\r\n", "mine.nc": b"G21\r\nM30\r\n"}

    run(main())


def test_an_upload_is_never_in_memory_as_a_whole() -> None:
    async def main() -> None:
        piece, pieces = b"G1 X1\n" * 10_000, 50
        taken_when_sent: list[int] = []

        async def stream() -> AsyncIterator[bytes]:
            for _ in range(pieces):
                taken_when_sent.append(workshop.programs.taken_bytes)
                yield piece

        workshop = FakeWorkshop()
        async with workshop, workshop.client() as client:
            assert (await client.post(f"{PROGRAMS}?name=a.nc", content=stream())).status_code == 201
            assert len(piece) < workshop.programs.largest_piece < PIECE_BYTES + len(piece)
            # Before another piece is read, all but what is being gathered has been handed to the store.
            waiting = [number * len(piece) - taken for number, taken in enumerate(taken_when_sent)]
            assert 0 <= min(waiting) < max(waiting) < PIECE_BYTES

    run(main())


def test_a_disk_that_fills_up_ends_the_upload_at_once() -> None:
    async def main() -> None:
        sent = 0

        async def ten_gigabytes() -> AsyncIterator[bytes]:
            nonlocal sent
            while sent < 10 * 1024**3:
                sent += 65536
                yield b"G" * 65536

        async with FakeWorkshop() as workshop, workshop.client() as client:
            workshop.programs.full_after_bytes = 1_000_000
            answer = await client.post(f"{PROGRAMS}?name=a.nc", content=ten_gigabytes())
            assert (answer.status_code, answer.json()["code"]) == (507, "disk_full")
            assert workshop.programs.kept == {}
            assert sent < 1_200_000

    run(main())


def test_an_upload_that_says_it_is_too_large_is_refused_before_it_is_read() -> None:
    async def main() -> None:
        settings = FakeServerSettings(max_upload_bytes=10)
        async with FakeWorkshop(settings=settings) as workshop, workshop.client() as client:
            answer = await client.post(f"{PROGRAMS}?name=a.nc", content=b"x" * 11)
            assert (answer.status_code, answer.json()["limit_bytes"]) == (413, 10)
            assert workshop.programs.calls == []
            assert (await client.post(f"{PROGRAMS}?name=a.nc", content=b"x" * 10)).status_code == 201

    run(main())


def test_what_the_store_refuses_is_passed_on() -> None:
    async def main() -> None:
        async with FakeWorkshop() as workshop, workshop.client() as client:
            workshop.programs.refusals["store"] = ProblemError("not_a_program", "Line 1 holds NUL bytes.")
            answer = await client.post(f"{PROGRAMS}?name=a.nc", content=b"\x00")
            assert (answer.status_code, answer.json()["code"]) == (422, "not_a_program")

    run(main())


def test_programs_are_listed_and_shown() -> None:
    assert ProgramView.model_validate(ask("GET", PROGRAMS)[1][0])
    assert ask("GET", ONE)[1]["id"] == PROGRAM_ID


@pytest.mark.parametrize(
    ("query", "asked"), [("", (1, 1000)), ("?from=5", (5, 1004)), ("?from=5&to=5", (5, 5)), ("?to=10000", (1, 10000))]
)
def test_lines_of_the_source(query: str, asked: tuple[int, int]) -> None:
    status, body, calls = ask("GET", f"{ONE}/source{query}")
    assert (status, calls) == (200, [("source", PROGRAM_ID, *asked)])
    SourceView.model_validate(body)


@pytest.mark.parametrize("query", ["?from=5&to=4", "?to=10001", "?from=0", "?from=x", "?to=0"])
def test_lines_that_are_none(query: str) -> None:
    status, body, calls = ask("GET", f"{ONE}/source{query}")
    assert (status, body["code"], calls) == (422, "invalid_request", [])


def test_the_check_is_for_a_machine_or_for_its_kind() -> None:
    status, body, calls = ask("GET", f"{ONE}/check?machine=router")
    assert (status, calls) == (200, [("check", PROGRAM_ID, "router", None)])
    CheckView.model_validate(body)
    assert ask("GET", f"{ONE}/check?profile=elvinto")[2] == [("check", PROGRAM_ID, None, "elvinto")]
    for query in ("", "?machine=router&profile=elvinto"):
        assert ask("GET", f"{ONE}/check{query}")[1]["code"] == "invalid_request"


TOOLPATH = f"{ONE}/toolpath"


def fetch(path: str, tag: str = "") -> tuple[httpx.Response, list[Any]]:
    async def main() -> tuple[httpx.Response, list[Any]]:
        async with FakeWorkshop() as workshop, workshop.client() as client:
            answer = await client.get(path, headers={"If-None-Match": tag} if tag else {})
            return answer, workshop.programs.calls

    return run(main())


def test_the_path_of_a_program() -> None:
    answer, calls = fetch(TOOLPATH)
    assert (answer.status_code, answer.content) == (200, b"MSTP")
    assert answer.headers["content-type"] == "application/octet-stream"
    assert (answer.headers["content-length"], answer.headers["etag"]) == ("4", '"abc-1"')
    assert answer.headers["cache-control"] == "private, no-cache"
    assert calls == [("toolpath", PROGRAM_ID, None, None, 0), ("open",)]
    assert fetch(f"{TOOLPATH}?machine=router&level=2")[1][0] == ("toolpath", PROGRAM_ID, "router", None, 2)
    assert fetch(f"{TOOLPATH}?profile=elvinto&level=4")[1][0] == ("toolpath", PROGRAM_ID, None, "elvinto", 4)


@pytest.mark.parametrize("tag", ['"abc-1"', 'W/"abc-1"', '"old", "abc-1"', "*"])
def test_a_path_that_the_browser_has_already_is_not_even_made(tag: str) -> None:
    answer, calls = fetch(TOOLPATH, tag)
    assert (answer.status_code, answer.content, answer.headers["etag"]) == (304, b"", '"abc-1"')
    assert "open" not in [call[0] for call in calls]


def test_another_path_than_the_browser_has_is_sent() -> None:
    assert fetch(TOOLPATH, '"abc-2"')[0].status_code == 200


@pytest.mark.parametrize("query", ["?level=5", "?level=-1", "?level=x", "?machine=router&profile=elvinto"])
def test_a_path_that_cannot_be(query: str) -> None:
    status, body, calls = ask("GET", TOOLPATH + query)
    assert (status, body["code"], calls) == (422, "invalid_request", [])


@pytest.mark.parametrize(
    ("where", "code", "status"), [("toolpath", "unknown_program", 404), ("open", "no_preview", 422)]
)
def test_a_path_that_is_refused(where: str, code: str, status: int) -> None:
    async def main() -> None:
        async with FakeWorkshop() as workshop, workshop.client() as client:
            workshop.programs.refusals[where] = ProblemError(code, "No.")
            answer = await client.get(TOOLPATH)
            assert (answer.status_code, answer.json()["code"]) == (status, code)

    run(main())


def test_a_program_is_deleted() -> None:
    assert ask("DELETE", ONE) == (204, None, [("delete", PROGRAM_ID)])
