"""What a job can be, what it can become, and how its troubles are named. Not its rows (store.py), not its running.

The one rule: a status changes only along `TRANSITIONS`; anything else is a bug of ours and raises. The diagram in
docs/job-states.md is made from the same table (`python -m jobs.job`).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from protocol.errors import LocalError


class Status(StrEnum):
    """The words of the API, in the order of a job's life."""

    QUEUED = "queued"
    CHECKING = "checking"
    RUNNING = "running"
    PAUSED = "paused"
    WAITING = "waiting"
    COMPLETED = "completed"
    FAILED = "failed"
    CANCELLED = "cancelled"
    INTERRUPTED = "interrupted"


S = Status

# queued: nobody has asked the machine for anything. checking: the program is read and planned; nothing is sent; a
# pause that is asked meanwhile leads to `paused` without a line sent.
# From `running` on lines may have been executed, so every way out names what is certain. `paused` and `waiting` mean
# that the machine stands still. `interrupted` is not an end: somebody has to decide (recover or cancel).
TRANSITIONS: Mapping[Status, frozenset[Status]] = {
    S.QUEUED: frozenset({S.CHECKING, S.CANCELLED}),
    S.CHECKING: frozenset({S.RUNNING, S.PAUSED, S.QUEUED, S.FAILED, S.CANCELLED}),
    S.RUNNING: frozenset({S.PAUSED, S.WAITING, S.COMPLETED, S.FAILED, S.CANCELLED, S.INTERRUPTED}),
    S.PAUSED: frozenset({S.RUNNING, S.WAITING, S.COMPLETED, S.FAILED, S.CANCELLED, S.INTERRUPTED}),
    S.WAITING: frozenset({S.RUNNING, S.PAUSED, S.COMPLETED, S.FAILED, S.CANCELLED, S.INTERRUPTED}),
    S.INTERRUPTED: frozenset({S.RUNNING, S.PAUSED, S.CANCELLED}),
    S.COMPLETED: frozenset(),
    S.FAILED: frozenset(),
    S.CANCELLED: frozenset(),
}

ENDED = frozenset(status for status, after in TRANSITIONS.items() if not after)
"""Nothing comes after these."""
ACTIVE = frozenset({S.CHECKING, S.RUNNING, S.PAUSED, S.WAITING, S.INTERRUPTED})
"""At most one job of a machine is in one of these: the machine is at its disposal or waits for a decision on it."""
MOVING = frozenset({S.CHECKING, S.RUNNING, S.PAUSED, S.WAITING})
"""The job owns the machine: nothing is run by hand beside it."""


def check_transition(before: Status, after: Status) -> None:
    """Raises LocalError when the table does not know this change."""
    if after not in TRANSITIONS[before]:
        raise LocalError(f"a job does not go from {before} to {after}")


@dataclass(frozen=True, slots=True)
class JobError:
    """Why a job stopped. Lines `line_from` to `line_to` are in doubt: executed wholly, partly or not at all.

    Without lines nothing is in doubt: everything up to the job's `line_done` was executed and nothing after it.
    """

    code: str
    message: str
    line_from: int | None = None
    line_to: int | None = None

    def view(self) -> dict[str, Any]:
        """As the API shows it."""
        return {"code": self.code, "message": self.message, "line_from": self.line_from, "line_to": self.line_to}


ERROR_CODES: Mapping[str, str] = {
    "machine_error": "the machine answered ERROR to a batch",
    "alarm": "the machine went into alarm",
    "estop": "the emergency stop was demanded",
    "line_refused": "the machine refused a line and is held: lines `line_from` to `line_to` are inside and go on",
    "lines_refused": "the controller's own check refused lines of the program",
    "machine_reset": "the controller was reset by hand in the middle of the job",
    "machine_restarted": "the machine lost its memory in the middle of the job: its position is unknown",
    "in_doubt": "it cannot be known whether the last batches were executed",
    "link_lost": "the link broke; the controller may have been reset meanwhile (grbl)",
    "check_mode": "the controller left its check mode in a check, or was in it in a job (grbl)",
    "break_too_long": "the link was broken for longer than resume_within",
    "cancelled_in_doubt": "cancelled while the fate of the last batch was unknown",
    "preflight_failed": "the program does not pass the check for this machine",
    "tool_change_failed": "the tool was not changed: the changer, or the operator, says that it cannot be",
    "no_tool_word": "a tool change (M6) without a T word that says which tool",
    "program_missing": "the file of the program cannot be read",
    "internal": "a fault of the daemon; its log has the rest",
    "not_plannable": "a line of the program cannot be sent to this machine",
}
"""Every code of a JobError; docs/api.md lists them."""


def diagram() -> str:
    """The table as a Mermaid state diagram in Markdown."""
    lines = [
        "# The states of a job",
        "",
        "Made from the table in `jobs/job.py` by `python -m jobs.job`; a test keeps it true.",
        "",
        "```mermaid",
        "stateDiagram-v2",
        "    [*] --> queued",
    ]
    lines += [f"    {a} --> {b}" for a, after in TRANSITIONS.items() for b in Status if b in after]
    lines += [f"    {status} --> [*]" for status in Status if status in ENDED]
    return "\n".join([*lines, "```", ""])


if __name__ == "__main__":
    print(diagram(), end="")  # noqa: T201 - the output is the purpose
