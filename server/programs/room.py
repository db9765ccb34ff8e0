"""How much room programs may take: of the disk, where the journal must always find some, and in all.

Not the upload (programs/service.py). The one rule: what runs out first is the room for uploads, never that for the
journal of a running job.
"""

import shutil
from pathlib import Path

from sqlite_utils import Database

from server.config.limits import LimitsConfig
from server.problems import ProblemError

LOOK_EVERY_BYTES = 16 * 1024 * 1024
"""Of an upload: the disk is looked at again; others write, too."""


class Room:
    """Of the folder `folder`, with these limits."""

    def __init__(self, folder: Path, limits: LimitsConfig) -> None:
        self._folder = folder
        self._limits = limits

    def check_disk(self) -> None:
        """Raises ProblemError when uploads would take what is kept free for the journal. Reads the disk."""
        free, reserve = shutil.disk_usage(self._folder).free, self._limits.disk_reserve_bytes
        if free < reserve:
            raise ProblemError(
                "disk_full",
                f"The disk has {free} bytes left, of which {reserve} are kept for the journal of running jobs "
                "(limits.disk_reserve_bytes). Nothing of the upload was kept.",
            )

    def check_total(self, stored_bytes: int, more_bytes: int, *, largest_bytes: int = 0) -> None:
        """Raises ProblemError when all programs together would be more than allowed. Up to `largest_bytes`, those of
        the largest, what comes may be one that is there already, and takes no room then."""
        limit = self._limits.programs_bytes
        if limit and stored_bytes + more_bytes > limit and more_bytes > largest_bytes:
            raise ProblemError(
                "programs_full",
                f"The programs take {stored_bytes} bytes; limits.programs_bytes allows {limit} in all. Delete some, or "
                "let history.keep_unused_programs_days do it.",
            )


def stored_bytes(db: Database) -> tuple[int, int]:
    """What all programs take, and what the largest of them does. In the database thread."""
    (row,) = db.query("select coalesce(sum(bytes), 0) as n, coalesce(max(bytes), 0) as largest from programs")
    return int(row["n"]), int(row["largest"])
