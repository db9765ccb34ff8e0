import contextlib
import sqlite3
from datetime import UTC, datetime, timedelta
from typing import Any

import pytest

from server.access.auth import EXPIRED, LOCAL_USER, Role
from server.access.ratelimit import BURST, REFILL_S
from server.access.tokens import (
    NOTE_USE_EVERY_S,
    PREFIX,
    REFRESH_S,
    UNKNOWN_REFRESH_S,
    TokenError,
    TokenStore,
    create_token,
    list_tokens,
    revoke_token,
)
from server.problems import ProblemError
from tests.harness.fakeworkshop import MemoryDatabase, settle
from tests.harness.simloop import run_simulated as run

NOW = datetime(2026, 3, 1, 9, 30, tzinfo=UTC)


class Clockwork:
    """A token store with a clock that the test moves."""

    def __init__(self, host: str = "127.0.0.1") -> None:
        self.database = MemoryDatabase()
        self.at = 0.0
        self.tokens = TokenStore(
            self.database, host=host, monotonic=lambda: self.at, clock=lambda: NOW + timedelta(seconds=self.at)
        )

    async def __aenter__(self) -> "Clockwork":
        await self.tokens.load()
        return self

    async def __aexit__(self, *_: object) -> None:
        await settle()
        self.database.close()

    async def role(self, bearer: str | None = None, cookie: str | None = None) -> Role | None:
        principal = await self.tokens.identify(bearer=bearer, cookie=cookie)
        return None if principal is None else principal.role


def test_the_secret_is_stored_nowhere() -> None:
    database = MemoryDatabase()
    token, secret = create_token(database.db, "screen", "operator", now=NOW)
    dump = "\n".join(database.db.conn.iterdump())
    assert secret.startswith(PREFIX)
    assert len(secret) > 40
    assert secret not in dump
    assert secret.removeprefix(PREFIX) not in dump
    assert token.hash in dump
    assert "hash" not in token.view()
    database.close()


def test_listed_oldest_first_and_revoked_ones_stay() -> None:
    database = MemoryDatabase()
    first, _ = create_token(database.db, "b", "viewer", now=NOW)
    second, _ = create_token(database.db, "a", "admin", now=NOW + timedelta(seconds=1))
    revoked = revoke_token(database.db, first.id, now=NOW + timedelta(seconds=2))
    assert revoked is not None
    assert revoked.revoked_at == "2026-03-01T09:30:02.000Z"
    assert [token.id for token in list_tokens(database.db)] == [first.id, second.id]
    again = revoke_token(database.db, first.id, now=NOW + timedelta(days=1))
    assert again == revoked, "the time of the first revocation stays"
    assert revoke_token(database.db, "nobody", now=NOW) is None
    database.close()


@pytest.mark.parametrize(("name", "role"), [("", "viewer"), (" ", "viewer"), ("x" * 81, "viewer"), ("a\nb", "viewer")])
def test_names_that_are_refused(name: str, role: str) -> None:
    database = MemoryDatabase()
    with pytest.raises(TokenError, match="printable"):
        create_token(database.db, name, role, now=NOW)
    database.close()


@pytest.mark.parametrize("role", ["public", "root", "", "ADMIN"])
def test_roles_that_are_refused(role: str) -> None:
    database = MemoryDatabase()
    with pytest.raises(TokenError, match="viewer, operator, admin"):
        create_token(database.db, "x", role, now=NOW)
    database.close()


def test_loopback_without_tokens_is_admin_and_with_the_first_token_no_more() -> None:
    async def main() -> None:
        async with Clockwork() as c:
            assert await c.tokens.identify(bearer=None, cookie=None) == LOCAL_USER
            assert await c.role() is Role.ADMIN
            secret = (await c.tokens.create("screen", "viewer"))["token"]
            assert await c.role() is None
            assert await c.role(secret) is Role.VIEWER
            assert await c.role("wrong") is None

    run(main())


