"""The path of a program in a real browser: drawn in a worker, filtered, with progress, tool and the machine's reach."""

from collections.abc import Callable

import pytest
from playwright.sync_api import expect

from tests.harness.browser import PHONE, Screen
from tests.harness.process import Daemon, until

pytestmark = pytest.mark.real

RING = "G2 X20 Y0 I-10 J0\n"
PART = (
    "G21 G90 G17\nT1 M6\nM3 S1000\nG0 Z5\nG0 X20 Y0\n"
    + "".join(f"G1 Z{-depth} F600\n{RING}" for depth in (1, 2, 3))
    + "G0 Z5\nT2 M6\nG0 X0\nG1 Z-4\nG1 Y15\nG0 Z5\nM30\n"
)
WAY = "G21 G90\nG0 Z5\n" + "".join(f"G1 X{i % 20} Y{i % 7} F900\n" for i in range(1, 1500)) + "M30\n"
DRIVER = r"GL Driver Message|GPU stall"
"""What Chromium says of itself where there is no graphics card."""
STILL_MS = 300
SIZE = "[...document.querySelectorAll('.path-canvas canvas')].map((one) => [one.clientWidth, one.clientHeight])"


def stored(daemon: Daemon, program: str) -> str:
    return str(daemon.http.post("/api/v1/programs?name=part.nc", content=program).json()["id"])


def opened(one: Screen, place: str) -> Screen:
    one.allowed.append(DRIVER)
    one.go(place)
    one.press("preview-toggle")
    expect(one.named("path-view")).to_have_attribute("data-complete", "true")
    return one


def draws(one: Screen, act: Callable[[], object]) -> None:
    count = drawn(one)
    act()
    until(lambda: drawn(one) > count)


def drawn(one: Screen) -> int:
    return int(one.named("path-view").get_attribute("data-drawn") or 0)


def at_rest(one: Screen) -> int:
    """Wait until it draws no more; how often it has drawn. One that never rests ends in an AssertionError."""
    seen = [-1]

    def still() -> bool:
        one.page.wait_for_timeout(STILL_MS)
        seen.append(drawn(one))
        return seen[-1] == seen[-2]

    until(still, why=lambda: f"it draws although nothing changes: {seen}")
    return seen[-1]


def test_it_is_loaded_when_it_is_opened_and_remembered(mill: Daemon, screens: Callable[..., Screen]) -> None:
    one = screens(mill.url)
    asked: list[str] = []
    one.page.on("request", lambda request: asked.append(request.url))
    place = f"mill/programs/{stored(mill, PART)}"
    one.go(place)
    expect(one.named("preview-toggle")).to_be_visible()
    assert not [url for url in asked if "three" in url or "toolpath?" in url or "worker" in url]
    opened(one, place)
    assert [url for url in asked if "three.module" in url]
    expect(one.named("preview")).to_contain_text("-4.000 … 5.000")
    one.page.reload()
    expect(one.named("path-view")).to_have_attribute("data-complete", "true")
    one.press("preview-toggle")
    expect(one.named("path-view")).to_have_count(0)


def test_views_filters_and_the_hand_draw_anew_and_then_it_rests(mill: Daemon, screens: Callable[..., Screen]) -> None:
    one = opened(screens(mill.url), f"mill/programs/{stored(mill, PART)}")
    view = one.named("path-view")
    box = view.bounding_box()
    assert box
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2

    def turned() -> None:
        one.page.mouse.move(x, y)
        one.page.mouse.down()
        one.page.mouse.move(x + 80, y + 40, steps=4)
        one.page.mouse.up()

    at_rest(one)
    before = view.screenshot()
    for act in (
        lambda: one.press("view-top"),
        lambda: one.page.locator("[data-tool='2']").click(),
        lambda: one.named("rapids").uncheck(),
        lambda: one.named("layer_high").fill("0"),
        lambda: one.page.get_by_label("Closer").click(),
        turned,
        lambda: one.page.mouse.wheel(0, -300),
    ):
        draws(one, act)
    at_rest(one)
    assert view.screenshot() != before, "nothing of it is seen"


def test_on_a_phone_the_layers_are_those_of_the_cuts_and_the_tools_those_of_the_program(
    mill: Daemon, screens: Callable[..., Screen]
) -> None:
    one = opened(screens(mill.url, PHONE, has_touch=True), f"mill/programs/{stored(mill, PART)}")
    assert one.page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth") <= 0
    [[width, height]] = one.page.evaluate(SIZE)
    assert width > 300
    assert height > 250
    low, high = (one.page.locator(".layer", has=one.named(name)) for name in ("layer_low", "layer_high"))
    expect(low).to_contain_text("Z -4.000")
    expect(high).to_contain_text("Z -1.000")
    one.named("layer_low").fill("3")
    expect(low).to_contain_text("Z -1.000")
    one.named("layer_high").fill("0")
    expect(low).to_contain_text("Z -4.000")
    expect(one.page.locator("[data-tool]")).to_have_text(["T1", "T2"])
    two_fingers_bring_it_closer(one)


