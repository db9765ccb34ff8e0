"""What a person has to answer, and the emergency stop: in real browsers, one or two of them."""

import re
from collections.abc import Callable
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page, expect

from sim.elvinto.settings import SimSettings
from tests.harness.browser import DESK, PHONE, TABLET, Screen, serious, topmost
from tests.harness.process import Daemon, daemon, live_mill, until

pytestmark = pytest.mark.real

TOOL = "G21 G90\nG28\nM3 S12000\nG1 X5 F3000\nT3 M6\nG1 X10 F3000\nM30\n"
LONG = "G21 G90\nG28\nM3 S12000\n" + "".join(f"G1 X{i % 50} Y{i % 7} F2000\n" for i in range(1, 4000)) + "M30\n"
"""A minute: it still runs when the slowest computer comes to look."""


def test_a_tool_change_is_asked_on_every_screen_and_one_answer_closes_it(
    mill: Daemon, screens: Callable[..., Screen]
) -> None:
    here, there = screens(mill.url), screens(mill.url, PHONE)
    here.go()
    there.go("mill/console")
    job = mill.job(TOOL)
    for one in (here, there):
        expect(one.named("call")).to_contain_text("Put in tool 3")
        one.status("tool")
    assert mill.get(f"/jobs/{job}")["status"] == "waiting"
    assert serious(here.page) == []
    there.page.keyboard.press("Escape")
    expect(there.named("call-strip")).to_contain_text("Put in tool 3")
    assert mill.get(f"/jobs/{job}")["status"] == "waiting", "putting it aside answers nothing"
    here.press("call-confirm")
    for one in (here, there):
        expect(one.named("call")).to_have_count(0)
        expect(one.named("call-strip")).to_have_count(0)
    mill.status(job, "completed")


def test_the_estop_is_one_touch_above_every_dialog(mill: Daemon, screens: Callable[..., Screen]) -> None:
    one = screens(mill.url, has_touch=True)
    one.go("mill/programs")
    assert topmost(one.page, "#estop")
    job = mill.job(TOOL.replace("T3", "T58"))  # a tool that is in already is not asked for again
    expect(one.named("call")).to_be_visible()
    for width, height in (DESK, TABLET, PHONE):
        one.page.set_viewport_size({"width": width, "height": height})
        assert topmost(one.page, "#estop"), "the dialog must not lie over it"
    one.page.touchscreen.tap(*centre(one.page))
    one.status("alarm")
    assert mill.status(job, "failed", "interrupted", "cancelled")["error"]["code"] in ("estop", "alarm")


def centre(page: Page) -> tuple[float, float]:
    box = page.locator("#estop").bounding_box()
    assert box is not None
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


def test_the_estop_is_above_each_dialog_and_acts_from_it(mill: Daemon, screens: Callable[..., Screen]) -> None:
    one = screens(mill.url, PHONE)
    program = mill.http.post("/api/v1/programs?name=warned.nc", content=LONG).json()["id"]
    dialogs = {
        "ask-zero": ("mill/machine", "zero-all"),
        "ask-delete": (f"mill/programs/{program}", "delete"),
        "warnings": (f"mill/programs/{program}", "run"),
    }
    for name, (place, button) in dialogs.items():
        one.go(place)
        one.press(button)
        expect(one.named(name)).to_be_visible()
        assert topmost(one.page, "#estop"), name
        one.page.mouse.click(*centre(one.page))
        until(lambda: mill.get("/machines/mill/state")["status"] == "alarm")
        expect(one.named("call")).to_be_visible()
        one.page.keyboard.press("Escape")
        expect(one.named("call")).to_have_count(0)
        one.page.keyboard.press("Escape")
        expect(one.named(name)).to_have_count(0)
        mill.post("/machines/mill/unlock")
        one.status("idle")


def test_an_alarm_is_read_and_unlocked(person: Screen, mill: Daemon) -> None:
    job = mill.job(LONG)
    person.status("run")
    person.page.mouse.move(*centre(person.page))
    person.page.mouse.down()  # the way down is the stop
    person.status("alarm")
    person.page.mouse.up()
    expect(person.page.locator("#estop-result")).to_have_class("sent")
    call = person.named("call")
    expect(call).to_contain_text(mill.get("/machines/mill/state")["alarm"]["message"])
    expect(person.named("start")).to_contain_text("in alarm")
    person.press("call-unlock")
    person.status("idle")
    expect(call).to_have_count(0)
    mill.status(job, "failed", "interrupted")


def test_the_estop_goes_out_over_http_when_the_websocket_does_not_answer(person: Screen, mill: Daemon) -> None:
    """A page of which nothing works but this button."""
    page = person.context.new_page()
    page.route("**/web/app.js", lambda route: route.fulfill(body="", content_type="text/javascript"))
    page.goto(mill.url)
    page.locator("#estop").click()
    until(lambda: mill.get("/machines/mill/state")["status"] == "alarm")
    expect(page.locator("#estop-result")).to_have_class("sent")


def test_a_job_is_paused_and_cancelled_where_it_is_shown(person: Screen, mill: Daemon) -> None:
    job = mill.job(LONG)
    person.status("run")
    until(lambda: mill.get(f"/jobs/{job}")["progress"]["line"] > 5)
    lines = person.named("now-lines").locator("li")
    expect(lines.first).to_have_class("done")
    expect(lines.first).to_contain_text(re.compile("^[0-9]+.*done$", re.DOTALL))
    expect(lines.last).to_have_class(re.compile("^(sent)?$"))
    person.go(f"mill/jobs/{job}")
    person.page.locator("[data-journal=batches]").click()
    rows = person.page.locator(".journal tbody tr")
    expect(rows.first).to_contain_text("open")
    before = rows.count()
    expect(rows.nth(before)).to_contain_text("done")  # the table goes on as the job does
    person.press("pause")
    person.status("hold")
    expect(person.named("job")).to_have_attribute("data-status", "paused")
    person.press("cancel")
    expect(person.named("job")).to_have_attribute("data-status", "cancelled")


def test_an_interrupted_job_shows_its_plan_before_anything_goes_on(
    browser: Browser, tmp_path: Path, screens: Callable[..., Screen]
) -> None:
    with (
        live_mill(tmp_path, SimSettings(speed_factor=8), link="tcp") as (machine, recording),
        daemon(tmp_path, machine.port, machine="resume_within = 1") as own,
    ):
        one = screens(own.connected().url)
        one.go()
        job = own.job(LONG)
        recording.reached(20)
        machine.unplug()
        one.status("connecting", "offline")
        expect(one.page.locator(".position")).to_have_class(re.compile("old"))
        own.status(job, "interrupted")
        machine.replug()
        own.connected()
        one.status("interrupted")
        executed = len(recording.blocks())
        one.named("recover").click()
        certain = own.get(f"/jobs/{job}")["progress"]["line"]
        expect(one.named("recover").locator("dd").first).to_have_text(str(certain))
        assert len(recording.blocks()) == executed, "looking at the plan moves nothing"
        one.press("continue")
        one.status("run")
        until(lambda: len(recording.blocks()) > executed)
