"""What becomes of a job in which the daemon itself has a fault: it is interrupted, says so, and nothing more goes out.

Not the faults of a machine or a file; those are events and outcomes (jobs/). The one rule: what is with the machine is
in doubt until the machine has said what became of it; nobody guesses how far a step came that was broken off.
"""

import logging

from jobs.effects import Effect
from jobs.runner import Runner

log = logging.getLogger(__name__)


def interrupted(runner: Runner | None, error: Exception) -> list[Effect]:
    """The effects of `error`, which was raised in a step of this runner. Without one it is raised again."""
    if runner is None:
        raise error
    effects = runner.broken(f"{type(error).__name__}: {error}")
    level = logging.ERROR if effects else logging.DEBUG  # once: it may come again with every event
    log.log(level, "job %d is interrupted: a fault of the daemon", runner.job_id, exc_info=error)
    return effects
