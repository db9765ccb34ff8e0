"""What holds for all tests: their order, and what spares time: compiled code is kept, the collector has less to do, and
no test waits for a disk.

Not fixtures: those stand with the tests that share them. The one rule: tests with a browser come last in their process,
wherever they are named. Playwright keeps an event loop running in the main thread as long as a browser is open, and no
test with a loop of its own could run behind it.
"""

import gc
import os
import sys
from pathlib import Path

import pytest
from hypothesis import settings

# Each daemon and virtual machine that a test starts would compile all of it anew, a second each; and so would the next
# run the tests.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

EXAMPLES = 50
"""Of a property that says nothing itself."""
MEMORY = Path("/dev/shm")
ENOUGH_BYTES = 2 << 30
"""A run has some tens of megabytes at once."""


def in_memory() -> bool:
    """Whether the tests' folders may be there. What is killed in a test is a process, never this computer: what it
    has written stays without any disk, and each sync of a database is one that nobody waits for."""
    if not (MEMORY.is_dir() and os.access(MEMORY, os.W_OK)):
        return False
    there = os.statvfs(MEMORY)
    return there.f_bavail * there.f_frsize >= ENOUGH_BYTES and not there.f_flag & os.ST_NOEXEC


if in_memory():
    os.environ.setdefault("PYTEST_DEBUG_TEMPROOT", str(MEMORY))


def pytest_addoption(parser: pytest.Parser) -> None:
    """`--long`: what tests/harness/effort.py is about."""
    parser.addoption("--long", action="store_true", help="try ten times as many examples, seeds and crash points")


def pytest_configure(config: pytest.Config) -> None:
    """By the environment, because all of this is read at import, in every process of the run."""
    if config.getoption("long"):
        os.environ["MILLSTREAM_LONG_TESTS"] = "1"
    from tests.harness.effort import more

    # The same examples in each run, and no judgement by the clock: a loaded machine is no fault of what is tested. What
    # a test says of its own settings goes on top.
    settings.register_profile("millstream", deadline=None, derandomize=True, database=None, max_examples=more(EXAMPLES))
    settings.load_profile("millstream")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Stable: everything else stays in its order."""
    items.sort(key=lambda item: "tests/web/" in item.nodeid)


def pytest_collection_finish() -> None:
    """What stays until the end, ten thousand tests above all, is not looked through for rubbish again and again."""
    gc.collect()
    gc.freeze()
