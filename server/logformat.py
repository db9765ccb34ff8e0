"""How the log is written: with the time for people and files; for systemd's journal, which has its own, with the level.

Not what is logged. The one rule: the journal is told the level by the number that it knows (sd-daemon(3)), so that
`journalctl -p warning` shows what somebody has to see.
"""

import logging
import os
import sys
from collections.abc import Mapping

PLAIN = "%(asctime)s %(levelname)-7s %(name)s: %(message)s"
BARE = "%(name)s: %(message)s"
PRIORITIES = ((logging.ERROR, 3), (logging.WARNING, 4), (logging.INFO, 6), (logging.NOTSET, 7))
"""From this level on, that priority of syslog(3)."""


def log_handler(environ: Mapping[str, str]) -> logging.Handler:
    """To standard error, as whoever reads it likes it."""
    handler = logging.StreamHandler()
    handler.setFormatter(JournalFormatter(BARE) if is_journal(environ) else logging.Formatter(PLAIN))
    return handler


def is_journal(environ: Mapping[str, str]) -> bool:
    """Whether standard error goes to the journal: JOURNAL_STREAM names it, also to children that write elsewhere."""
    try:
        there = os.fstat(sys.stderr.fileno())
    except (OSError, ValueError, AttributeError):
        return False
    return environ.get("JOURNAL_STREAM") == f"{there.st_dev}:{there.st_ino}"


class JournalFormatter(logging.Formatter):
    """Each line of a record with its priority: the journal takes lines."""

    def format(self, record: logging.LogRecord) -> str:
        priority = next(number for level, number in PRIORITIES if record.levelno >= level)
        return "\n".join(f"<{priority}>{line}" for line in super().format(record).splitlines())
