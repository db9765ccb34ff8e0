"""Access tokens: the rows of the table `tokens`, and the set of them that the running daemon knows.

The functions run inside the database thread (or in the command line, with the daemon stopped). The one rule: a
request is judged from memory, so that a stop never waits behind the database.
"""

import asyncio
import logging
import secrets
import sqlite3
import time
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass
from datetime import datetime
from functools import partial
from typing import Any, Protocol

from sqlite_utils import Database

from protocol.errors import MillstreamError
from server.access.auth import EXPIRED, GRANTABLE, LOCAL_USER, Principal, Role, Sessions, digest, is_loopback
from server.access.lifetime import lifetime
from server.access.ratelimit import Attempts
from server.access.tickets import Tickets
from server.clock import rfc3339, utc_now
from server.problems import ProblemError

logger = logging.getLogger(__name__)

TABLE = "tokens"
PREFIX = "mill_"
"""Makes a token that leaked into a log or a repository easy to find."""
MAX_NAME_CHARS = 80
REFRESH_S = 5.0
"""How long a token that was revoked by another process (the command line) can still be used, at most."""
UNKNOWN_REFRESH_S = 1.0
"""A token nobody knows makes the daemon look into the table again, but not more often than this."""

SESSION_ID_CHARS = 16
EXPIRED_DETAIL = "The time of this token is over. `millstream token create` makes a new one."
NOTE_USE_EVERY_S = 60.0
"""`last_used_at` is a help to tidy up, not an audit log: written this often at most."""


class TokenError(MillstreamError):
    """A token cannot be made as asked; the message says what is allowed."""


@dataclass(frozen=True, slots=True)
class Token:
    """A token without its secret."""

    id: str
    name: str
    role: Role
    hash: str
    created_at: str
    last_used_at: str | None = None
    revoked_at: str | None = None
    expires_at: str | None = None

    def has_expired(self, now: datetime) -> bool:
        """Whether its time is over."""
        return self.expires_at is not None and datetime.fromisoformat(self.expires_at) <= now

    def view(self) -> dict[str, Any]:
        """As the API shows it."""
        return {
            "id": self.id,
            "name": self.name,
            "role": self.role.word,
            "created_at": self.created_at,
            "last_used_at": self.last_used_at,
            "revoked_at": self.revoked_at,
            "expires_at": self.expires_at,
        }


def create_token(db: Database, name: str, role: str, expires: str | None = None, *, now: datetime) -> tuple[Token, str]:
    """A new token and its secret, which nobody can read again. `expires`: after how long (lifetime.py); None: never.
    Raises TokenError."""
    if role not in GRANTABLE:
        raise TokenError(f"role {role!r} does not exist; choose one of {', '.join(GRANTABLE)}")
    if not name.strip() or len(name) > MAX_NAME_CHARS or not name.isprintable():
        raise TokenError(f"a token's name is 1 to {MAX_NAME_CHARS} printable characters")
    secret = PREFIX + secrets.token_urlsafe(32)
    try:
        ends_at = None if expires is None else rfc3339(now + lifetime(expires))
    except ValueError as error:
        raise TokenError(str(error)) from error
    id_, granted = secrets.token_hex(4), Role[role.upper()]
    token = Token(id_, name.strip(), granted, digest(secret), rfc3339(now), expires_at=ends_at)
    row = token.view() | {"hash": token.hash}
    with db.conn:
        db.table(TABLE).insert(row)
    return token, secret


def list_tokens(db: Database) -> list[Token]:
    """All tokens, revoked ones too, oldest first."""
    return _tokens(db, "1")


def list_live_tokens(db: Database) -> list[Token]:
    """Those that are not revoked: whoever makes a token for each day has thousands of others after some years."""
    return _tokens(db, "revoked_at is null")


