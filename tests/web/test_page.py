"""The page as such: under its security policy, in three sizes and three languages, for fingers, in light and dark."""

import re
from collections.abc import Callable
from typing import Any

import pytest
from playwright.sync_api import Page, expect

from tests.harness.browser import DESK, FIRST_BYTES, PHONE, TABLET, Screen, Traffic
from tests.harness.process import Daemon

pytestmark = pytest.mark.real

SIZES = {"desk": DESK, "tablet": TABLET, "phone": PHONE}
PLACES = ("mill/machine", "mill/programs", "mill/jobs", "mill/plots", "mill/console", "mill/card", "mill/tools")
SETTINGS = ("mill/settings", "mill/settings/offsets", "mill/settings/controller")
TOUCH_PX = 48
PROGRAM = "G21 G90\nG28\nG1 X5 F1000\nG55\nM30\n"

SMALL = """(least) => [...document.querySelectorAll(
        "button, a.button, nav a, select, summary, input:not([type=file], [type=checkbox])")]
    .filter((one) => one.checkVisibility())
    .map((one) => [one, one.getBoundingClientRect()])
    .filter(([, box]) => box.width > 1 && (box.height < least - 0.5 || box.width < least - 0.5))
    .map(([one, box]) => `${one.outerHTML.slice(0, 90)} ${box.width.toFixed(0)} x ${box.height.toFixed(0)}`)"""
NAMELESS = """() => [...document.querySelectorAll("button, a, input, select")].filter((one) => one.checkVisibility()
    && !(one.innerText || "").trim() && !one.getAttribute("aria-label") && !(one.labels && one.labels.length))
    .map((one) => one.outerHTML.slice(0, 120))"""


def too_small(page: Page) -> Any:
    return page.evaluate(SMALL, TOUCH_PX)


def test_the_policy_is_the_one_that_was_promised(mill: Daemon) -> None:
    policy = mill.http.get("/").headers["content-security-policy"]
    assert policy.startswith(
        "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src 'self' data:; "
        "worker-src 'self'"
    )


def test_the_documentation_of_the_api_is_read_without_the_internet(
    mill: Daemon, screens: Callable[..., Screen]
) -> None:
    one = screens(mill.url)
    one.page.route(lambda address: not address.startswith(mill.url), lambda route: route.abort())
    one.page.goto(f"{mill.url}/docs")
    expect(one.page.locator("details code", has_text="/api/v1/machines/{m}/estop")).to_be_visible()


def test_a_first_visit_is_light(mill: Daemon, screens: Callable[..., Screen]) -> None:
    """With every page but the preview, which loads three.js when it is opened."""
    one = screens(mill.url)
    traffic = Traffic(one.page)
    one.go()
    first = traffic.bytes()
    assert first > 50 * 1024, "nothing was counted"
    assert not [url for url in traffic.requests.values() if "uplot.js" in url or "three" in url]
    mill.job("G21 G90\nG28\nG1 X4 F3000\nM30\n")
    for place in PLACES:
        one.go(place)
    one.named("tab-plots").click()
    expect(one.page.locator(".plot canvas").first).to_be_visible()
    assert [url for url in traffic.requests.values() if "uplot.js" in url]
    assert first < traffic.bytes() < FIRST_BYTES
    assert all(url.startswith((mill.url, "data:", "blob:")) for url in traffic.requests.values())


def test_every_page_fits_and_is_for_fingers(mill: Daemon, grbl: Daemon, screens: Callable[..., Screen]) -> None:
    stored = mill.http.post("/api/v1/programs?name=part.nc", content=PROGRAM).json()
    fits(screens(mill.url), *PLACES, f"mill/programs/{stored['id']}")
    fits(screens(grbl.url), *SETTINGS)


