"""What of a socket's messages goes into the audit: each wish of a person once, however often it is repeated.

Not the rows (audit.py), nor those of requests over HTTP (api/audittrail.py). The one rule: a heartbeat is no wish. A
held jog is one row for each hold, and the pins of a tool changer are one for each connection: what they did then stands
in the history of the changer.
"""

import asyncio
from typing import Protocol

from starlette.types import Scope

from server.access.auth import Principal
from server.api.audittrail import Trail
from server.api.guard import GONE
from server.api.messages import Io, Jog, Spoken, Subscribe
from server.problems import ProblemError

SAME_HOLD_S = 1.0
"""A held jog that is repeated within this, refused or not, is the same hold."""
DONE = 200


class Audited(Protocol):
    """To be told what became of a message."""

    def __call__(self, problem: ProblemError | None, *, gone: bool = False) -> None: ...


class MessageTrail:
    """The rows of one connection."""

    def __init__(self, trail: Trail, scope: Scope, principal: Principal) -> None:
        self._trail = trail
        self._scope = scope
        self._principal = principal
        self._held_at: dict[str | None, float] = {}
        self._changing: set[str | None] = set()

    def note(self, message: Spoken | None, problem: ProblemError | None = None) -> None:
        """A message that was answered at once; None: it was none."""
        if message is not None:
            self.begun(message)(problem)

    def begun(self, message: Spoken) -> Audited:
        """A message that is answered later."""
        if not self._wanted(message):
            return _nothing
        said = message.model_dump(include={"type", "machine"})
        kind, machine = said["type"], said.get("machine")

        def audited(problem: ProblemError | None, *, gone: bool = False) -> None:
            status = GONE if gone else DONE if problem is None else problem.status
            code = None if problem is None else problem.code
            self._trail.message(self._scope, self._principal, kind, machine, status, code)

        return audited

    def _wanted(self, message: Spoken) -> bool:
        match message:
            case Subscribe():
                return False
            case Jog(hold=True, machine=machine):
                now = asyncio.get_running_loop().time()
                last = self._held_at.get(machine)
                self._held_at[machine] = now
                return last is None or now - last > SAME_HOLD_S
            case Io(machine=machine):
                is_first = machine not in self._changing
                self._changing.add(machine)
                return is_first
            case _:
                return True


def _nothing(problem: ProblemError | None, *, gone: bool = False) -> None:
    """For what goes into no row."""
