"""How a job stopped, and the words for it: codes for scripts, sentences for people.

Not when it stops, nor which cause outweighs which: that is runner.py. The one rule: every code that a job's error can
have by what the machine or the link did stands here.
"""

from dataclasses import dataclass
from typing import assert_never

from jobs.job import Status
from protocol.events import BatchFailed


@dataclass(frozen=True, slots=True)
class Outcome:
    """How the job stopped; the lines in doubt are derived from what is open and doubtful."""

    status: Status
    code: str = ""
    message: str = ""


MACHINE_GONE = Outcome(
    Status.INTERRUPTED, "machine_restarted", "The machine restarted in the middle of the job: its position is unknown."
)
ESTOP_DEMANDED = Outcome(Status.FAILED, "estop", "The emergency stop was demanded.")
CANCELLED_UNASKED = Outcome(Status.CANCELLED, "cancelled_in_doubt", "Cancelled while the machine could not be asked.")


def alarm(message: str) -> Outcome:
    """The machine says that it is in alarm."""
    return Outcome(Status.FAILED, "alarm", f"The machine is in alarm. {message}".strip())


def failure(event: BatchFailed) -> Outcome | None:
    """A batch was not executed to its end. None: whoever caused that says what it means for the job."""
    match event.reason:
        case "restart":
            return MACHINE_GONE
        case "error":
            number = "" if event.code is None else f" {event.code}"
            return Outcome(
                Status.FAILED, "machine_error", f"The machine answered ERROR{number}. {event.message}".strip()
            )
        case "alarm":
            return alarm(event.message)
        case "estop":
            return Outcome(Status.FAILED, "estop", event.message or "The emergency stop was pressed.")
        case "stop" | "link":
            return None
        case _:
            assert_never(event.reason)


def in_doubt(reason: str) -> Outcome:
    """What became of the last batches cannot be found out."""
    return Outcome(Status.INTERRUPTED, "in_doubt", reason)


def break_too_long(resume_within_s: float) -> Outcome:
    """The link came back too late for going on without asking (elvinto §5.5)."""
    message = f"The link was broken for longer than resume_within ({resume_within_s:g} s)."
    return Outcome(Status.INTERRUPTED, "break_too_long", message)
