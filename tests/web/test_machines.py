"""Several machines on one page, the card in a controller, and the sound of a call."""

import json
import re
from collections.abc import Callable, Iterator

import pytest
from playwright.sync_api import Browser, expect
from websockets.sync.client import connect

from tests.harness.browser import PHONE, Screen, serious, topmost, unheld
from tests.harness.process import Daemon, daemon, until

pytestmark = pytest.mark.real

SECOND = """
[[machine]]
name = "lathe"
port = "sim:?speed_factor=4&sd=CARD"
[[machine]]
name = "saw"
port = "sim:?speed_factor=4"
[machine.toolchanger]
kind = "external"
start_in_estop = false
jumpers = ["emc-enable-in", "emc-abort-ack", "start-change-ack"]
ack_timeout = 0
"""
TOOL = "G21 G90\nG28\nT3 M6\nG1 X10 F3000\nM30\n"
AGAIN_MS = 4000
"""lib/sound.js"""
COUNT_TONES = """
    window.tones = 0;
    const every = setInterval, start = OscillatorNode.prototype.start;
    window.setInterval = (what, ms, ...more) => every(what, ms === AGAIN ? ms / 10 : ms, ...more);
    OscillatorNode.prototype.start = function (...when) { window.tones += 1; return start.apply(this, when); };
""".replace("AGAIN", str(AGAIN_MS))


