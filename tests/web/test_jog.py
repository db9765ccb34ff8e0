"""Moving by hand: steps, held buttons, the keyboard, zeroes. The judge is the position that the machine reports."""

import time
from collections.abc import Callable

import pytest
from playwright.sync_api import expect

from tests.harness.browser import Screen, serious
from tests.harness.process import Daemon, until

pytestmark = pytest.mark.real

STILL_S = 0.5


def at(mill: Daemon) -> dict[str, float]:
    return dict(mill.get("/machines/mill/state")["position"]["work"])


def resting(mill: Daemon) -> dict[str, float]:
    """Where it stands once it stands."""
    while True:
        before = at(mill)
        time.sleep(STILL_S)
        if at(mill) == before and mill.get("/machines/mill/state")["status"] == "idle":
            return before


def axis(person: Screen, name: str) -> str:
    return person.page.locator(f".axes li[data-axis={name}] .work").inner_text()


def test_a_press_moves_by_the_step_and_the_digits_follow(person: Screen, mill: Daemon) -> None:
    before = resting(mill)
    person.page.locator("[data-step='10']").click()
    person.page.locator("[data-jog='X+']").click()
    until(lambda: at(mill)["x"] == before["x"] + 10)
    expect(person.page.locator(".axes li[data-axis=x] .work")).to_have_text(f"{before['x'] + 10:.3f}")
    person.status("idle")
    person.page.locator("[data-step='1']").click()
    person.page.locator("[data-jog='Z+']").click()
    until(lambda: at(mill)["z"] == before["z"] + 1)


def test_a_held_button_moves_until_it_is_let_go(person: Screen, mill: Daemon) -> None:
    before = resting(mill)
    person.page.locator("[data-step='0']").click()
    button = person.page.locator("[data-jog='Y+']")
    button.hover()
    person.page.mouse.down()
    until(lambda: at(mill)["y"] > before["y"] + 5)
    person.page.mouse.up()
    stopped = resting(mill)
    assert stopped["y"] > before["y"] + 5
    assert at(mill) == stopped


def test_a_held_jog_ends_with_the_page_that_held_it(person: Screen, mill: Daemon) -> None:
    person.page.locator("[data-step='0']").click()
    before = resting(mill)
    person.page.locator("[data-jog='X+']").hover()
    person.page.mouse.down()
    until(lambda: at(mill)["x"] > before["x"] + 3)
    person.page.close()
    stopped = resting(mill)
    time.sleep(STILL_S)
    assert at(mill) == stopped


def test_keys_move_only_while_the_keyboard_is_armed(person: Screen, mill: Daemon) -> None:
    before = resting(mill)
    person.page.locator("[data-step='1']").click()
    person.page.locator("h2").first.click()  # arrows choose among the steps while the keyboard stands there
    person.page.keyboard.press("ArrowRight")
    assert resting(mill) == before, "nobody has armed it"
    person.named("arm").click()
    expect(person.named("arm")).to_have_attribute("aria-pressed", "true")
    person.page.keyboard.press("ArrowRight")
    until(lambda: at(mill)["x"] == before["x"] + 1)
    until(lambda: axis(person, "x") == f"{before['x'] + 1:.3f}")  # else `idle` may be that of before
    person.status("idle")
    person.page.keyboard.press("PageUp")
    until(lambda: at(mill)["z"] == before["z"] + 1)
    person.page.locator("#jog-feed").focus()
    person.page.keyboard.press("ArrowUp")
    assert resting(mill)["y"] == before["y"], "a key typed into a field is no jog"
    person.page.locator("h2").first.click()
    person.page.keyboard.press("Escape")
    expect(person.named("arm")).to_have_attribute("aria-pressed", "false")
    person.page.keyboard.press("ArrowRight")
    assert resting(mill)["x"] == before["x"] + 1