def _tokens(db: Database, wanted: str) -> list[Token]:
    return [
        Token(
            id=str(row["id"]),
            name=row["name"],
            role=Role[row["role"].upper()],
            hash=row["hash"],
            created_at=row["created_at"],
            last_used_at=row["last_used_at"],
            revoked_at=row["revoked_at"],
            expires_at=row["expires_at"],
        )
        for row in db.query(f"select * from {TABLE} where {wanted} order by created_at, rowid")  # noqa: S608 - constants
    ]


def revoke_token(db: Database, token_id: str, *, now: datetime) -> Token | None:
    """The token as it is now, revoked; None when there is none with this id."""
    with db.conn:
        db.execute(
            f"update {TABLE} set revoked_at = coalesce(revoked_at, ?) where id = ?",  # noqa: S608
            [rfc3339(now), token_id],
        )
    return next((token for token in list_tokens(db) if token.id == token_id), None)


def note_use(db: Database, token_id: str, *, now: datetime) -> None:
    """Remember that a token was used."""
    with db.conn:
        db.execute(f"update {TABLE} set last_used_at = ? where id = ?", [rfc3339(now), token_id])  # noqa: S608


class RunInDatabase(Protocol):
    """`DbThread.run` or its `read`: runs `fn(database, *args)` where the database lives."""

    def __call__(self, fn: Callable[..., Any], *args: Any) -> Awaitable[Any]: ...


class Table(Protocol):
    """What is needed of the database: `DbThread`."""

    @property
    def run(self) -> RunInDatabase: ...

    @property
    def read(self) -> RunInDatabase: ...


