"""The dashboard in Chromium: how soon it is there, what hours of messages leave behind, a path of a million moves.

Not the tests of what it does (tests/web). The one rule: a cold start is a browser that has never seen the page, on the
daemon's own address, and the clock is the browser's.
"""

import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from playwright.sync_api import Browser, Page, expect

from bench.report import Figure, Report
from tests.harness.browser import FIRST_BYTES, HEARD, Traffic, chromium, heap_bytes, heard, screen
from tests.harness.process import MACHINE, Daemon, daemon
from tests.harness.stage import stage

TITLE = "page: the dashboard in a browser"
PARTS = ("visit", "hour", "path")
COLD_STARTS = 7
STATES = 108_000
"""Three hours: in the first half the browser compiles and fills its caches, the second has to leave nothing behind."""
ROUNDS = 12
LOWEST_OF = 3
"""Rounds: what the browser has not collected yet in one of them is no memory that is kept."""
SEGMENTS = 1_000_000
Say = Callable[[str], None]
PLACES = ("machine", "plots", "console")
TURNED_S = 4.0
PAINT = "performance.getEntriesByName('first-contentful-paint')[0]?.startTime ?? 0"
THERE = """() => new Promise((done) => {
    const look = () => document.querySelector('[data-name=connection].live')
        ? requestAnimationFrame(() => done(performance.now())) : requestAnimationFrame(look);
    look();
})"""
DRIVER = r"GL Driver Message|GPU stall"


def silent(_: str) -> None:
    """For who wants the report alone."""


def run(
    only: Sequence[str] = PARTS,
    *,
    say: Say = silent,
    states: int = STATES,
    segments: int = SEGMENTS,
    cold_starts: int = COLD_STARTS,
) -> Report:
    """The parts that are named; `say` is told each as it ends. Raises pytest's Skipped where there is no Chromium."""
    say(f"=== {TITLE}")
    groups: list[tuple[str, tuple[Figure, ...]]] = []
    with chromium() as browser, started() as shop:
        take: dict[str, tuple[str, Callable[[], list[Figure]]]] = {
            "visit": ("first visit, cold cache, loopback", lambda: first_visit(browser, shop.url, cold_starts)),
            "hour": (f"{states:,} states at 10 Hz, accelerated", lambda: memory(browser, states, say=say)),
            "path": (f"path of {segments:,} moves", lambda: preview(browser, shop, segments)),
        }
        for part in only or PARTS:
            heading, measured = take[part]
            groups.append((heading, tuple(measured())))
            say("\n".join(["", heading, *map(str, groups[-1][1])]))
    return Report(TITLE, tuple(groups))


@contextmanager
def started() -> Iterator[Daemon]:
    """A daemon with a virtual mill."""
    with tempfile.TemporaryDirectory() as folder, daemon(Path(folder), "sim:") as one:
        yield one.connected()