def test_a_network_address_without_tokens_is_nobodys() -> None:
    async def main() -> None:
        async with Clockwork("0.0.0.0") as c:
            assert await c.role() is None
            assert not c.tokens.open

    run(main())


def test_revoking_ends_the_token_its_sessions_and_its_open_connections() -> None:
    async def main() -> None:
        async with Clockwork("0.0.0.0") as c:
            made = await c.tokens.create("screen", "operator")
            signed_in = await c.tokens.sign_in(made["token"])
            assert signed_in is not None
            principal, cookie = signed_in
            assert await c.role(cookie=cookie) is Role.OPERATOR
            assert c.tokens.still_good(principal)
            revoked = await c.tokens.revoke(made["id"])
            assert revoked is not None
            assert revoked["revoked_at"]
            assert await c.role(made["token"]) is None
            assert await c.role(cookie=cookie) is None
            assert not c.tokens.still_good(principal)
            assert await c.tokens.sign_in(made["token"]) is None
            assert await c.tokens.revoke("nobody") is None

    run(main())


def test_signing_out_ends_the_session() -> None:
    async def main() -> None:
        async with Clockwork("0.0.0.0") as c:
            signed_in = await c.tokens.sign_in((await c.tokens.create("screen", "operator"))["token"])
            assert signed_in is not None
            c.tokens.sign_out(signed_in[1])
            assert await c.role(cookie=signed_in[1]) is None

    run(main())


def test_a_bad_token_is_not_made_good_by_a_good_cookie() -> None:
    async def main() -> None:
        async with Clockwork() as c:
            signed_in = await c.tokens.sign_in((await c.tokens.create("screen", "operator"))["token"])
            assert signed_in is not None
            assert await c.role("wrong", signed_in[1]) is None

    run(main())


def test_a_token_made_by_another_process_is_found() -> None:
    async def main() -> None:
        async with Clockwork("0.0.0.0") as c:
            _, secret = create_token(c.database.db, "from the command line", "admin", now=NOW)
            c.at += UNKNOWN_REFRESH_S
            assert await c.role(secret) is Role.ADMIN

    run(main())


def test_guessing_tokens_does_not_hammer_the_database() -> None:
    async def main() -> None:
        async with Clockwork("0.0.0.0") as c:
            c.at += UNKNOWN_REFRESH_S
            before = c.database.runs
            for number in range(100):
                with contextlib.suppress(ProblemError):
                    assert await c.role(f"guess {number}") is None
            assert c.database.runs == before + 1

    run(main())


def test_a_token_revoked_by_another_process_ends_within_the_refresh() -> None:
    async def main() -> None:
        async with Clockwork("0.0.0.0") as c:
            made = await c.tokens.create("screen", "operator")
            revoke_token(c.database.db, made["id"], now=NOW)
            assert await c.role(made["token"]) is Role.OPERATOR
            c.at += REFRESH_S
            await c.role(made["token"])  # this request is not delayed, but it notices
            await settle()
            assert await c.role(made["token"]) is None

    run(main())


@pytest.mark.parametrize(
    "trouble", [sqlite3.OperationalError("database is locked"), ProblemError("disk_full", "The disk is full.")]
)
def test_known_tokens_never_wait_for_the_database(trouble: Exception) -> None:
    class Stuck(MemoryDatabase):
        stuck = False

        async def run(self, fn: Any, *args: Any) -> Any:
            if self.stuck:
                raise trouble
            return await super().run(fn, *args)

        async def read(self, fn: Any, *args: Any) -> Any:
            if self.stuck:
                raise trouble
            return await super().read(fn, *args)

    async def main() -> None:
        database = Stuck()
        at = 0.0
        tokens = TokenStore(database, host="0.0.0.0", monotonic=lambda: at)
        await tokens.load()
        secret = (await tokens.create("screen", "operator"))["token"]
        database.stuck = True
        at = 1e6
        principal = await tokens.identify(bearer=secret, cookie=None)
        assert principal is not None
        await settle()
        database.close()

    run(main())