@pytest.fixture(scope="module")
def shop(browser: Browser, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    """A mill, a lathe, and a saw whose tools a device changes."""
    folder = tmp_path_factory.mktemp("shop")
    card = folder / "card"
    card.mkdir()
    (card / "part1.nc").write_text("G21 G90\nG1 X9 F3000\nM30\n")
    with daemon(folder, "sim:?speed_factor=4", elvinto=SECOND.replace("CARD", str(card))) as one:
        until(lambda: all(machine["link"] == "connected" for machine in one.get("/machines")))
        yield unheld(one)


def job_of(shop: Daemon, machine: str, text: str) -> int:
    program = shop.http.post("/api/v1/programs?name=t.nc", content=text).json()["id"]
    return int(shop.post("/jobs", {"program": program, "machine": machine, "force": True})["id"])


def test_machines_are_told_apart_and_a_call_leads_to_its_own(shop: Daemon, screens: Callable[..., Screen]) -> None:
    one = screens(shop.url, PHONE)
    one.go("mill/machine")
    chips = one.page.locator(".machines .chip")
    expect(chips).to_have_count(3)
    expect(chips.nth(0)).to_have_attribute("aria-current", "true")
    wide = one.page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth")
    assert wide <= 0
    shop.post("/machines/lathe/commands", {"blocks": ["G1 X7 F3000"]})
    job = job_of(shop, "lathe", TOOL)
    expect(chips.nth(1)).to_contain_text("Waiting")
    one.status("idle")  # the mill does nothing
    call = one.named("call")
    expect(call).to_contain_text("lathe")
    one.page.keyboard.press("Escape")
    shop.post("/machines/mill/estop")
    expect(call).to_contain_text("mill")  # what was put aside hides nothing that comes after it
    expect(one.named("call-strip")).to_contain_text("lathe")
    shop.post("/machines/mill/unlock")
    one.named("call-strip").click()
    expect(one.named("call-confirm")).to_have_count(0)
    call.get_by_role("button", name="Show this machine").click()
    expect(one.page).to_have_url(re.compile("#/lathe/machine"))
    one.status("tool")
    one.press("call-confirm")
    shop.status(job, "completed")
    one.page.locator("#estop").click()
    for name in ("mill", "lathe", "saw"):
        until(lambda name=name: shop.get(f"/machines/{name}/state")["status"] == "alarm")
        shop.post(f"/machines/{name}/unlock")


def test_the_estop_names_the_machine_that_it_did_not_reach_and_the_call_of_the_one_in_sight_comes_first(
    shop: Daemon, screens: Callable[..., Screen]
) -> None:
    one = screens(shop.url)
    one.go("lathe/machine")
    page = one.context.new_page()
    page.route("**/web/app.js", lambda route: route.fulfill(body="", content_type="text/javascript"))
    refusal = {"status": 409, "code": "not_connected", "detail": "saw is not connected."}
    page.route("**/saw/estop", lambda route: route.fulfill(status=409, json=refusal))
    page.goto(shop.url)
    page.locator("#estop").click()
    expect(page.locator("#estop-result")).to_contain_text("sent to mill, lathe. NOT STOPPED: saw.")
    expect(one.named("call-unlock")).to_be_visible()
    one.press("call-unlock")
    expect(one.named("call")).to_contain_text("mill")
    assert shop.get("/machines/lathe/state")["status"] == "idle"
    shop.post("/machines/mill/unlock")
    expect(one.named("call")).to_have_count(0)


def test_the_pins_of_a_changer_are_driven_by_hand_until_it_is_there_itself(
    shop: Daemon, screens: Callable[..., Screen]
) -> None:
    one = screens(shop.url)
    one.go("saw/tools")
    one.page.add_locator_handler(one.named("call"), lambda _: one.page.keyboard.press("Escape"))

    def drive(pin: str) -> None:
        one.press(f"drive-{pin}")
        assert not topmost(one.page, f"[data-name=drive-{pin}]"), "asked for once more"
        if pin == "toolchanger-fault":
            assert serious(one.page) == []
        one.press("drive-yes")
        expect(one.named("ask-drive")).to_have_count(0)

    expect(one.named("tools-connected")).to_contain_text("no")
    drive("toolchanger-clear-fault")
    drive("toolchanger-clear-fault")
    expect(one.named("tools-connected")).to_contain_text("yes")  # the first level that is driven counts as connecting
    job = job_of(shop, "saw", "G21 G90\nT4 M6\nG1 X3 F900\nM30\n")

    for pin in ("tool-prepared", "tool-changed"):
        expect(one.named("tools-waiting")).to_contain_text(pin)
        drive(pin)
        drive(pin)
    shop.status(job, "completed")
    expect(one.named("tools-spindle")).to_contain_text("T4")
    drive("toolchanger-fault")
    expect(one.named("fault")).to_be_visible()
    drive("toolchanger-fault")
    one.press("tools-clear")
    expect(one.named("fault")).to_have_count(0)
    with connect(shop.url.replace("http", "ws") + "/api/v1/events?topics=io", proxy=None) as changer:
        pins = {pin["name"]: pin["value"] for pin in shop.get("/machines/saw/io")["pins"] if pin["direction"] == "in"}
        changer.send(json.dumps({"type": "io", "machine": "saw", "id": 1, "pins": pins}))
        expect(one.named("tools-connected")).to_contain_text("yes")
        for level in (True, False):
            changer.send(json.dumps({"type": "io", "machine": "saw", "id": 2, "pins": {"tool-prepared": level}}))
            expect(one.page.locator("[data-pin=tool-prepared] b")).to_have_text("on" if level else "off")
    expect(one.named("tools-connected")).to_contain_text("no")


def test_the_card_is_read_when_asked_and_a_file_of_it_runs(shop: Daemon, screens: Callable[..., Screen]) -> None:
    one = screens(shop.url)
    one.go("lathe/card")
    expect(one.page.get_by_text("part1.nc")).to_have_count(0)
    one.press("read-card")
    row = one.page.locator("li", has_text="part1.nc")
    expect(row).to_be_visible()
    row.get_by_role("button").click()
    expect(one.page).to_have_url(re.compile("/lathe/machine$"))
    until(lambda: shop.get("/machines/lathe/state")["position"]["work"]["x"] == 9)


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
    expect(loud.named("status")).to_have_text("Idle")
    heard = tones(loud)
    loud.page.wait_for_timeout(AGAIN_MS / 10 * 3)
    assert tones(loud) <= heard + 2, "but for the two that say that the job is done, nothing sounds any more"
    assert tones(quiet) == 0


def tones(one: Screen) -> int:
    return int(one.page.evaluate("window.tones"))
