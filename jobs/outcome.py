"""How a job stopped, and the words for it: codes for scripts, sentences for people.

Not when it stops, nor which cause outweighs which: that is runner.py. The one rule: every code that a job's error can
have by what the machine or the link did stands here.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import assert_never

from jobs.job import JobError, Status
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
STOPPED_IN_THE_MIDDLE = Outcome(
    Status.CANCELLED, "cancelled_in_doubt", "Stopped in the middle of these lines: they may be executed in part."
)
MACHINE_RESET = Outcome(
    Status.INTERRUPTED,
    "machine_reset",
    "The controller was reset in the middle of the job and has forgotten its modes.",
)
LOST_WITH_LINES_INSIDE = Outcome(
    Status.INTERRUPTED,
    "in_doubt",
    "The link broke while lines were in the controller, which cannot tell afterwards what it has executed.",
)
LOST_STANDING = Outcome(
    Status.INTERRUPTED,
    "link_lost",
    "The link broke, and whether the controller was reset nobody can say: it may have lost modes and position.",
)
CHECK_MODE_LOST = Outcome(
    Status.INTERRUPTED, "check_mode", "The controller left its check mode in the middle of a check."
)
CHECK_MODE_FOUND = Outcome(
    Status.INTERRUPTED, "check_mode", "The controller is in its check mode: it answers lines and executes none."
)

LOST_WITHOUT_A_COUNT = Outcome(
    Status.INTERRUPTED,
    "in_doubt",
    "The link broke while a batch was being executed, and the machine counts nothing: how much of it was executed "
    "cannot be found out, and where the machine stands is not known.",
)


def held_for(said: str, inside: Sequence[int]) -> JobError:
    """A line was refused and the machine is held; `inside`: the lines that it has already and goes on with."""
    span = (min(inside), max(inside)) if inside else (None, None)
    goes_on = f"goes on with lines {span[0]} to {span[1]}, which it has already" if inside else "goes on behind it"
    return JobError("line_refused", f"{said}. The machine is held; resume {goes_on}, cancel ends the job.", *span)


def tool_change_failed(message: str) -> Outcome:
    """The changer, or the person who is one, could not change the tool."""
    return Outcome(Status.FAILED, "tool_change_failed", message)


def no_tool_word(line: int) -> Outcome:
    """An M6 and nobody knows for which tool: nothing has moved for it."""
    return Outcome(Status.FAILED, "no_tool_word", f"Line {line}: M6 without a T word before it. Nothing has moved.")


def lines_refused(count: int, first: str) -> Outcome:
    """The end of a check in which lines were refused."""
    return Outcome(Status.FAILED, "lines_refused", f"The controller refused {count} of the lines. {first}")


def alarm(message: str) -> Outcome:
    """The machine says that it is in alarm."""
    return Outcome(Status.FAILED, "alarm", f"The machine is in alarm. {message}".strip())


def failure(event: BatchFailed) -> Outcome:
    """A batch was not executed to its end, though nobody has cancelled the job."""
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
        case "stop":
            return MACHINE_RESET
        case "link":
            return in_doubt(event.message)
        case _:
            assert_never(event.reason)


def in_doubt(reason: str) -> Outcome:
    """What became of the last batches cannot be found out."""
    return Outcome(Status.INTERRUPTED, "in_doubt", reason)


def break_too_long(resume_within_s: float) -> Outcome:
    """The link came back too late for going on without asking (elvinto §5.5)."""
    message = f"The link was broken for longer than resume_within ({resume_within_s:g} s)."
    return Outcome(Status.INTERRUPTED, "break_too_long", message)


def broken(reason: str) -> Outcome:
    """A fault of the daemon in the middle of a job."""
    message = f"A fault of the daemon ({reason}): nothing more was sent. Its log has the rest."
    return Outcome(Status.INTERRUPTED, "internal", message)
