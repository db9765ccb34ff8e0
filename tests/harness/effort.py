"""How much the tests try: as much as a run of a few minutes has time for, or with `--long` many times that.

`make test ARGS=--long` sets it for all processes of a run. The one rule: what is tried without it is enough to find a
fault that somebody makes; the long run is for those that hide, before a release and by night.
"""

import os

VARIABLE = "MILLSTREAM_LONG_TESTS"
"""Set by tests/conftest.py before any other file of the tests is read: how much is tried is decided at import."""
LONG = bool(os.environ.get(VARIABLE))
TIMES = 10
"""As many examples and seeds in a long run."""


def more(count: int) -> int:
    """So many examples or seeds, in a long run more."""
    return count * TIMES if LONG else count
