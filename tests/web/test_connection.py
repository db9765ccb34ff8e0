"""A daemon that dies, hangs, or wants to know who is there: what people see of it, in a real browser.

Not how soon a silence is noticed: test_socket.mjs holds that against a clock of its own, which no other work of the
computer delays.
"""

import os
import re
import signal
from collections.abc import Callable, Iterator

import pytest
from playwright.sync_api import Browser, expect

from tests.harness.browser import Screen, serious
from tests.harness.process import Daemon, daemon

pytestmark = pytest.mark.real

REFUSED = r"net::ERR_|WebSocket connection to .* failed"


@pytest.fixture(scope="module")
def own(browser: Browser, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    """A daemon that these tests stop; it is back at the end of each."""
    with daemon(tmp_path_factory.mktemp("own"), "sim:") as one:
        yield one.connected()


@pytest.fixture(scope="module")
def guarded(browser: Browser, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    """A daemon that asks for a token."""
    with daemon(tmp_path_factory.mktemp("guarded"), "sim:") as one:
        one.connected()
        admin = one.post("/tokens", {"name": "boss", "role": "admin"})["token"]
        one.http.headers["Authorization"] = f"Bearer {admin}"
        yield one


def alive(one: Screen) -> None:
    expect(one.named("connection")).to_have_class(re.compile("live"))
    expect(one.named("lost")).to_have_count(0)
    expect(one.page.locator(".shell")).not_to_have_class(re.compile("stale"))


def test_a_daemon_that_hangs_is_noticed_and_comes_back(own: Daemon, screens: Callable[..., Screen]) -> None:
    one = screens(own.url)
    one.allowed.append(REFUSED)
    one.go()
    alive(one)
    os.kill(own.pid, signal.SIGSTOP)  # nothing is closed: only silence tells
    try:
        expect(one.named("lost")).to_be_visible()
        expect(one.page.locator(".shell")).to_have_class(re.compile("stale"))
        for button in ("start", "home", "unlock"):
            expect(one.named(button)).to_have_attribute("aria-disabled", "true")
        assert one.page.locator("#estop").is_visible()
        assert serious(one.page) == [], "old figures are still read"
    finally:
        os.kill(own.pid, signal.SIGCONT)
    alive(one)


def test_a_daemon_that_died_and_was_started_again_is_found_again(own: Daemon, screens: Callable[..., Screen]) -> None:
    one = screens(own.url)
    one.allowed.append(REFUSED)
    one.go()
    port = own.url.rpartition(":")[2]
    own.kill9()
    expect(one.named("lost")).to_be_visible()
    one.page.locator("#estop").click()
    expect(one.page.locator("#estop-result")).to_have_class("failed")
    expect(one.page.locator("#estop-result")).to_contain_text("NOT STOPPED")
    file = own.folder / "millstream.toml"
    file.write_text(file.read_text().replace("port = 0", f"port = {port}"))
    own.start().connected()
    alive(one)
    one.status("idle")


def test_who_has_no_token_signs_in_and_a_viewer_only_looks(guarded: Daemon, screens: Callable[..., Screen]) -> None:
    admin = guarded.http.headers["Authorization"].removeprefix("Bearer ")
    viewer = guarded.post("/tokens", {"name": "screen", "role": "viewer"})["token"]
    one = screens(guarded.url)
    one.allowed.append(r"status of 401")
    one.page.goto(guarded.url)
    token, button = one.page.locator("input[name=token]"), one.page.get_by_role("button", name="Sign in")
    expect(token).to_be_visible()
    assert serious(one.page) == []
    token.fill("mill_wrong")
    button.click()
    expect(one.page.get_by_role("alert").filter(has_text="token")).to_be_visible()
    token.fill(viewer)
    button.click()
    expect(one.named("connection")).to_have_text("live, read only")
    for control in ("start", "home", "disconnect"):
        expect(one.named(control)).to_have_attribute("aria-disabled", "true")
    expect(one.named("start")).to_contain_text("read only")
    one.named("menu").click()
    one.named("sign-out").click()
    token.fill(admin)
    button.click()
    expect(one.named("connection")).to_have_text("live")
    expect(one.named("home")).not_to_have_attribute("aria-disabled", "true")


def test_a_token_that_is_revoked_puts_its_browser_out(guarded: Daemon, screens: Callable[..., Screen]) -> None:
    guest = guarded.post("/tokens", {"name": "guest", "role": "operator"})
    one = screens(guarded.url)
    one.allowed.append(r"status of 401|WebSocket connection to .* failed|status of 403")
    one.page.goto(guarded.url)
    one.page.locator("input[name=token]").fill(guest["token"])
    one.page.get_by_role("button", name="Sign in").click()
    expect(one.named("connection")).to_have_text("live")
    assert guarded.http.delete(f"/api/v1/tokens/{guest['id']}").is_success
    expect(one.page.locator("input[name=token]")).to_be_visible()