def test_use_is_noted_once_a_minute() -> None:
    async def main() -> None:
        async with Clockwork("0.0.0.0") as c:
            secret = (await c.tokens.create("screen", "operator"))["token"]
            for _ in range(3):
                await c.role(secret)
                await settle()
            assert (await c.tokens.list())[0]["last_used_at"] == "2026-03-01T09:30:00.000Z"
            c.at += NOTE_USE_EVERY_S
            await c.role(secret)
            await settle()
            assert (await c.tokens.list())[0]["last_used_at"] == "2026-03-01T09:31:00.000Z"

    run(main())


def test_a_token_ends_by_itself_and_its_sessions_with_it() -> None:
    async def main() -> None:
        async with Clockwork("0.0.0.0") as c:
            made = await c.tokens.create("guest", "operator", "1h")
            assert made["expires_at"] == "2026-03-01T10:30:00.000Z"
            signed_in = await c.tokens.sign_in(made["token"])
            assert signed_in is not None
            principal, cookie = signed_in
            c.at = 3599.0
            assert await c.role(made["token"]) is await c.role(cookie=cookie) is Role.OPERATOR
            assert c.tokens.still_good(principal)
            c.at = 3600.0
            for credentials in ({"bearer": made["token"], "cookie": None}, {"bearer": None, "cookie": cookie}):
                assert await c.tokens.identify(**credentials) is EXPIRED
            assert not c.tokens.still_good(principal)
            with pytest.raises(ProblemError) as refused:
                await c.tokens.sign_in(made["token"])
            assert refused.value.code == "token_expired"

    run(main())


def test_nobody_becomes_admin_because_the_last_token_has_expired() -> None:
    async def main() -> None:
        async with Clockwork("127.0.0.1") as c:
            await c.tokens.create("guest", "operator", "1h")
            c.at = 1e6
            await c.tokens.load()
            assert not c.tokens.open
            assert await c.role() is None

    run(main())


@pytest.mark.parametrize("expires", ["", "soon", "0d", "11y"])
def test_lifetimes_that_are_refused(expires: str) -> None:
    database = MemoryDatabase()
    with pytest.raises(TokenError, match="90d"):
        create_token(database.db, "x", "viewer", expires, now=NOW)
    database.close()


def test_who_guesses_is_refused_unseen_and_nobody_else_is() -> None:
    async def main() -> None:
        async with Clockwork("0.0.0.0") as c:
            right = (await c.tokens.create("screen", "operator"))["token"]
            at_work = (await c.tokens.create("desk", "operator"))["token"]
            await c.tokens.identify(bearer=at_work, cookie=None, address="10.0.0.1")
            for number in range(BURST):
                assert await c.tokens.identify(bearer=f"guess {number}", cookie=None, address="10.0.0.1") is None
            with pytest.raises(ProblemError) as refused:
                await c.tokens.identify(bearer=right, cookie=None, address="10.0.0.1")
            assert (refused.value.code, refused.value.extra) == ("too_many_attempts", {"retry_after_s": 10})
            with pytest.raises(ProblemError):
                await c.tokens.sign_in("guess", "10.0.0.1")
            for secret, address in ((right, "10.0.0.2"), (at_work, "10.0.0.1")):
                assert await c.tokens.identify(bearer=secret, cookie=None, address=address)
            c.at += REFILL_S
            assert await c.tokens.identify(bearer=right, cookie=None, address="10.0.0.1")

    run(main())


def test_of_tokens_that_were_revoked_nothing_stays_in_memory() -> None:
    async def main() -> None:
        async with Clockwork() as c:
            kept = await c.tokens.create("screen", "viewer")
            for day in range(20):
                made = await c.tokens.create(f"guest {day}", "viewer")
                assert await c.tokens.identify(bearer=made["token"], cookie=None)
                await c.tokens.revoke(made["id"])
            assert await c.tokens.identify(bearer=kept["token"], cookie=None)
            await settle()
            assert list(c.tokens._used_at) == [kept["id"]]
            assert len(await c.tokens.list()) == 21, "their rows stay a while (endedtokens.py)"

    run(main())
