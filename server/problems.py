"""Every refusal that a client can see: RFC 9457 problems with a stable `code`.

The one rule: a problem says what happened, where, and what to do now. New codes go into `CODES`; docs/api.md lists
them and a test compares.
"""

from typing import Any

from protocol.errors import MillstreamError

CODES: dict[str, tuple[int, str]] = {
    "not_found": (404, "There is nothing under this address"),
    "method_not_allowed": (405, "This address does not take this method"),
    "unknown_machine": (404, "No machine of this name is configured"),
    "unknown_program": (404, "There is no program with this id"),
    "unknown_job": (404, "There is no job with this id"),
    "unknown_backup": (404, "There is no backup with this id"),
    "unknown_token": (404, "There is no token with this id"),
    "unauthorized": (401, "A token is needed"),
    "token_expired": (401, "The time of this token is over"),
    "too_many_attempts": (429, "Too many wrong tokens came from this address"),
    "forbidden": (403, "This token's role does not allow it"),
    "bad_origin": (403, "The request comes from another site"),
    "bad_host": (421, "The daemon is not known under this host name"),
    "invalid_request": (422, "The request is not as documented"),
    "malformed_json": (400, "The body is not JSON"),
    "wrong_state": (409, "Not possible in the present state"),
    "not_connected": (409, "The machine is not connected"),
    "machine_busy": (409, "The machine is busy"),
    "job_active": (409, "A job is using the machine"),
    "alarm_active": (409, "The machine is in alarm"),
    "control_held": (409, "Somebody else moves the machine by hand"),
    "needs_force": (409, "It is dangerous and was not asked for with force"),
    "not_supported": (409, "This machine's controller cannot do it"),
    "program_in_use": (409, "A job that has not ended needs this program"),
    "idempotency_conflict": (409, "The Idempotency-Key was used for another request"),
    "preflight_failed": (422, "The program does not pass the check for this machine"),
    "preflight_warnings": (422, "The check of the program has warnings"),
    "not_a_program": (422, "The upload is not a G-code program"),
    "empty_program": (422, "The program has no blocks"),
    "no_preview": (422, "The program cannot be drawn"),
    "programs_full": (413, "The programs take as much room as is allowed"),
    "too_many_blocks": (422, "More blocks than one command may have"),
    "too_many_sockets": (429, "Too many WebSockets are open"),
    "too_large": (413, "The upload is larger than allowed"),
    "disk_full": (507, "The disk is full"),
    "database_error": (500, "The database cannot be used"),
    "command_failed": (409, "The machine refused the command"),
    "process_ended": (503, "The process for long computations was ended"),
    "no_answer": (504, "The machine did not answer in time"),
    "queue_full": (429, "Too many jobs are waiting"),
    "internal": (500, "An internal error"),
}


class ProblemError(MillstreamError):
    """A refusal. `code` is a key of CODES; `detail` is for people; `extra` goes into the JSON beside them."""

    def __init__(self, code: str, detail: str, **extra: Any) -> None:
        super().__init__(detail)
        self.status, self.title = CODES[code]
        self.code = code
        self.detail = detail
        self.extra = extra
