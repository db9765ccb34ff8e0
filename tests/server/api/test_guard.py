"""Host, Origin, credentials and the headers of every answer."""

from typing import Any

import httpx
import pytest
from starlette.datastructures import Headers
from starlette.types import Message, Receive, Scope, Send

from server.access.auth import LOCAL_USER, Principal
from server.api.guard import Guard, HostRule, bearer, hostname, session_cookie
from tests.harness.asgisocket import AsgiSocket
from tests.harness.fakeworkshop import FakeServerSettings, FakeWorkshop
from tests.harness.fakeworkshop import bearer as with_token
from tests.harness.simloop import run_simulated as run

LOCAL = HostRule("127.0.0.1", [])
LAN = HostRule("0.0.0.0", ["mill.example"])

EVIL = "http://evil.example"


@pytest.mark.parametrize(
    "host", ["127.0.0.1:8420", "127.0.0.1", "localhost:8420", "LocalHost", "[::1]:8420", "127.1.2.3:1"]
)
def test_names_of_a_daemon_on_loopback(host: str) -> None:
    assert LOCAL.knows(host)


@pytest.mark.parametrize(
    "host",
    [
        None, "", "evil.example", "evil.example:1", "localhost.evil.example", "127.0.0.1.evil.example", "192.168.1.5",
        "0.0.0.0:8420", "user@127.0.0.1", "127.0.0.1/x", "[::1", "a b", ":8420",
    ],
)  # fmt: skip
def test_names_that_are_not_ours(host: str | None) -> None:
    assert not LOCAL.knows(host)


@pytest.mark.parametrize(
    "host", ["192.168.1.5:8420", "[fe80::1]:8420", "mill.example", "MILL.example.:80", "localhost"]
)
def test_names_of_a_daemon_on_the_lan(host: str) -> None:
    assert LAN.knows(host)


@pytest.mark.parametrize("host", ["evil.example", "0.0.0.0", "[::]:8420", "notmill.example"])
def test_names_that_are_not_ours_on_the_lan(host: str) -> None:
    assert not LAN.knows(host)


@pytest.mark.parametrize(
    ("origin", "authority", "ours"),
    [
        ("http://127.0.0.1:8420", "127.0.0.1:8420", True),
        ("https://127.0.0.1:8420", "127.0.0.1:8420", True),
        ("http://127.0.0.1:9999", "127.0.0.1:8420", False),
        ("http://localhost:8420", "127.0.0.1:8420", False),
        ("http://[::1", "127.0.0.1:8420", False),
        ("https://mill.example", "127.0.0.1:8420", True),
        (EVIL, "127.0.0.1:8420", False),
        ("null", "127.0.0.1:8420", False),
        ("file://127.0.0.1:8420", "127.0.0.1:8420", False),
        ("http://127.0.0.1:8420", None, False),
        ("", "127.0.0.1:8420", False),
    ],
)
def test_origins(origin: str, authority: str | None, ours: bool) -> None:
    assert LAN.same_site(origin, authority) is ours


def test_host_names_are_read_like_a_browser_reads_them() -> None:
    assert hostname("Mill.Local.:80") == "mill.local"
    assert hostname("[::1]:80") == "::1"
    assert hostname("a:b:c") is None or hostname("a:b:c") == "a"


def ask(
    method: str, path: str, settings: FakeServerSettings | None = None, **headers: str
) -> tuple[httpx.Response, Any]:
    async def main() -> tuple[httpx.Response, Any]:
        async with FakeWorkshop(settings=settings) as workshop, workshop.client() as client:
            answer = await client.request(
                method, path, headers={name.replace("_", "-"): it for name, it in headers.items()}
            )
            return answer, workshop.router.calls

    return run(main())


def test_a_rebound_name_is_refused_for_every_method() -> None:
    for method, path in (("GET", "/api/v1/machines"), ("POST", "/api/v1/machines/router/home"), ("GET", "/")):
        answer, calls = ask(method, path, host="evil.example:8420")
        assert (answer.status_code, answer.json()["code"], calls) == (421, "bad_host", [])


def test_another_sites_page_can_change_nothing() -> None:
    for headers in (
        {"origin": EVIL},
        {"origin": "null"},
        {"sec_fetch_site": "cross-site"},
        {"sec_fetch_site": "same-site"},
    ):
        answer, calls = ask("POST", "/api/v1/machines/router/home", **headers)
        assert (answer.status_code, answer.json()["code"], calls) == (403, "bad_origin", [])