class TokenStore:
    """The tokens as the running daemon knows them, and the sessions that were begun with them.

    `host` is the address that the daemon listens on. `clock` gives time stamps, `monotonic` seconds.
    """

    def __init__(
        self,
        table: Table,
        *,
        host: str,
        monotonic: Callable[[], float] = time.monotonic,
        clock: Callable[[], datetime] = utc_now,
    ) -> None:
        self._run = table.run
        self._read = table.read
        self._loopback = is_loopback(host)
        self._monotonic = monotonic
        self._clock = clock
        self._by_hash: Mapping[str, Token] = {}
        self._by_id: Mapping[str, Token] = {}
        self._loaded_at = float("-inf")
        self._used_at: dict[str, float] = {}
        self._tasks: set[asyncio.Task[None]] = set()
        self._sessions = Sessions()
        self.attempts = Attempts()
        self.expired = 0
        """How often a token came, by itself or behind a cookie, whose time was over."""
        self._tickets = Tickets()

    def __len__(self) -> int:
        """How many tokens there are that are not revoked."""
        return len(self._by_id)

    @property
    def open(self) -> bool:
        """Whether everybody who reaches the daemon may do everything: loopback, and no tokens. One that has expired
        keeps the door closed all the same: nobody becomes admin because time passes."""
        return self._loopback and not self._by_id

    async def load(self) -> None:
        """Read the table; once before the daemon listens, and by itself later."""
        self._loaded_at = self._monotonic()
        live: list[Token] = await self._read(list_live_tokens)
        self._by_hash = {token.hash: token for token in live}
        self._by_id = {token.id: token for token in live}
        self._used_at = {id: at for id, at in self._used_at.items() if id in self._by_id}

    async def identify(self, *, bearer: str | None, cookie: str | None, address: str = "") -> Principal | None:
        """Who comes with this token or cookie; None when it is not good (any more). Raises ProblemError when too many
        wrong tokens came from `address`. A cookie is no guess: those of a daemon before this one are wrong, too."""
        now = self._monotonic()
        self._reload_if_stale(now)
        if bearer is not None:
            return await self._by_bearer(bearer, address, now)
        if cookie is not None:
            token_id = self._sessions.token_id(cookie, now=now)
            token = self._by_id.get(token_id) if token_id is not None else None
            if token is not None:
                return self._principal(token, now, session=digest(cookie)[:SESSION_ID_CHARS])
        return LOCAL_USER if self.open else None

    def still_good(self, principal: Principal) -> bool:
        """Whether a reader that stays connected may go on: its token was not revoked and has not expired."""
        self._reload_if_stale(self._monotonic())
        if principal.token_id is None:
            return self.open
        token = self._by_id.get(principal.token_id)
        return token is not None and not (token.expires_at is not None and token.has_expired(self._clock()))

    async def sign_in(self, secret: str, address: str = "") -> tuple[Principal, str] | None:
        """A session for the browser of whoever knows `secret`: the cookie's value, or None. Raises ProblemError."""
        now = self._monotonic()
        principal = await self._by_bearer(secret, address, now)
        if principal is EXPIRED:
            raise ProblemError("token_expired", EXPIRED_DETAIL)
        if principal is None or principal.token_id is None:
            return None
        return principal, self._sessions.begin(principal.token_id, now=now)

    def ticket(self, principal: Principal) -> str:
        """For one WebSocket of whoever asks (tickets.py)."""
        return self._tickets.issue(principal, now=self._monotonic())

    def redeem(self, ticket: str) -> Principal | None:
        """Who comes with this ticket; None when it is not good (any more), or the token behind it is not."""
        principal = self._tickets.redeem(ticket, now=self._monotonic())
        return principal if principal is not None and self.still_good(principal) else None

    def sign_out(self, cookie: str) -> None:
        """End a session."""
        self._sessions.end(cookie)

    async def create(self, name: str, role: str, expires: str | None = None) -> dict[str, Any]:
        """Make a token; its view with the secret as `token`, shown this once. Raises TokenError."""
        created: tuple[Token, str] = await self._run(partial(create_token, now=self._clock()), name, role, expires)
        await self.load()
        token, secret = created
        return token.view() | {"token": secret}

    async def list(self) -> list[dict[str, Any]]:
        """All tokens without their secrets."""
        tokens: list[Token] = await self._read(list_tokens)
        return [token.view() for token in tokens]

    async def revoke(self, token_id: str) -> dict[str, Any] | None:
        """End a token and its sessions; None when there is none with this id."""
        token: Token | None = await self._run(partial(revoke_token, now=self._clock()), token_id)
        await self.load()
        return token.view() if token is not None else None

    async def _by_bearer(self, secret: str, address: str, now: float) -> Principal | None:
        self._refuse_guessers(secret, address, now)
        hashed = digest(secret)
        if hashed not in self._by_hash and now - self._loaded_at >= UNKNOWN_REFRESH_S:
            await self.load()
        token = self._by_hash.get(hashed)
        if token is None:
            self.attempts.wrong(address, secret, now=now)
            return None
        self.attempts.right(address, secret, now=now)
        return self._principal(token, now)

    def _refuse_guessers(self, secret: str, address: str, now: float) -> None:
        """Raises ProblemError; where nobody needs a token nobody guesses one."""
        if self.open or (wait_s := self.attempts.wait_s(address, secret, now=now)) == 0:
            return
        raise ProblemError(
            "too_many_attempts",
            f"Too many wrong tokens came from {address or 'this address'}; the next one is looked at in {wait_s} s. "
            "Whoever is at work there already is not kept out.",
            retry_after_s=wait_s,
        )

    def _principal(self, token: Token, now: float, *, session: str | None = None) -> Principal:
        if token.expires_at is not None and token.has_expired(self._clock()):
            self.expired += 1
            return EXPIRED
        if now - self._used_at.get(token.id, float("-inf")) >= NOTE_USE_EVERY_S:
            self._used_at[token.id] = now
            self._in_background(self._run(partial(note_use, now=self._clock()), token.id))
        return Principal(token.role, token.name, token.id, session)

    def _reload_if_stale(self, now: float) -> None:
        if now - self._loaded_at >= REFRESH_S:
            self._loaded_at = now
            self._in_background(self.load())

    def _in_background(self, work: Awaitable[None]) -> None:
        """Nobody who asks waits for this."""

        async def watched() -> None:
            try:
                await work
            except (sqlite3.Error, ProblemError):  # a full disk, and what the database thread makes of it
                logger.exception("the table of tokens could not be read or written")

        task = asyncio.get_running_loop().create_task(watched())
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
