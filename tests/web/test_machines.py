"""Several machines on one page, the card in a controller, and the sound of a call."""

import re
from collections.abc import Callable
from pathlib import Path

import pytest
from playwright.sync_api import Browser, expect

from tests.harness.browser import PHONE, Screen
from tests.harness.process import Daemon, daemon, until

pytestmark = pytest.mark.real

SECOND = '\n[[machine]]\nname = "lathe"\nport = "sim:?speed_factor=4"\n'
TOOL = "G21 G90\nG28\nT3 M6\nG1 X10 F3000\nM30\n"
AGAIN_MS = 4000
"""lib/sound.js"""
COUNT_TONES = """
    window.tones = 0;
    const every = setInterval, start = OscillatorNode.prototype.start;
    window.setInterval = (what, ms, ...more) => every(what, ms === AGAIN ? ms / 10 : ms, ...more);
    OscillatorNode.prototype.start = function (...when) { window.tones += 1; return start.apply(this, when); };
""".replace("AGAIN", str(AGAIN_MS))


def test_two_machines_are_told_apart_and_a_call_leads_to_its_own(
    browser: Browser, tmp_path: Path, screens: Callable[..., Screen]
) -> None:
    with daemon(tmp_path, "sim:?speed_factor=4", elvinto=SECOND) as own:
        own.connected()
        until(lambda: own.get("/machines/lathe")["link"] == "connected")
        one = screens(own.url, PHONE)
        one.go("mill/machine")
        chips = one.page.locator(".machines .chip")
        expect(chips).to_have_count(2)
        expect(chips.nth(0)).to_have_attribute("aria-current", "true")
        wide = one.page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth")
        assert wide <= 0
        own.post("/machines/lathe/commands", {"blocks": ["G1 X7 F3000"]})
        program = own.http.post("/api/v1/programs?name=t.nc", content=TOOL).json()["id"]
        job = own.post("/jobs", {"program": program, "machine": "lathe", "force": True})["id"]
        expect(chips.nth(1)).to_contain_text("Waiting")
        one.status("idle")  # the mill does nothing
        call = one.named("call")
        expect(call).to_contain_text("lathe")
        expect(one.named("call-confirm")).to_have_count(0)
        call.get_by_role("button", name="Show this machine").click()
        expect(one.page).to_have_url(re.compile("#/lathe/machine"))
        one.status("tool")
        one.press("call-confirm")
        own.status(job, "completed")
        one.page.locator("#estop").click()
        for name in ("mill", "lathe"):
            until(lambda name=name: own.get(f"/machines/{name}/state")["status"] == "alarm")


def test_the_card_is_read_when_asked_and_a_file_of_it_runs(
    browser: Browser, tmp_path: Path, screens: Callable[..., Screen]
) -> None:
    card = tmp_path / "card"
    card.mkdir()
    (card / "part1.nc").write_text("G21 G90\nG1 X9 F3000\nM30\n")
    with daemon(tmp_path, f"sim:?speed_factor=4&sd={card}") as own:
        one = screens(own.connected().url)
        one.go("mill/card")
        expect(one.page.get_by_text("part1.nc")).to_have_count(0)
        one.press("read-card")
        row = one.page.locator("li", has_text="part1.nc")
        expect(row).to_be_visible()
        row.get_by_role("button").click()
        expect(one.page).to_have_url(re.compile("/machine$"))
        until(lambda: own.get("/machines/mill/state")["position"]["work"]["x"] == 9)


def test_a_call_rings_until_it_is_answered_and_not_where_the_sound_is_off(
    mill: Daemon, screens: Callable[..., Screen]
) -> None:
    loud, quiet = screens(mill.url), screens(mill.url)
    for one in (loud, quiet):
        one.page.add_init_script(COUNT_TONES)
        one.go()
        one.named("menu").click()  # a browser plays nothing before the page was touched
    quiet.page.get_by_role("button", name="Sound is on").click()
    mill.job(TOOL.replace("T3", "T8"))  # one that no test before has put in
    expect(loud.named("call")).to_be_visible()
    expect(quiet.named("call")).to_be_visible()
    until(lambda: tones(loud) >= 6)  # three, and after a while three more: it goes on calling
    quiet.page.keyboard.press("Escape")
    quiet.named("call-strip").click()
    quiet.press("call-confirm")
    expect(loud.named("call")).to_have_count(0)
    heard = tones(loud)
    loud.page.wait_for_timeout(AGAIN_MS / 10 * 3)
    assert tones(loud) == heard
    assert tones(quiet) == 0


def tones(one: Screen) -> int:
    return int(one.page.evaluate("window.tones"))
