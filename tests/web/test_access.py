"""Who cannot see, cannot use a mouse or wants nothing to move: axe-core on every view and dialog, light and dark."""

from collections.abc import Callable
from typing import Any

import pytest
from playwright.sync_api import expect

from tests.harness.browser import Screen, serious
from tests.harness.process import Daemon

pytestmark = pytest.mark.real

FAULTY = "G21 G90\nG28\nM3 S900\nG1 X5 F1000\nG55\nM30\n"
WARNED = "G21 G90\nG28\nM3 S900\nG1 X4 F1000\nM30\n"
LASTING = WARNED.replace("M30", "".join(f"G1 X{i % 9} F900\n" for i in range(2000)) + "M30")
"""Minutes: it still runs when the slowest computer has found the next button."""
DARK_TOO = ("color-contrast", "link-in-text-block")
"""All that depends on colours; the rest is the same in light and dark."""


FOCUS_SEEN = "getComputedStyle(document.activeElement).outlineStyle !== 'none'"


class Look:
    """Goes through what one person sees; everything found is told at the end, together."""

    def __init__(self, one: Screen) -> None:
        self.one = one
        self.found: list[str] = []

    def here(self, what: str) -> None:
        self.one.page.emulate_media(color_scheme="light")
        self.found += [f"{what}, light: {one}" for one in serious(self.one.page)]
        self.one.page.emulate_media(color_scheme="dark")
        self.found += [f"{what}, dark: {one}" for one in serious(self.one.page, *DARK_TOO)]

    def at(self, *places: str) -> None:
        for place in places:
            self.one.go(place)
            expect(self.one.page.locator("main .panel:visible").first).to_be_visible()
            self.here(place)

    def dialog(self, name: str, press: Callable[[], Any]) -> None:
        press()
        expect(self.one.named(name)).to_be_visible()
        self.here(name)
        self.one.page.keyboard.press("Escape")
        expect(self.one.named(name)).to_have_count(0)

    def well(self) -> None:
        assert not self.found, "\n".join(self.found)


def test_every_view_of_a_mill(person: Screen, mill: Daemon) -> None:
    program = mill.http.post("/api/v1/programs?name=faulty.nc", content=FAULTY).json()["id"]
    job = mill.job(WARNED)
    mill.status(job, "completed")
    look = Look(person)
    look.at("mill/machine", "mill/plots", "mill/programs", f"mill/programs/{program}", "mill/jobs", f"mill/jobs/{job}")
    look.at("mill/console", "mill/card", "mill/tools")
    person.named("menu").click()
    look.here("menu")
    look.well()


def test_every_dialog_of_a_mill(person: Screen, mill: Daemon) -> None:
    look = Look(person)
    look.dialog("ask-zero", lambda: person.press("zero-all"))
    program = mill.http.post("/api/v1/programs?name=warned.nc", content=WARNED).json()["id"]
    person.go(f"mill/programs/{program}")
    look.dialog("ask-delete", lambda: person.press("delete"))
    expect(person.named("report")).to_be_visible()
    look.dialog("warnings", lambda: person.press("run"))
    look.dialog("call", lambda: mill.post("/machines/mill/estop"))
    look.here("the strip of a call")
    look.well()


def test_every_view_of_a_grbl(grbl: Daemon, screens: Callable[..., Screen]) -> None:
    one = screens(grbl.url)
    one.go("mill/settings")
    expect(one.page.locator("#setting-110")).to_be_visible()
    look = Look(one)
    look.here("settings")
    backup = {"id": 1, "at": "2026-03-01T09:30:00Z", "why": "change", "made_by": "Ann", "not_compared": None}
    differences = [{"number": 110, "name": "X rate", "before": "500", "value": "777"}]
    one.page.route("**/settings/backups", lambda route: route.fulfill(json=[backup]))
    one.page.route("**/backups/1", lambda route: route.fulfill(json={**backup, "differences": differences}))
    one.page.reload()
    look.dialog("backup", lambda: one.named("backups").get_by_role("button").click())
    look.at("mill/machine", "mill/settings/controller", "mill/settings/offsets")
    look.dialog("offset", lambda: one.press("offset-G54"))
    one.go("mill/settings/controller")
    look.dialog("defaults-ask", lambda: one.press("defaults-settings"))
    look.well()


def reach(one: Screen, name: str) -> None:
    """By the tabulator alone; what has the focus must be seen."""
    for _ in range(90):
        one.page.keyboard.press("Tab")
        if one.page.evaluate("document.activeElement?.dataset.name") == name:
            assert (
                one.page.evaluate("getComputedStyle(document.activeElement).outlineStyle") != "none" or name == "file"
            )
            return
    raise AssertionError(f"{name} cannot be reached by the keyboard")


def test_a_job_from_the_file_to_the_history_by_the_keyboard_alone(person: Screen, mill: Daemon) -> None:
    keys = person.page.keyboard
    # Long before the press: the browser is told that somebody wants the chooser, and a key can overtake that message.
    person.page.on("filechooser", lambda _: None)
    reach(person, "tab-programs")
    keys.press("Enter")
    reach(person, "file")
    with person.page.expect_file_chooser() as chooser:
        keys.press("Enter")
    chooser.value.set_files({"name": "keys.nc", "mimeType": "text/plain", "buffer": LASTING.encode()})
    expect(person.named("report")).to_be_visible()
    reach(person, "run")
    keys.press("Enter")
    expect(person.named("warnings")).to_be_visible()
    reach(person, "force")
    keys.press("Enter")
    person.status("run")
    for button, status in (("pause", "hold"), ("resume", "run")):
        reach(person, button)
        keys.press("Enter")
        person.status(status)
    job = mill.get("/jobs?limit=1")[0]["id"]
    reach(person, "stop")
    keys.press("Enter")
    mill.status(job, "cancelled")
    reach(person, "tab-jobs")
    keys.press("Enter")
    for _ in range(90):
        keys.press("Tab")
        if str(person.page.evaluate("document.activeElement?.href")).endswith(f"/jobs/{job}"):
            break
    keys.press("Enter")
    expect(person.named("job")).to_have_attribute("data-status", "cancelled")


def test_a_screen_reader_hears_what_others_see(person: Screen, mill: Daemon) -> None:
    page = person.page
    expect(page.get_by_role("status").filter(has_text="Idle")).to_have_count(1)
    for name in ("State", "Position", "Jog", "Figures", "Link", "Queue", "Messages"):
        expect(page.get_by_role("region", name=name, exact=True)).to_have_count(1)
    for name in ("E-STOP: Emergency stop of every machine", "Home", "X+", "Y−", "X = 0"):
        expect(page.get_by_role("button", name=name, exact=True)).to_have_count(1)
    expect(page.get_by_role("link", name="Programs", exact=True)).to_have_count(1)
    mill.job(LASTING)
    expect(page.get_by_role("progressbar", name="Progress of the job")).to_be_visible()
    expect(page.get_by_role("status").filter(has_text="Running")).to_have_count(1)
    mill.post("/machines/mill/estop")
    expect(page.get_by_role("dialog", name="Alarm")).to_be_visible()
    expect(page.get_by_role("status").filter(has_text="Alarm")).to_have_count(1)
