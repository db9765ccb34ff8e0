"""A job followed to its end, with a progress bar where there is a terminal. Shared by `submit --watch` and `demo`.

The one rule: what the bar shows is lines *done*, never lines sent.
"""

import time
from collections.abc import Callable, Mapping
from typing import Any

from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn

from server.cli.common import CliError, ExitCode, safe, terminal

POLL_S = 0.25
"""Between two looks at a job; a bar does not need more, and the daemon answers from memory."""
MAX_SILENCE_S = 30.0
"""A daemon that is being restarted is waited for this long."""
NARROW = 0.2
"""A range that is no wider than this part of the estimate is told as one figure."""
ENDED = frozenset({"completed", "failed", "cancelled", "interrupted"})
"""Nothing happens after these without a person: `interrupted` needs a decision."""

Sleep = Callable[[float], None]
Fetch = Callable[[], Mapping[str, Any]]


def describe(job: Mapping[str, Any]) -> str:
    """The status of a job in a few words, with what it waits for or why it ended."""
    status = str(job["status"])
    if status == "waiting":
        return f"waiting for an operator: {_wanted(job)}"
    if status == "queued" and (hold := job.get("hold_reason")):
        return f"queued, on hold: {safe(hold['message'])}"
    error = job.get("error")
    if not error:
        return safe(status)
    return f"{safe(status)}: {safe(error['message'])}{doubt(error)}"


def doubt(error: Mapping[str, Any]) -> str:
    """Which lines may or may not have been executed."""
    if error.get("line_from") is None:
        return ""
    return f" (lines {error['line_from']} to {error['line_to']} in doubt)"


def _wanted(job: Mapping[str, Any]) -> str:
    tool = job.get("tool")
    return "a decision" if tool is None else f"tool {safe(tool)}"


def follow(fetch: Fetch, title: str, *, sleep: Sleep = time.sleep) -> Mapping[str, Any]:
    """Show the bar until the job has ended; the job as it is then.

    Raises CliError when the daemon is silent for MAX_SILENCE_S.
    """
    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TextColumn("{task.fields[lines]}"))
    console = terminal(stderr=True)
    with Progress(*columns, TimeElapsedColumn(), console=console, disable=not console.is_terminal) as progress:
        task = progress.add_task(safe(title), total=None, lines="")
        while True:
            job = _patiently(fetch, sleep)
            now = job["progress"]
            lines = ", ".join(part for part in (f"{now['line']}/{now['lines']} lines", left(now)) if part)
            text = f"{safe(title)}: {describe(job)}"
            # What follows the last block (a `%`, a comment) is never executed, so it is never done either.
            done = now["lines"] if job["status"] == "completed" else now["line"]
            progress.update(task, total=now["lines"], completed=done, description=text, lines=lines)
            if job["status"] in ENDED:
                return job
            sleep(POLL_S)


def left(progress: Mapping[str, Any]) -> str:
    """How long a job will still take: `about 12 min left`, or a range while it is uncertain; empty where not known."""
    seconds = progress.get("seconds_left")
    if seconds is None:
        return ""
    least, most = (progress.get(name) for name in ("seconds_left_min", "seconds_left_max"))
    if least is None or most is None or most - least <= NARROW * seconds or _duration(least) == _duration(most):
        return f"about {_duration(seconds)} left"
    shortest, longest = _duration(least), _duration(most)
    for unit in (" s", " min"):
        if shortest.endswith(unit) and longest.endswith(unit) and " h " not in longest:
            shortest = shortest.removesuffix(unit)
    return f"{shortest} to {longest} left"


def _duration(seconds: float) -> str:
    """As people say it: no seconds beyond a minute and a half, no hours below one and a half."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60)
    return f"{minutes} min" if minutes < 90 else f"{minutes // 60} h {minutes % 60} min"


def _patiently(fetch: Fetch, sleep: Sleep) -> Mapping[str, Any]:
    silence_s = 0.0
    while True:
        try:
            return fetch()
        except CliError as error:
            if error.code is not ExitCode.UNREACHABLE or silence_s >= MAX_SILENCE_S:
                raise
        sleep(1.0)
        silence_s += 1.0
