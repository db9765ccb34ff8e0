"""The log for people and for systemd's journal."""

import logging
import os
import sys
from pathlib import Path

import pytest

from server.logformat import BARE, PLAIN, JournalFormatter, is_journal, log_handler


def record(level: int, text: str) -> logging.LogRecord:
    return logging.LogRecord("server.machine", level, __file__, 1, text, None, None)


@pytest.mark.parametrize(
    ("level", "priority"),
    [(logging.CRITICAL, 3), (logging.ERROR, 3), (logging.WARNING, 4), (logging.INFO, 6), (logging.DEBUG, 7), (1, 7)],
)
def test_each_line_has_the_priority_of_its_level(level: int, priority: int) -> None:
    said = JournalFormatter(BARE).format(record(level, "one\ntwo"))
    assert said == f"<{priority}>server.machine: one\n<{priority}>two"


def test_a_fault_of_ours_is_an_error_in_every_line() -> None:
    try:
        raise ZeroDivisionError
    except ZeroDivisionError:
        one = record(logging.ERROR, "unexpected")
        one.exc_info = sys.exc_info()
    lines = JournalFormatter(BARE).format(one).splitlines()
    assert len(lines) > 2
    assert all(line.startswith("<3>") for line in lines)


def test_the_journal_is_known_by_the_file_that_it_names(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with (tmp_path / "err").open("w") as file:
        monkeypatch.setattr(sys, "stderr", file)
        there = os.fstat(file.fileno())
        named = {"JOURNAL_STREAM": f"{there.st_dev}:{there.st_ino}"}
        assert is_journal(named)
        assert isinstance(log_handler(named).formatter, JournalFormatter)
        assert not is_journal({"JOURNAL_STREAM": f"{there.st_dev}:{there.st_ino + 1}"}), "it was led elsewhere"
        plain = log_handler({}).formatter
        assert plain is not None
        assert plain._fmt == PLAIN
    assert not is_journal(named), "a standard error that is closed is no journal"
