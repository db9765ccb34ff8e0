"""A real browser in front of a real daemon with a virtual mill, for the tests of the dashboard.

Chromium of the system, driven by Playwright. The one rule: a page that says anything on its console, throws, or runs
against the security policy fails its test, unless the test has said before that it will.
"""

import os
import re
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx
import pytest
from playwright.sync_api import Browser, BrowserContext, CDPSession, ConsoleMessage, Page, expect, sync_playwright

from tests.harness.process import Daemon

CHROMIUM = next(
    (path for name in ("chromium", "chromium-browser", "google-chrome") if (path := shutil.which(name))), None
)
FLAGS = (
    "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync",
)  # fmt: skip
FIRST_BYTES = 250 * 1024
"""Of a first visit, before a path is opened; packed."""
WITHIN_MS = 20_000
"""For everything that takes a moment on a computer that has nothing else to do."""
AXE = Path(__file__).parents[1] / "web" / "vendor" / "axe.js"
DESK, TABLET, PHONE = (1920, 1080), (1024, 768), (390, 844)


def needs_chromium() -> None:
    """Skip loudly where there is no browser, or fail where there must be one."""
    if CHROMIUM is None:
        if os.environ.get("REQUIRE_BROWSER"):
            pytest.fail("REQUIRE_BROWSER is set, and there is no Chromium: apt-get install chromium")
        pytest.skip("Chromium is not installed: THE DASHBOARD WAS NOT TESTED HERE")


@contextmanager
def chromium() -> Iterator[Browser]:
    """The browser, for all tests of a process."""
    needs_chromium()
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, headless=True, args=list(FLAGS))
        yield browser
        browser.close()


@dataclass
class Screen:
    """One person's browser. `allowed`: what its console may say, as regular expressions."""

    context: BrowserContext
    page: Page
    url: str
    said: list[str] = field(default_factory=list)
    allowed: list[str] = field(default_factory=list)

    def go(self, place: str = "") -> None:
        """To a place of the dashboard, as `mill/jobs`, and wait until it is alive."""
        self.page.goto(f"{self.url}/#/{place}")
        expect(self.named("connection")).to_have_class(re.compile("live"))

    def named(self, name: str) -> Any:
        """The element that the pages call so."""
        return self.page.locator(f'[data-name="{name}"]')

    def press(self, name: str) -> None:
        """Press a button, which must be one that can be pressed."""
        button = self.named(name)
        expect(button).not_to_have_attribute("aria-disabled", "true")
        button.click()

    def status(self, *wanted: str) -> None:
        """Wait for the machine's state in the band."""
        expect(self.named("band")).to_have_attribute("data-status", re.compile(f"^({'|'.join(wanted)})$"))

    def complaints(self) -> list[str]:
        """What the page said and nobody allowed."""
        return [one for one in self.said if not any(re.search(pattern, one) for pattern in self.allowed)]


@contextmanager
def screen(browser: Browser, url: str, size: tuple[int, int] = DESK, **options: Any) -> Iterator[Screen]:
    """A new browser with no memory of any other."""
    expect.set_options(timeout=WITHIN_MS)
    context = browser.new_context(viewport={"width": size[0], "height": size[1]}, locale="en-US", **options)
    context.set_default_timeout(WITHIN_MS)
    page = context.new_page()
    one = Screen(context, page, url)

    def hear(message: ConsoleMessage) -> None:
        if message.type in ("error", "warning"):
            one.said.append(f"{message.type}: {message.text}")

    page.on("console", hear)
    page.on("pageerror", lambda error: one.said.append(f"thrown: {error}"))
    try:
        yield one
        assert not one.complaints(), "\n".join(one.complaints())
    finally:
        context.close()


def unheld(one: Daemon) -> Daemon:
    """What a test itself asks of a machine takes the control and gives it back: the browsers are the clients."""

    def ask(request: httpx.Request, method: str) -> None:
        asked = re.fullmatch(r"/api/v1/machines/([^/]+)/(unlock|commands)", request.url.path)
        if asked is None:
            return
        body = {"takeover": True} if method == "POST" else None
        with httpx.Client(base_url=one.url, transport=httpx.HTTPTransport()) as client:
            assert client.request(method, f"/api/v1/machines/{asked[1]}/control", json=body).is_success

    one.http.event_hooks = {
        "request": [lambda request: ask(request, "POST")],
        "response": [lambda response: ask(response.request, "DELETE")],
    }
    return one


def topmost(page: Page, selector: str) -> bool:
    """Whether a finger on the middle of it would touch it and nothing above."""
    return bool(
        page.evaluate(
            """(selector) => {
                const wanted = document.querySelector(selector), box = wanted.getBoundingClientRect();
                return document.elementFromPoint(box.x + box.width / 2, box.y + box.height / 2) === wanted;
            }""",
            selector,
        )
    )


HEARD = """{
    const Plain = WebSocket;
    window.heard = 0;
    window.WebSocket = class extends Plain {
        constructor(...how) {
            super(...how);
            this.addEventListener("message", ({data}) => {
                if (data.startsWith('{"seq"')) window.heard = parseInt(data.slice(8));
            });
        }
    };
}"""
"""Put into a page before its own scripts: it remembers the number of the last message."""


def heard(page: Page) -> int:
    """That number."""
    return int(page.evaluate("window.heard"))


def heap_bytes(session: CDPSession) -> int:
    """What the page keeps, after all that nobody needs is gone."""
    session.send("HeapProfiler.collectGarbage")
    return int(session.send("Runtime.getHeapUsage")["usedSize"])


def serious(page: Page, *rules: str) -> list[str]:
    """What axe-core finds serious or critical on the page as it stands; of all its rules, or of these."""
    if not page.evaluate("'axe' in window"):
        page.evaluate(f"{AXE.read_text(encoding='utf-8')}; 0")
    options = {"resultTypes": ["violations"], **({"runOnly": {"type": "rule", "values": rules}} if rules else {})}
    found = page.evaluate("(options) => axe.run(document, options).then(({violations}) => violations)", options)
    return [
        f"{one['id']} ({one['impact']}): {node['html'][:160]} {node['failureSummary'][:300]}"
        for one in found
        if one["impact"] in ("serious", "critical")
        for node in one["nodes"]
    ]


class Traffic:
    """What a page fetches from now on: the bodies as they go over the network, packed, without the headers."""

    def __init__(self, page: Page) -> None:
        self.requests: dict[str, str] = {}
        self._heads: dict[str, float] = {}
        self._bytes: dict[str, float] = {}
        self._session = page.context.new_cdp_session(page)
        self._session.on("Network.requestWillBeSent", lambda event: self._asked(event["requestId"], event["request"]))
        self._session.on("Network.responseReceived", lambda event: self._began(event["requestId"], event["response"]))
        self._session.on("Network.loadingFinished", lambda event: self._came(event["requestId"], event))
        self._session.send("Network.enable")

    def _asked(self, id: str, request: Any) -> None:
        self.requests[id] = request["url"]

    def _began(self, id: str, response: Any) -> None:
        self._heads[id] = response["encodedDataLength"]

    def _came(self, id: str, event: Any) -> None:
        self._bytes[id] = event["encodedDataLength"] - self._heads.get(id, 0)

    def bytes(self) -> int:
        """Of all that has come so far."""
        return int(sum(self._bytes.values()))
