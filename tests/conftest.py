"""The order of the tests. The one rule: those with a browser come last in their process, wherever they are named.

Playwright keeps an event loop running in the main thread as long as a browser is open, and no test with a loop of its
own could run behind it.
"""

import pytest


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Stable: everything else stays in its order."""
    items.sort(key=lambda item: "tests/web/" in item.nodeid)