def first_visit(browser: Browser, url: str, times: int) -> list[Figure]:
    """The middle of several; the first one of all has the daemon pack its files."""
    painted, there = [], []
    for _ in range(times + 1):
        with screen(browser, url) as one:
            traffic = Traffic(one.page)
            one.page.goto(url)
            there.append(one.page.evaluate(THERE) / 1000)
            painted.append(one.page.evaluate(PAINT) / 1000)
    return [
        Figure("first paint", sorted(painted[1:])[times // 2], "s", 1.0),
        Figure("live: connected, everything drawn", sorted(there[1:])[times // 2], "s", 1.0),
        Figure("the same, first browser after a start of the daemon", there[0], "s"),
        Figure("bytes over the network", traffic.bytes() / 1024, "KiB", FIRST_BYTES / 1024, digits=1),
        Figure("requests", len(traffic.requests), digits=0),
    ]


def memory(
    browser: Browser, states: int, places: Sequence[str] = PLACES, rounds: int = ROUNDS, say: Say = silent
) -> list[Figure]:
    """The heap after the first round, half way and at the end, and what a message leaves behind in the second half."""
    figures = []
    for place in places:
        with stage() as play, screen(browser, play.url) as one:
            one.page.add_init_script(HEARD)
            one.go(f"{MACHINE}/{place}")
            session = one.context.new_cdp_session(one.page)
            used = []
            say(f"  {states:,} states on the page {place} ...")
            for _ in range(rounds):
                play.run(states // rounds)
                while heard(one.page) < play.seq:
                    time.sleep(0.05)
                used.append(heap_bytes(session))
            half, mib = len(used) // 2, 1024 * 1024
            before, after = min(used[max(half - LOWEST_OF, 0) : half]), min(used[-LOWEST_OF:])
            messages = play.seq * (rounds - half) / rounds
            figures += [
                Figure(f"{place}: after the first round", used[0] / mib, "MiB"),
                Figure(f"{place}: half way", before / mib, "MiB"),
                Figure(f"{place}: at the end", after / mib, "MiB"),
                Figure(f"{place}: left by a message, second half", (after - before) / messages, "B", 1.0),
            ]
    return figures


def preview(browser: Browser, shop: Daemon, segments: int, turned_s: float = TURNED_S) -> list[Figure]:
    """A relief. The heap is that of the page, which the worker's is no part of."""
    rows = "".join(f"X{i % 1000 * 0.2:.2f}Y{i // 1000 * 0.2:.2f}Z{(i * 7 % 90) * 0.02:.2f}\n" for i in range(segments))
    program = shop.http.post("/api/v1/programs?name=relief.nc", content=f"G21 G90 G1 F2000\n{rows}M30\n").json()["id"]
    began = time.monotonic()
    shop.http.get(f"/api/v1/programs/{program}/toolpath?machine={MACHINE}", timeout=120)
    packed_s = time.monotonic() - began
    with screen(browser, shop.url) as one:
        one.allowed.append(DRIVER)
        one.go(f"{MACHINE}/programs/{program}")
        began = time.monotonic()
        one.press("preview-toggle")
        view = one.named("path-view")
        expect(view).not_to_have_attribute("data-drawn", "0", timeout=60_000)
        first_s = time.monotonic() - began
        expect(view).to_have_attribute("data-complete", "true", timeout=120_000)
        whole_s = time.monotonic() - began
        level = float(view.get_attribute("data-level") or 0)
        turning_ms, resting_ms = frames(one.page, turned_s)
        session = one.context.new_cdp_session(one.page)
        page_mib = heap_bytes(session) / 1024 / 1024
    return [
        Figure("the daemon reads the program and packs its drawing", packed_s, "s"),
        Figure("first picture", first_s, "s"),
        Figure("as fine as this device draws it", whole_s, "s"),
        Figure("level then (0: every move)", level, digits=0),
        Figure("a picture while it is turned", turning_ms, "ms"),
        Figure("the longest that the page itself stood still", resting_ms, "ms"),
        Figure("heap of the page", page_mib, "MiB"),
    ]


def frames(page: Page, turned_s: float) -> tuple[float, float]:
    """Turned for some seconds by the mouse: ms a picture that was drawn, and the page's longest gap between its own."""
    page.evaluate(
        """() => { window.gap = 0; let last = performance.now();
            const look = (now) => {
                window.gap = Math.max(window.gap, now - last);
                last = now;
                requestAnimationFrame(look);
            };
            requestAnimationFrame(look); }"""
    )
    view = page.locator('[data-name="path-view"]')
    box = view.bounding_box()
    assert box is not None
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    before, began = int(view.get_attribute("data-drawn") or 0), time.monotonic()
    page.mouse.move(x, y)
    page.mouse.down()
    step = 0
    while time.monotonic() - began < turned_s:
        step += 1
        page.mouse.move(x + step % 200, y + step % 60)
    drawn = int(view.get_attribute("data-drawn") or 0) - before
    took_ms = (time.monotonic() - began) * 1000
    page.mouse.up()
    return took_ms / max(drawn, 1), float(page.evaluate("window.gap"))
