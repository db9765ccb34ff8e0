"""Why a job that waits does so on hold: a code for scripts, a sentence for people, as it stands in the job's row.

Not whether it is on hold (store.py) and not who may let it go. The one rule: whoever puts a job on hold says why.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, slots=True)
class Hold:
    """Why. `code` is one of HOLD_CODES, or that of the refusal that kept the job from beginning."""

    code: str
    message: str


HOLD_CODES: Mapping[str, str] = {
    "asked": "Somebody has put it on hold.",
    "job_ended": "The job before it was not completed: somebody has to look first.",
    "restarted": "The daemon was started anew: nothing begins by that.",
    "restored": "An archive was restored: nothing begins by that.",
}
"""docs/api.md lists them. All other codes are those of a problem: the machine could not take the job."""
ASKED, JOB_ENDED, RESTARTED, RESTORED = (Hold(code, message) for code, message in HOLD_CODES.items())


def hold_view(row: Mapping[str, Any]) -> dict[str, Any] | None:
    """Of a job's row, as the API shows it; None where it does not wait on hold, or nobody has said why."""
    if row["status"] != "queued" or not row["hold"] or row["hold_code"] is None:
        return None
    return {"code": row["hold_code"], "message": row["hold_message"]}
