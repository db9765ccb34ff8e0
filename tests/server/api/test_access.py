from http.cookies import SimpleCookie
from typing import Any

from server.api.guard import SESSION_COOKIE
from tests.harness.asgisocket import AsgiSocket
from tests.harness.fakeworkshop import FakeServerSettings, FakeWorkshop, bearer
from tests.harness.simloop import run_simulated as run

SESSION = "/api/v1/session"
TOKENS = "/api/v1/tokens"
ON_THE_LAN = FakeServerSettings(host="0.0.0.0", allowed_hosts=("mill.example",))


def test_without_tokens_on_loopback_everybody_is_admin() -> None:
    async def main() -> None:
        async with FakeWorkshop() as workshop, workshop.client() as client:
            assert (await client.get(SESSION)).json() == {"name": "local user", "role": "admin", "open": True}
            assert (await client.get(TOKENS)).json() == []

    run(main())


def test_signing_in_sets_a_cookie_that_scripts_and_other_sites_do_not_get() -> None:
    async def main() -> None:
        async with FakeWorkshop(settings=ON_THE_LAN) as workshop, workshop.client() as client:
            secret = await workshop.token("operator")
            assert (await client.get(SESSION)).json() == {"name": "nobody", "role": "public", "open": False}
            answer = await client.post(SESSION, json={"token": secret})
            assert answer.json() == {"name": "a operator", "role": "operator", "open": False}
            cookie = SimpleCookie(answer.headers["set-cookie"])[SESSION_COOKIE]
            assert (cookie["httponly"], cookie["samesite"].lower(), cookie["path"]) == (True, "strict", "/")
            assert not cookie["secure"], "over plain HTTP the browser would drop it"
            assert secret not in answer.headers["set-cookie"]
            assert (await client.get(SESSION)).json()["role"] == "operator"
            assert (await client.post("/api/v1/machines/router/home")).status_code == 202
            assert (await client.get(TOKENS)).status_code == 403

    run(main())


def test_over_tls_the_cookie_is_secure() -> None:
    async def main() -> None:
        async with FakeWorkshop(settings=ON_THE_LAN) as workshop, workshop.client() as client:
            secret = await workshop.token("operator")
            answer = await client.post(f"https://mill.example{SESSION}", json={"token": secret})
            assert SimpleCookie(answer.headers["set-cookie"])[SESSION_COOKIE]["secure"]

    run(main())


def test_behind_a_proxy_that_is_known_the_cookie_is_secure_where_the_browser_spoke_tls() -> None:
    def cookie_of(answer: Any) -> Any:
        return SimpleCookie(answer.headers["set-cookie"])[SESSION_COOKIE]

    async def main(trusted: tuple[str, ...], proto: str) -> tuple[Any, Any]:
        settings = FakeServerSettings(host="0.0.0.0", allowed_hosts=("mill.example",), trusted_proxies=trusted)
        async with FakeWorkshop(settings=settings) as workshop, workshop.client() as client:
            client.headers["X-Forwarded-Proto"] = proto
            signed_in = await client.post(SESSION, json={"token": await workshop.token("operator")})
            return cookie_of(signed_in)["secure"], cookie_of(await client.delete(SESSION))["secure"]

    for trusted, proto, expected in ((("127.0.0.1",), "https", True), (("127.0.0.1",), "http", ""), ((), "https", "")):
        assert run(main(trusted, proto)) == (expected, expected), (trusted, proto)


def test_signing_in_with_a_token_that_is_not_known() -> None:
    async def main() -> None:
        async with FakeWorkshop(settings=ON_THE_LAN) as workshop, workshop.client() as client:
            answer = await client.post(SESSION, json={"token": "guess"})
            assert (answer.status_code, answer.json()["code"]) == (401, "unauthorized")
            assert "set-cookie" not in answer.headers

    run(main())


def test_signing_out_ends_the_session_on_the_daemon_too() -> None:
    async def main() -> None:
        async with FakeWorkshop(settings=ON_THE_LAN) as workshop, workshop.client() as client:
            await client.post(SESSION, json={"token": await workshop.token("operator")})
            cookie = client.cookies[SESSION_COOKIE]
            assert (await client.delete(SESSION)).status_code == 204
            assert SESSION_COOKIE not in client.cookies
            client.cookies.set(SESSION_COOKIE, cookie)
            assert (await client.get("/api/v1/machines")).status_code == 401
            assert (await client.delete(SESSION)).status_code == 204, "harmless a second time"

    run(main())


def test_the_cookie_opens_the_websocket() -> None:
    async def main() -> None:
        async with FakeWorkshop(settings=ON_THE_LAN) as workshop, workshop.client() as client:
            await client.post(SESSION, json={"token": await workshop.token("viewer")})
            cookie = f"{SESSION_COOKIE}={client.cookies[SESSION_COOKIE]}"
            async with AsgiSocket(workshop.app(), headers={"cookie": cookie}) as socket:
                assert (await socket.hear())["data"]["role"] == "viewer"

    run(main())


def test_tokens_are_made_listed_and_revoked() -> None:
    async def main() -> None:
        async with FakeWorkshop(settings=ON_THE_LAN) as workshop, workshop.client() as client:
            client.headers.update(bearer(await workshop.token("admin")))
            answer = await client.post(TOKENS, json={"name": "screen", "role": "viewer"})
            made = answer.json()
            assert answer.status_code == 201
            seen = await client.get("/api/v1/machines", headers=bearer(made["token"]))
            assert seen.status_code == 200
            listed = await client.get(TOKENS)
            assert made["token"] not in listed.text
            assert "hash" not in listed.text
            assert [token["name"] for token in listed.json()] == ["a admin", "screen"]
            revoked = await client.delete(f"{TOKENS}/{made['id']}")
            assert revoked.json()["revoked_at"]
            seen = await client.get("/api/v1/machines", headers=bearer(made["token"]))
            assert seen.status_code == 401
            assert (await client.delete(f"{TOKENS}/nobody")).json()["code"] == "unknown_token"

    run(main())


def test_tokens_that_are_none() -> None:
    async def main() -> None:
        async with FakeWorkshop() as workshop, workshop.client() as client:
            for body in (
                {"name": "x", "role": "public"},
                {"name": "", "role": "viewer"},
                {"name": "a\nb", "role": "viewer"},
            ):
                answer = await client.post(TOKENS, json=body)
                assert (answer.status_code, answer.json()["code"]) == (422, "invalid_request")

    run(main())
