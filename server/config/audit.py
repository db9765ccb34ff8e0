"""`[audit]` as a model: how much is kept of who has asked for what. Not the rows (audit.py).

The one rule: it has a bound from the start, unlike the history: what somebody clicked is worth less than what a machine
did, and a script that asks all day must not fill a disk.
"""

from typing import Annotated

from pydantic import Field

from server.config.section import Section

MAX_ROWS = 100_000_000
MAX_DAYS = 36_500


class AuditConfig(Section):
    """`[audit]`."""

    keep_rows: Annotated[int, Field(ge=1000, le=MAX_ROWS)] = 500_000
    keep_days: Annotated[int, Field(ge=0, le=MAX_DAYS)] = 0