def fits(one: Screen, *places: str) -> None:
    for place in places:
        one.go(place)
        expect(one.page.locator("main .panel:visible").first).to_be_visible()
        expect(one.page.locator("main")).not_to_contain_text("Loading")
        if "programs/" in place:
            one.named("options").click()
        for size, (width, height) in SIZES.items():
            one.page.set_viewport_size({"width": width, "height": height})
            wide = one.page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth")
            assert wide <= 0, f"{place} is {wide} px too wide for a {size}"
            assert too_small(one.page) == [], f"{place} on a {size}"
        assert one.page.evaluate(NAMELESS) == [], f"{place}: controls without a name"


def test_it_speaks_three_languages_and_remembers_which(person: Screen) -> None:
    person.named("menu").click()
    for language, idle in (("ru", "Готов"), ("zh", "空闲"), ("en", "Idle"), ("ru", "Готов")):
        person.page.locator(".menu-body select").first.select_option(language)
        expect(person.named("status")).to_have_text(idle)
    person.page.reload()
    expect(person.named("status")).to_have_text("Готов")
    expect(person.page.locator("html")).to_have_attribute("lang", "ru")
    assert not re.search(r"\b[a-z_]+\.(?!nc\b)[a-z_]+\b", person.page.locator("main").inner_text()), (
        "a key without words"
    )


def test_light_and_dark_have_contrast_and_nobody_is_moved_who_does_not_want_to_be(person: Screen) -> None:
    for scheme in ("light", "dark"):
        person.page.emulate_media(color_scheme=scheme, reduced_motion="reduce")
        ground = person.page.evaluate("getComputedStyle(document.body).backgroundColor")
        dark = sum(int(part) for part in re.findall(r"\d+", ground)) < 200
        assert dark == (scheme == "dark")
        for selector in (".axes .work", ".band .word", ".button .why", "dt", "h2", ".button:not([aria-disabled=true])"):
            assert contrast(person.page, selector) >= 4.5, f"{selector} in {scheme}"
        assert person.page.evaluate("document.getAnimations().length") == 0


def contrast(page: Page, selector: str) -> float:
    """Of the first such element against the nearest ground behind it (WCAG 2, 1.4.3)."""
    text, ground = page.evaluate(
        """(selector) => {
            const one = document.querySelector(selector);
            const ground = (part) => getComputedStyle(part).backgroundColor;
            let behind = one;
            while (/rgba\\(.*, 0\\)|transparent/.test(ground(behind))) behind = behind.parentElement;
            return [getComputedStyle(one).color, ground(behind)];
        }""",
        selector,
    )
    lighter, darker = sorted((luminance(text), luminance(ground)), reverse=True)
    return (lighter + 0.05) / (darker + 0.05)


def luminance(colour: str) -> float:
    parts = [int(part) / 255 for part in re.findall(r"\d+", colour)[:3]]
    red, green, blue = (part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in parts)
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue


def test_a_page_begins_at_its_top_and_a_mistyped_address_is_a_page_too(
    mill: Daemon, screens: Callable[..., Screen]
) -> None:
    one = screens(mill.url, PHONE)
    one.go("mill/machine")
    one.page.mouse.wheel(0, 900)
    one.page.wait_for_function("scrollY > 500")
    one.page.locator(".tabs a", has_text="Programs").click()
    one.page.wait_for_function("scrollY === 0")
    one.go("mill/%zz/%")
    one.page.reload()
    one.status("idle")


def test_opening_and_reloading_every_page_moves_nothing(person: Screen, mill: Daemon) -> None:
    before, told = mill.get("/machines/mill/state")["position"], said_to(mill)
    for place in PLACES:
        person.go(place)
        expect(person.named("band")).to_be_visible()
    for place in ("mill/tools", "mill/machine"):
        person.go(place)
        person.page.reload()
        expect(person.named("band")).to_be_visible()
    assert mill.get("/machines/mill/state")["position"] == before
    assert said_to(mill) == told


def said_to(mill: Daemon) -> list[str]:
    """What went out to the machine, without the daemon's own questions whether it is still there (W95)."""
    lines = mill.get("/machines/mill/console?limit=1000")
    return [line["text"] for line in lines if line["direction"] == ">" and "W95" not in line["text"]]
