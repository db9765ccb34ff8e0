"""`[history]` as a model: how long ended jobs, their journals and programs are kept. Not the removal (retention.py).

The one rule: nothing is ever removed that nobody has said may go. All of these are 0 unless somebody sets them.
"""

from typing import Annotated

from pydantic import Field

from server.config.section import Section

MAX_DAYS = 36_500
MAX_JOBS = 10_000_000


class HistoryConfig(Section):
    """`[history]`. 0: without an end."""

    keep_days: Annotated[int, Field(ge=0, le=MAX_DAYS)] = 0
    keep_jobs: Annotated[int, Field(ge=0, le=MAX_JOBS)] = 0
    keep_unused_programs_days: Annotated[int, Field(ge=0, le=MAX_DAYS)] = 0

    @property
    def removes(self) -> bool:
        """Whether anything is ever removed."""
        return any((self.keep_days, self.keep_jobs, self.keep_unused_programs_days))
