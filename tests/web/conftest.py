"""What the tests of the dashboard share: one browser and one daemon with a virtual mill for all tests of a process.

To start a daemon takes seconds: a test leaves the mill as it found it (`mill` sees to that) and counts on no number of
a job. A test that stops the daemon, or needs another one, has one of its own.
"""

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from typing import Any

import pytest
from playwright.sync_api import Browser

from tests.harness.browser import Screen, chromium, screen, unheld
from tests.harness.process import MACHINE, Daemon, daemon, until

MILL = "sim:?speed_factor=4"
GRBL = "sim:?speed_factor=3"
REACH = "motion = {travel = {x = [-200.0, 0.0], y = [-200.0, 0.0], z = [-60.0, 0.0]}}"
OPEN = "queued,checking,running,paused,waiting,interrupted"


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    with chromium() as one:
        yield one


@pytest.fixture(scope="session")
def shared(browser: Browser, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    with daemon(tmp_path_factory.mktemp("dashboard"), MILL) as one:
        yield unheld(one.connected())


@pytest.fixture(scope="session")
def shared_grbl(browser: Browser, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    with daemon(tmp_path_factory.mktemp("grbl"), GRBL, grbl="", machine=REACH) as one:
        yield one.connected()


@pytest.fixture
def grbl(shared_grbl: Daemon) -> Daemon:
    """A daemon with a connected virtual Grbl; each test leaves the controller as it was."""
    return shared_grbl


@pytest.fixture
def mill(shared: Daemon) -> Iterator[Daemon]:
    """A daemon with a connected, idle virtual mill and an empty queue."""
    yield shared
    machine = f"/machines/{MACHINE}"
    if shared.get(machine)["link"] == "disconnected":
        shared.post(f"{machine}/connect")
    shared.connected()
    for status in ("queued", "checking,running,paused,waiting,interrupted"):
        for job in shared.get(f"/jobs?status={status}"):
            shared.http.post(f"/api/v1/jobs/{job['id']}/cancel")
    if shared.get(machine)["state"]["status"] == "alarm":
        shared.post(f"{machine}/unlock")
    until(lambda: shared.get(machine)["state"]["status"] == "idle" and not shared.get(f"/jobs?status={OPEN}"))


@pytest.fixture
def screens(browser: Browser) -> Iterator[Callable[..., Screen]]:
    """Opens browsers on an address; at the end none of them may have complained."""
    with ExitStack() as stack:
        yield lambda url, *arguments, **options: stack.enter_context(screen(browser, url, *arguments, **options))


@pytest.fixture
def person(mill: Daemon, screens: Callable[..., Any]) -> Screen:
    """Somebody in front of the dashboard."""
    one: Screen = screens(mill.url)
    one.go()
    return one