def test_our_own_page_and_programs_without_a_browser_can() -> None:
    for headers in (
        {},
        {"origin": "http://127.0.0.1:8420"},
        {"sec_fetch_site": "same-origin"},
        {"sec_fetch_site": "none"},
    ):
        answer, calls = ask("POST", "/api/v1/machines/router/home", **headers)
        assert (answer.status_code, calls) == (202, [("home",)])


def test_reading_is_left_to_the_browsers_own_rule() -> None:
    answer, _ = ask("GET", "/api/v1/machines", origin=EVIL)
    assert answer.status_code == 200
    assert "access-control-allow-origin" not in answer.headers


def test_the_websocket_checks_host_and_origin() -> None:
    async def main() -> None:
        async with FakeWorkshop() as workshop:
            app = workshop.app()
            async with AsgiSocket(app, headers={"origin": EVIL}) as socket:
                assert (socket.status, socket.problem["code"]) == (403, "bad_origin")
            async with AsgiSocket(app, headers={"host": "evil.example"}) as socket:
                assert (socket.status, socket.problem["code"]) == (421, "bad_host")
            async with AsgiSocket(app, headers={"origin": "http://127.0.0.1:8420"}) as socket:
                assert socket.status is None

    run(main())


@pytest.mark.parametrize(
    ("method", "path"),
    [
        ("GET", "/"),
        ("GET", "/healthz"),
        ("GET", "/nothing"),
        ("POST", "/api/v1/jobs"),
        ("GET", "/metrics"),
        ("GET", "/docs"),
    ],
)
def test_security_headers_are_on_every_answer(method: str, path: str) -> None:
    answer, _ = ask(method, path)
    policy = answer.headers["content-security-policy"]
    for rule in (
        "default-src 'none'", "script-src 'self'", "style-src 'self'", "connect-src 'self'", "img-src 'self' data:",
        "worker-src 'self'", "frame-ancestors 'none'",
    ):  # fmt: skip
        assert rule in policy.split("; ")
    assert "unsafe" not in policy
    assert answer.headers["x-content-type-options"] == "nosniff"
    assert answer.headers["cache-control"] in ("no-store", "no-cache")


def test_security_headers_are_on_refusals_and_internal_errors() -> None:
    async def main() -> None:
        async with FakeWorkshop() as workshop, workshop.client() as client:
            workshop.router.refusals["home"] = RuntimeError()
            for answer in (
                await client.post("/api/v1/machines/router/home"),
                await client.get("/", headers={"host": "evil.example"}),
            ):
                assert answer.headers["x-content-type-options"] == "nosniff"

    run(main())


def test_the_cookie_and_the_bearer_token_are_read() -> None:
    assert bearer(Headers({"authorization": "Bearer abc"})) == "abc"
    assert bearer(Headers({"authorization": "bearer  abc "})) == "abc"
    for nothing in ("", "Bearer", "Bearer ", "Basic abc"):
        assert bearer(Headers({"authorization": nothing})) is None
    assert session_cookie(Headers({"cookie": "a=b; millstream_session=xyz"})) == "xyz"
    assert session_cookie(Headers({"cookie": "a=b"})) is None
    assert session_cookie(Headers({"cookie": '\x00=;"'})) is None


def test_a_wrong_token_closes_nothing_that_is_public() -> None:
    async def main() -> None:
        async with FakeWorkshop() as workshop, workshop.client() as client:
            await workshop.token("viewer")
            assert (await client.get("/healthz", headers=with_token("wrong"))).status_code == 200
            assert (await client.get("/api/v1/machines", headers=with_token("wrong"))).status_code == 401

    run(main())


def test_an_error_after_the_answer_began_is_not_answered_twice() -> None:
    sent: list[Message] = []

    async def broken(scope: Scope, receive: Receive, send: Send) -> None:
        await send({"type": "http.response.start", "status": 200, "headers": []})
        raise RuntimeError("too late")

    async def identify(*, bearer: str | None, cookie: str | None, address: str) -> Principal:
        return LOCAL_USER

    async def send(message: Message) -> None:
        sent.append(message)

    async def receive() -> Message:
        return {"type": "http.disconnect"}

    async def main() -> None:
        guard = Guard(broken, hosts=LOCAL, identify=identify)
        scope = {"type": "http", "method": "GET", "path": "/", "headers": [(b"host", b"localhost")]}
        await guard(scope, receive, send)

    run(main())
    assert [message["type"] for message in sent] == ["http.response.start"]