def test_an_axis_is_zeroed_after_a_question_and_zero_is_reached_again(person: Screen, mill: Daemon) -> None:
    mill.post("/machines/mill/commands", {"blocks": ["G1 X12 Y4 F3000"]})
    person.press("zero-x")
    expect(person.named("ask-zero")).to_contain_text("X")
    assert at(mill)["x"] != 0, "asked, not done"
    person.press("zero-yes")
    until(lambda: at(mill)["x"] == 0)
    mill.post("/machines/mill/commands", {"blocks": ["G1 X7 F3000"]})
    place = at(mill)
    person.press("go-zero")
    expect(person.named("ask-go")).to_contain_text(f"stays at Z {place['z']:.3f}")
    assert at(mill) == place, "asked, not done"
    person.press("go-yes")
    until(lambda: (at(mill)["x"], at(mill)["y"]) == (0, 0))
    until(lambda: axis(person, "x") == "0.000")


def test_one_moves_the_machine_the_others_see_who_and_may_take_over(
    person: Screen, mill: Daemon, screens: Callable[..., Screen]
) -> None:
    other = screens(mill.url)
    other.go("mill/machine")
    other.page.locator("[data-step='1']").click()
    person.page.locator("[data-jog='X+']").click()
    expect(person.named("control")).to_contain_text("You move this machine")
    holder = mill.get("/machines/mill/control")["holder"]["client"]
    assert holder.startswith("browser-")
    expect(other.named("control")).to_contain_text(holder)
    expect(other.named("jog-why")).to_have_text("another one moves it")
    person.status("idle")
    other.press("reset")  # which is not held back before, and asks
    expect(other.named("ask-takeover")).to_contain_text(holder)
    other.allowed.append("status of 409")
    assert serious(other.page) == []
    other.press("takeover-yes")
    expect(other.named("control")).to_contain_text("You move this machine")
    expect(person.named("jog-why")).to_have_text("another one moves it")
    mill.post("/machines/mill/estop")
    person.press("call-unlock")  # refused from within a dialog, asked above it
    person.allowed.append("status of 409")
    person.press("takeover-yes")
    expect(person.named("control")).to_contain_text("You move this machine")
    person.press("call-unlock")
    person.status("idle")
    other.press("control-take")
    expect(other.named("control")).to_contain_text("You move this machine")
    person.press("control-take")
    expect(person.named("control")).to_contain_text("You move this machine")
    person.press("control-release")
    for one in (person, other):
        expect(one.named("control")).to_have_count(0)


def test_while_a_job_runs_nothing_moves_by_hand_and_the_page_says_why(person: Screen, mill: Daemon) -> None:
    mill.job("G21 G90\nG28\n" + "".join(f"G1 X{i % 50} F1500\n" for i in range(1, 3000)) + "M30\n")
    person.status("run")
    expect(person.named("jog-why")).to_have_text("a job runs")
    for name in ("home", "zero-x", "arm", "unlock"):
        expect(person.named(name)).to_have_attribute("aria-disabled", "true")
    expect(person.page.locator("[data-jog='X+']")).to_have_attribute("aria-disabled", "true")


def test_a_block_by_hand_and_the_wire_are_seen_in_the_console(person: Screen, mill: Daemon) -> None:
    person.go("mill/console")
    command = person.page.locator("input[name=block]")
    command.fill("G1 X3 F3000")
    command.press("Enter")
    expect(person.named("answer")).to_have_text("G1 X3 F3000: done")
    person.named("console-filter").fill("g1 x3")
    lines = person.named("wire").locator("li")
    expect(lines).to_have_count(1)
    expect(lines).to_have_class("out")
    command.press_sequentially("g8")
    expect(person.page.get_by_role("option")).to_have_text(["G80 ", "G81 ", "G81.99 ", "G83 ", "G83.99 "])
    command.press("Escape")
    expect(person.page.get_by_role("option")).to_have_count(0)
    command.press_sequentially("1.")
    command.press("Tab")
    expect(command).to_have_value("G81.99 ")
    expect(command).to_be_focused()
    command.fill("G28 G9")
    command.press("0")
    command.press("Backspace")
    person.page.locator("[data-code=G92]").click()
    expect(command).to_have_value("G28 G92 ")
    command.fill("G55")
    command.press("Enter")
    expect(person.named("answer")).to_have_text("G55: refused")
    command.press("ArrowUp")
    expect(command).to_have_value("G55")
    trap = "(<img src=x onerror=alert>)"
    person.named("console-filter").fill("")
    command.fill(trap)
    command.press("Enter")
    expect(person.named("answer")).to_contain_text(trap)
    assert person.page.locator("img[src=x]").count() == 0, "what goes over the wire is text"
