"""What holds for all tests: their order, and what spares time: compiled code is kept, the collector has less to do.

Not fixtures: those stand with the tests that share them. The one rule: tests with a browser come last in their process,
wherever they are named. Playwright keeps an event loop running in the main thread as long as a browser is open, and no
test with a loop of its own could run behind it.
"""

import gc
import os
import sys

import pytest
from hypothesis import settings

# The same examples in each run, and no judgement by the clock: a loaded machine is no fault of what is tested. What a
# test says of its own settings goes on top.
settings.register_profile("millstream", deadline=None, derandomize=True, database=None)
settings.load_profile("millstream")

# Each daemon and virtual machine that a test starts would compile all of it anew, a second each; and so would the next
# run the tests.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False


def pytest_addoption(parser: pytest.Parser) -> None:
    """`--long`: what tests/harness/effort.py is about."""
    parser.addoption("--long", action="store_true", help="try ten times as many examples, seeds and crash points")


def pytest_configure(config: pytest.Config) -> None:
    """By the environment, because all of this is read at import, in every process of the run."""
    if config.getoption("long"):
        os.environ["MILLSTREAM_LONG_TESTS"] = "1"


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Stable: everything else stays in its order."""
    items.sort(key=lambda item: "tests/web/" in item.nodeid)


def pytest_collection_finish() -> None:
    """What stays until the end, ten thousand tests above all, is not looked through for rubbish again and again."""
    gc.collect()
    gc.freeze()
