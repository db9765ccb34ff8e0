"""Which requests go into the audit, and what of them: who, from where, on what, with which answer.

Not the table (server/access/audit.py). The one rule: never a body, a query or a header, for those hold secrets; and
nobody who is not known can fill the table: of strangers only attempts to sign in are kept, and those are bounded
(ratelimit.py).
"""

from collections.abc import Callable

from starlette.types import Scope

from server.access.audit import Audit, Entry, clean
from server.access.auth import NOBODY, Principal, Role
from server.api.clientaddress import ADDRESS_KEY, UNKNOWN
from server.api.guard import ATTEMPT_KEY, MADE_KEY, PRINCIPAL_KEY, UNAUDITED_KEY
from server.api.problems import PROBLEM_KEY

GUESSED = ("unauthorized", "token_expired")
MAX_JOB = 2**53
BY_MESSAGE = "WS"
MAX_NAME_CHARS = 80


class Trail:
    """What the guard tells of requests, and the WebSocket of messages. `audit` gives the rows' keeper."""

    def __init__(self, audit: Callable[[], Audit]) -> None:
        self._audit = audit

    def request(self, scope: Scope, status: int) -> None:
        """A request over HTTP that is not only read, after its answer."""
        principal: Principal = scope.get(PRINCIPAL_KEY, NOBODY)
        route = getattr(scope.get("route"), "path", None)
        code = scope.get(PROBLEM_KEY)
        if (
            route is None
            or code == "method_not_allowed"
            or scope.get(UNAUDITED_KEY)
            or not _known_or_guessing(scope, principal, code)
        ):
            return
        given = scope.get("path_params", {})
        made = dict([scope[MADE_KEY]]) if MADE_KEY in scope else {}
        self._audit().note(
            Entry(
                at="",
                via=via(principal),
                token=principal.token_id,
                name=clean(principal.name, MAX_NAME_CHARS),
                address=clean(scope.get(ADDRESS_KEY, UNKNOWN)),
                method=scope["method"],
                route=route,
                machine=_text(given.get("m")),
                job=_number(made.get("job", given.get("id") if "/jobs/" in route else None)),
                target=_text(made.get("target", given.get("id") if "/jobs/" not in route else None)),
                status=status,
                code=code,
            )
        )

    def message(
        self, scope: Scope, principal: Principal, kind: str, machine: str | None, status: int, code: str | None
    ) -> None:
        """A message over a WebSocket, when its result is known."""
        self._audit().note(
            Entry(
                at="",
                via=via(principal),
                token=principal.token_id,
                name=clean(principal.name, MAX_NAME_CHARS),
                address=clean(scope.get(ADDRESS_KEY, UNKNOWN)),
                method=BY_MESSAGE,
                route=kind,
                machine=_text(machine),
                status=status,
                code=code,
            )
        )


def via(principal: Principal) -> str:
    """How somebody is known."""
    if principal.token_id is None:
        return "local" if principal.role is not Role.PUBLIC else "nobody"
    return "session" if principal.session is not None else "bearer"


def _known_or_guessing(scope: Scope, principal: Principal, code: str | None) -> bool:
    if principal.role is not Role.PUBLIC:
        return True
    return bool(scope.get(ATTEMPT_KEY)) and code in GUESSED


def _text(value: object) -> str | None:
    return None if value is None else clean(value, 64)


def _number(value: object) -> int | None:
    """The id of a job, if it can be one; with any number of zeros before it, as an address may have them."""
    text = str(value).lstrip("0")
    is_number = text.isascii() and text.isdecimal() and len(text) <= len(str(MAX_JOB))
    return int(text) if is_number and int(text) <= MAX_JOB else None
