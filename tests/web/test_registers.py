"""What a Grbl keeps besides its settings, its reach in the preview, and the plots of what it does, in a browser."""

from collections.abc import Callable

import pytest
from playwright.sync_api import expect

from tests.harness.browser import PHONE, TABLET, Screen
from tests.harness.process import Daemon, until

pytestmark = pytest.mark.real

WAY = "G21 G90\nG0 Z5\n" + "".join(f"G1 X{i % 20} Y{i % 7} F900\n" for i in range(1, 1500)) + "M30\n"
DRIVER = r"GL Driver Message|GPU stall"
WITHIN_MS = 30_000


def offsets(grbl: Daemon, name: str) -> dict[str, float]:
    return dict(grbl.get("/machines/mill/offsets")["offsets"][name])


def test_an_offset_is_set_where_the_tool_stands_and_seen(grbl: Daemon, screens: Callable[..., Screen]) -> None:
    stands = grbl.get("/machines/mill/state")["position"]["machine"]
    one = screens(grbl.url, PHONE)
    one.go("mill/settings/offsets")
    row = one.page.locator("[data-offset=G55]")
    expect(one.page.locator("[data-offset=G54]")).to_contain_text("active")
    one.press("offset-G55")
    expect(one.named("offset-save")).to_contain_text("name an axis")
    one.named("to-x").fill("fast")
    expect(one.named("offset-save")).to_contain_text("not a number")
    one.named("to-x").fill("12,5")
    one.named("zero-here-xy").click()
    one.named("to-x").fill("12,5")
    one.press("offset-save")
    expect(row.locator("[data-axis=x]")).to_have_text(f"{stands['x'] - 12.5:.3f}", timeout=WITHIN_MS)
    assert offsets(grbl, "G55") == pytest.approx({"x": stands["x"] - 12.5, "y": stands["y"], "z": 0.0}, abs=0.001)
    one.press("offset-G55")
    one.named("mode-absolute").click()
    one.named("to-x").fill("0")
    one.press("offset-save")
    expect(row.locator("[data-axis=x]")).to_have_text("0.000", timeout=WITHIN_MS)
    assert one.page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth") <= 0


def test_the_controller_shows_itself_and_a_block_that_moves_is_asked_for_twice(
    grbl: Daemon, screens: Callable[..., Screen]
) -> None:
    one = screens(grbl.url, TABLET)
    one.allowed.append("status of 409")
    one.go("mill/settings/controller")
    expect(one.named("firmware")).to_contain_text("1.1")
    expect(one.page.locator("[data-group=units]")).to_contain_text("G21")
    one.named("startup-0").fill("G20")
    one.press("write-startup")
    expect(one.named("write-startup")).to_contain_text("nothing changed", timeout=WITHIN_MS)
    assert grbl.get("/machines/mill/startup-blocks")["blocks"][0] == "G20"
    one.named("startup-0").fill("G0X1")
    one.press("write-startup")
    expect(one.named("startup-force")).to_be_visible(timeout=WITHIN_MS)
    assert grbl.get("/machines/mill/startup-blocks")["blocks"][0] == "G20"
    one.named("startup-force").get_by_role("button", name="Cancel").click()
    one.named("startup-0").fill("")
    one.press("write-startup")
    until(lambda: grbl.get("/machines/mill/startup-blocks")["blocks"][0] == "")


def test_the_defaults_need_the_name_of_the_machine(grbl: Daemon, screens: Callable[..., Screen]) -> None:
    one = screens(grbl.url)
    one.go("mill/settings/controller")
    one.press("defaults-settings")
    expect(one.named("defaults-yes")).to_contain_text("type the name")
    one.named("defaults-name").fill("Mill")
    expect(one.named("defaults-yes")).to_have_attribute("aria-disabled", "true")
    one.named("defaults-name").fill("mill")
    one.press("defaults-yes")
    expect(one.page.locator(".notice.done")).to_contain_text("Backup", timeout=WITHIN_MS)
    whys = [backup["why"] for backup in grbl.get("/machines/mill/settings/backups")]
    assert "defaults" in whys


def test_the_preview_says_whether_it_fits_at_the_present_zero(grbl: Daemon, screens: Callable[..., Screen]) -> None:
    program = grbl.http.post("/api/v1/programs?name=way.nc", content=WAY).json()["id"]
    one = screens(grbl.url)
    one.allowed.append(DRIVER)
    one.go(f"mill/programs/{program}")
    one.press("preview-toggle")
    expect(one.named("reach")).to_contain_text("beyond the reach of the machine: X, Y, Z")
    grbl.http.patch(
        "/api/v1/machines/mill/offsets", json={"system": "G54", "mode": "absolute", "x": -100, "y": -90, "z": -50}
    )
    expect(one.named("reach")).to_contain_text("Fits the reach", timeout=WITHIN_MS)
    grbl.http.patch("/api/v1/machines/mill/offsets", json={"system": "G54", "mode": "absolute", "x": 0, "y": 0, "z": 0})


def test_plots_show_what_happened_since_the_page_was_opened(grbl: Daemon, screens: Callable[..., Screen]) -> None:
    one = screens(grbl.url)
    one.go()
    job = grbl.job(WAY)
    until(lambda: grbl.get(f"/jobs/{job}")["progress"]["line"] > 3)
    one.named("tab-plots").click()
    for name in ("feed", "position", "ack"):
        expect(one.named(f"plot-{name}").locator("canvas")).to_be_visible()
    feed = one.named("plot-feed")
    assert int(feed.get_attribute("data-points") or 0) > 5, "what was before it was opened is missing"
    one.named("plots-hold").click()
    points = feed.get_attribute("data-points")
    line = grbl.get(f"/jobs/{job}")["progress"]["line"]
    until(lambda: grbl.get(f"/jobs/{job}")["progress"]["line"] > line)
    assert feed.get_attribute("data-points") == points
    one.named("plots-hold").click()
    until(lambda: int(feed.get_attribute("data-points") or 0) > int(points or 0))
    with one.page.expect_download() as download:
        one.named("plots-csv").click()
    rows = download.value.path().read_text().splitlines()
    assert rows[0].startswith("at,feed,spindle,x")
    assert len(rows) > 5
    grbl.post(f"/jobs/{job}/cancel")
