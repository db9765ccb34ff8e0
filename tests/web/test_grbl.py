"""The dashboard in front of a Grbl: overrides, coolant, settings with backups, a reset in the middle of a job."""

import re
from collections.abc import Callable

import pytest
from playwright.sync_api import expect

from tests.harness.browser import PHONE, Screen
from tests.harness.process import Daemon, until

pytestmark = pytest.mark.real

PART = "G21 G90\nM3 S1000\nG0 Z5\n" + "".join(f"G1 X{i % 20} Y{i % 7} F900\n" for i in range(1, 150)) + "M30\n"
LASTING = PART.replace("M30\n", PART.partition("G0 Z5\n")[2].replace("M30\n", "") * 9 + "M30\n")
"""Minutes: it still runs when the slowest computer has found the button."""
WITHIN_MS = 30_000
"""Grbl writes each setting into its EEPROM, and the daemon reads it back."""


def test_overrides_and_coolant_show_what_the_controller_reports(grbl: Daemon, screens: Callable[..., Screen]) -> None:
    one = screens(grbl.url)
    one.go()
    slider = one.page.locator("#override-feed")
    slider.focus()
    slider.press("ArrowRight")  # a step of the slider is 5 %
    until(lambda: grbl.get("/machines/mill/state")["overrides"]["feed"] == 105)
    expect(one.named("override-feed").locator("output")).to_have_text("105 %")
    one.named("override-feed").locator("[data-way=more]").click()
    expect(one.named("override-feed").locator("output")).to_have_text("115 %")
    one.named("override-feed").locator("[data-way=neutral]").click()
    expect(one.named("override-feed").locator("output")).to_have_text("100 %")
    one.page.locator("[data-percent='50']").click()
    until(lambda: grbl.get("/machines/mill/state")["overrides"]["rapid"] == 50)
    expect(one.named("override-rapid").locator("output")).to_have_text("50 %")
    one.page.keyboard.press("ArrowRight")
    until(lambda: grbl.get("/machines/mill/state")["overrides"]["rapid"] == 100)
    one.press("flood")
    expect(one.named("flood")).to_contain_text("Flood is on")
    one.press("flood")
    expect(one.named("flood")).not_to_contain_text("is on")
    expect(one.named("spindle-stop")).to_contain_text("is not held")


def test_settings_are_changed_seen_again_and_brought_back(grbl: Daemon, screens: Callable[..., Screen]) -> None:
    one = screens(grbl.url)
    one.go("mill/settings")
    expect(one.named("save-settings")).to_contain_text("nothing changed")
    one.page.locator("#setting-110").fill("650")
    one.page.locator("[data-setting='3'] [data-bit='1']").check()
    one.press("save-settings")
    rows = {number: one.page.locator(f"[data-setting='{number}']") for number in (3, 110)}
    for row in rows.values():
        expect(row).to_contain_text("written", timeout=WITHIN_MS)
    assert values(grbl, 3, 110) == ["2", "650.000"]
    one.named("backups").get_by_role("button").first.click()
    expect(one.named("backup")).to_contain_text("500.000")
    one.press("restore")
    until(lambda: values(grbl, 3, 110) == ["0", "500.000"])
    expect(one.page.locator("#setting-110")).to_have_value("500.000", timeout=WITHIN_MS)


def test_a_value_that_cannot_be_is_refused_and_nothing_written(grbl: Daemon, screens: Callable[..., Screen]) -> None:
    one = screens(grbl.url)
    one.allowed.append(r"status of 4(09|22)")
    one.go("mill/settings")
    one.page.locator("#setting-110").fill("fast")
    one.press("save-settings")
    expect(one.page.locator(".notice.error")).to_be_visible()
    expect(one.page.locator("#setting-110")).to_have_value("fast")
    assert values(grbl, 110) == ["500.000"]


def values(grbl: Daemon, *numbers: int) -> list[str]:
    settings = grbl.get("/machines/mill/settings")["settings"]
    return [one["value"] for one in settings if one["number"] in numbers]


def test_a_reset_in_the_middle_of_a_job_ends_in_a_plan_that_asks_for_what_it_needs(
    grbl: Daemon, screens: Callable[..., Screen]
) -> None:
    one = screens(grbl.url, PHONE)
    one.go()
    job = grbl.job(LASTING)
    until(lambda: grbl.get(f"/jobs/{job}")["progress"]["line"] > 4)
    one.press("reset")
    one.status("alarm")
    one.press("call-unlock")
    one.status("interrupted")
    one.named("band").locator("[data-name=recover]").click()
    plan = one.page.locator("section[data-name=recover]")
    expect(plan.locator("[data-name=from]")).to_contain_text("see the plan")
    plan.locator("[data-name=clearance]").fill("10")
    force = plan.locator("[data-name=force]")
    force.check()
    expect(plan.locator(".steps-list li").first).to_be_visible()
    for box in plan.locator("[data-name=operator_done]").all():
        box.check()
    expect(plan.locator("[data-name=from]")).not_to_have_attribute("aria-disabled", "true")
    plan.locator("[data-name=from]").click()
    one.status("run")
    until(lambda: grbl.get(f"/jobs/{job}")["status"] == "running")
    grbl.post(f"/jobs/{job}/cancel")


def test_a_check_run_is_asked_for_with_what_follows_a_refused_line(
    grbl: Daemon, screens: Callable[..., Screen]
) -> None:
    one = screens(grbl.url, PHONE)
    program = grbl.http.post("/api/v1/programs?name=check.nc", content=PART).json()["id"]
    one.go(f"mill/programs/{program}")
    expect(one.named("report")).to_be_visible()
    one.named("options").click()
    one.named("mode").select_option("check")
    one.named("on_error").select_option("stop")
    expect(one.named("run")).to_contain_text("Check run")
    one.press("run")
    if grbl.get(f"/programs/{program}/check?machine=mill")["warnings"]:
        one.press("force")
    expect(one.page).to_have_url(re.compile("/machine$"))
    job = grbl.get("/jobs?limit=1")[0]["id"]
    before = grbl.get("/machines/mill/state")["position"]
    view = grbl.status(job, "completed")
    assert (view["mode"], view["on_error"]) == ("check", "stop")
    assert grbl.get("/machines/mill/state")["position"] == before, "a check moves nothing"
    one.go(f"mill/jobs/{job}")
    expect(one.named("job")).to_contain_text("check only, nothing moves")
    one.status("idle")