def two_fingers_bring_it_closer(one: Screen) -> None:
    view = one.named("path-view")
    view.scroll_into_view_if_needed()
    at_rest(one)
    before, box = view.screenshot(), view.bounding_box()
    assert box
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    session = one.context.new_cdp_session(one.page)

    def fingers(kind: str, apart: float) -> None:
        points = [{"x": x - apart, "y": y, "id": 1}, {"x": x + apart, "y": y, "id": 2}] if apart else []
        session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

    def pinched() -> None:
        fingers("touchStart", 20)
        for apart in (30, 45, 70, 100):
            fingers("touchMove", apart)
        fingers("touchEnd", 0)

    draws(one, pinched)
    at_rest(one)
    assert view.screenshot() != before
    assert one.page.evaluate("visualViewport.scale") == 1, "the drawing is zoomed, not the page"


def test_a_job_is_followed_on_the_page_of_the_machine(mill: Daemon, screens: Callable[..., Screen]) -> None:
    one = screens(mill.url)
    one.allowed.append(DRIVER)
    one.go()
    expect(one.named("preview")).to_have_count(0)
    job = mill.job(WAY)
    opened(one, "mill/machine")
    count, line = drawn(one), mill.get(f"/jobs/{job}")["progress"]["line"]
    until(lambda: mill.get(f"/jobs/{job}")["progress"]["line"] > line)
    until(lambda: drawn(one) > count + 3, why=lambda: "tool and progress are not followed")
    mill.post(f"/jobs/{job}/cancel")
    expect(one.named("preview")).to_have_count(0)


def test_without_webgl_there_are_words_and_all_figures(mill: Daemon, screens: Callable[..., Screen]) -> None:
    one = screens(mill.url)
    one.page.add_init_script("HTMLCanvasElement.prototype.getContext = () => null")
    one.go(f"mill/programs/{stored(mill, PART)}")
    one.press("preview-toggle")
    expect(one.named("no-webgl")).to_contain_text("WebGL")
    expect(one.named("path-view")).to_be_hidden()
    expect(one.named("preview")).to_contain_text("-4.000 … 5.000")


def test_a_program_that_cannot_be_drawn_says_why(mill: Daemon, screens: Callable[..., Screen]) -> None:
    one = screens(mill.url)
    one.allowed += [DRIVER, r"status of (4\d\d)"]
    one.page.route("**/toolpath?*", lambda route: route.fulfill(status=422, json={"detail": "It cannot be drawn."}))
    one.go(f"mill/programs/{stored(mill, PART)}")
    one.press("preview-toggle")
    expect(one.named("preview-problem")).to_have_text("It cannot be drawn.")


def test_a_long_program_does_not_hold_up_the_page(mill: Daemon, screens: Callable[..., Screen]) -> None:
    """Its worker has a hundred thousand segments to read while the page looks at its clock. The page's own part of
    it is less than half, and on a quick computer less than a second."""
    rows = "".join(f"X{i % 317 * 0.3:.3f} Y{i // 317 * 0.3:.3f} Z{(i * 7 % 50) * 0.02:.3f}\n" for i in range(100_000))
    program = stored(mill, f"G21 G90 G1 F2000\n{rows}M30\n")
    mill.http.get(f"/api/v1/programs/{program}/toolpath?machine=mill", timeout=60)
    one = screens(mill.url)
    one.page.add_init_script(
        "let last = performance.now(); window.slowest = 0; setInterval(() => { const now = performance.now();"
        " window.slowest = Math.max(window.slowest, now - last); last = now; }, 10)"
    )
    one.allowed.append(DRIVER)
    one.go(f"mill/programs/{program}")
    expect(one.named("preview-toggle")).to_be_visible()
    one.page.wait_for_timeout(300)
    began_ms = one.page.evaluate("window.slowest = 0, performance.now()")
    one.press("preview-toggle")
    expect(one.named("path-view")).to_have_attribute("data-complete", "true")
    took_ms = one.page.evaluate("performance.now()") - began_ms
    assert one.page.workers, "it is read in the page itself"
    assert one.page.evaluate("window.slowest") < max(1000, took_ms / 2)
    expect(one.named("preview")).to_contain_text("100,000")
