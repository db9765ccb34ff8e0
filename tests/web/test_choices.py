"""What is chosen, read and asked for with few presses: choices, the band between two jobs, overrides, the menu."""

import re
from collections.abc import Callable, Iterator

import pytest
from playwright.sync_api import expect

from tests.harness.browser import Screen, serious
from tests.harness.stage import BEGAN_AT, EVERYTHING, Json, Stage, job, stage

pytestmark = pytest.mark.real


@pytest.fixture(scope="module")
def play() -> Iterator[Stage]:
    with stage() as one:
        yield one


@pytest.fixture
def one(play: Stage, screens: Callable[..., Screen]) -> Screen:
    play.jobs = []
    screen = screens(play.url)
    screen.go("mill/machine")
    return screen


def chosen(one: Screen) -> str | None:
    return one.page.locator(".steps [aria-checked=true]").get_attribute("data-step")


def test_a_group_of_choices_is_one_stop_and_arrows_choose_in_it(one: Screen) -> None:
    keys, steps = one.page.keyboard, one.page.locator(".steps [role=radio]")
    one.page.locator("[data-step='10']").focus()
    keys.press("ArrowLeft")
    assert chosen(one) == "1"
    expect(one.page.locator("[data-step='1']")).to_be_focused()
    for _ in range(3):
        keys.press("ArrowUp")
    assert chosen(one) == "0", "from the first to the last"
    keys.press("ArrowDown")
    assert chosen(one) == "0.01"
    assert [steps.nth(at).get_attribute("tabindex") for at in range(6)] == ["0", *["-1"] * 5]
    keys.press("Tab")
    assert one.page.evaluate("document.activeElement.closest('.steps')") is None
    one.page.locator("[data-step='1']").click()


def test_an_armed_keyboard_moves_the_machine_wherever_the_keyboard_stands(one: Screen) -> None:
    one.page.route("**/mill/jog", lambda route: route.fulfill(json={}))
    one.page.locator("[data-step='1']").click()
    one.named("arm").click()
    one.page.locator("[data-step='1']").focus()
    with one.page.expect_request("**/mill/jog") as asked:
        one.page.keyboard.press("ArrowRight")
    assert chosen(one) == "1", "the step is not another one because somebody jogs"
    assert asked.value.post_data_json == {"x": 1, "feed": 1000}


def test_between_two_jobs_the_band_says_how_the_last_one_ended_and_which_one_start_lets_go(
    play: Stage, one: Screen
) -> None:
    play.say("job", job(9000))
    expect(one.page).to_have_title(re.compile(r"^Running 25 % · mill$"))
    error = {"code": "alarm", "message": "The limit switch of X was hit.", "line_from": 9001, "line_to": 9003}
    play.say("job", job(9000, status="failed", error=error, ended_at="2026-03-01T10:30:00Z"))
    waiting: list[Json] = [{"id": number, "program_name": "flange.nc", "hold": True} for number in (18, 19)]
    waiting[1]["hold_reason"] = {"code": "not_connected", "message": "mill is connecting."}
    for number, note in ((18, "left vice"), (19, "right vice")):
        play.say("job", job(0, id=number, status="queued", hold=True, note=note, started_at=None))
    play.say("queue", {"jobs": waiting})
    between = one.named("between")
    for text in ("part.nc", "failed", error["message"], "Start lets go: flange.nc"):
        expect(between).to_contain_text(str(text))
    notes = one.page.locator("[data-name=queue] .note")
    expect(notes).to_have_text(["Job 18 · left vice", "Job 19 · right vice · the machine was not connected"])
    expect(one.page.locator(".notice.error")).to_contain_text("mill: part.nc: failed")
    expect(one.page).to_have_title("Idle · mill")
    assert serious(one.page) == []
    play.say("queue", {"jobs": []})


def test_each_line_of_the_source_has_a_word_while_its_job_is_at_work(play: Stage, one: Screen) -> None:
    play.say("job", job(4))
    words = one.page.locator("[data-name=now-lines] small")
    expect(words).to_have_text(["done", *["sent"] * 3, *["not reported yet"] * 4])
    play.say("job", job(4, status="cancelled", ended_at="2026-03-01T10:30:00Z"))


def test_the_call_for_a_tool_says_what_the_tool_table_has_of_it(play: Stage, screens: Callable[..., Screen]) -> None:
    play.machine = {**play.machine, "capabilities": [*EVERYTHING, "tools"]}
    one = screens(play.url)
    table = {"tools": [{"number": 3, "diameter": 6.0, "comment": "end mill"}, {"number": 4, "comment": "drill"}]}
    one.page.route("**/mill/tools", lambda route: route.fulfill(json=table))
    one.go("mill/machine")
    play.say("job", job(5, status="waiting", tool=3))
    expect(one.named("tool-facts")).to_have_text("⌀ 6 mm · end mill")
    play.say("job", job(5, status="cancelled", ended_at="2026-03-01T10:30:00Z"))


def test_whether_a_program_fits_the_reach_follows_the_zero(play: Stage, screens: Callable[..., Screen]) -> None:
    play.machine = {**play.machine, "travel": {"x": [-100.0, 0.0], "y": [-100.0, 0.0]}}
    one = screens(play.url)
    program = {"id": "part", "name": "part.nc", "lines": 3, "bytes": 30, "created_at": BEGAN_AT.isoformat()}
    report = {"errors": [], "warnings": [], "infos": [], "bounds": {"x": [0.0, 50.0], "y": [-5.0, 5.0]}, "seconds": 9}
    more = {"cut_mm": 50, "rapid_mm": 5, "tools": [], "feeds": [900]}
    one.page.route("**/programs/part", lambda route: route.fulfill(json=program))
    one.page.route("**/programs/part/check?*", lambda route: route.fulfill(json={**report, **more}))
    one.page.route("**/programs/part/source?*", lambda route: route.fulfill(json={"lines": []}))
    one.go("mill/programs/part")
    expect(one.named("beyond")).to_contain_text("X, Y")
    play.show(position={"machine": {"x": -60.0, "y": -50.0, "z": 0.0}, "work": {"x": 0.0, "y": 0.0, "z": 0.0}})
    expect(one.named("within")).to_be_visible()
    expect(one.named("beyond")).to_have_count(0)


def test_the_menu_closes_by_escape_and_by_a_touch_elsewhere(one: Screen) -> None:
    body = one.page.locator(".menu-body")
    one.named("menu").click()
    one.page.keyboard.press("Tab")
    one.page.keyboard.press("Escape")
    expect(body).to_have_count(0)
    expect(one.named("menu")).to_be_focused()
    one.named("menu").click()
    expect(body).to_be_visible()
    one.page.locator("main h2").first.click()
    expect(body).to_have_count(0)
