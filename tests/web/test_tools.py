"""A tool change and the pins behind it, in a real browser: the person answers, drives a pin, keeps the tool table."""

from collections.abc import Callable

import pytest
from playwright.sync_api import expect

from tests.harness.browser import PHONE, Screen
from tests.harness.process import Daemon, until

pytestmark = pytest.mark.real


def program(tool: int) -> str:
    """The daemon is shared by tests, and a tool that is in already is not asked for: numbers that no other test has."""
    return f"G21 G90\nG0 Z1\nT{tool} M6\n" + "".join(f"G1 X{i % 3} F900\n" for i in range(9)) + "M30\n"


def test_a_change_that_fails_ends_the_job_and_one_that_is_done_lets_it_go_on(
    mill: Daemon, screens: Callable[..., Screen]
) -> None:
    one = screens(mill.url)
    one.go("mill/tools")
    failed = mill.job(program(71))
    expect(one.named("call")).to_contain_text("Put in tool 71")
    expect(one.page.locator("[data-pin=tool-change]")).to_have_class("on ")
    expect(one.named("tools-waiting")).not_to_contain_text("–")
    one.press("call-fail")
    mill.status(failed, "failed")
    expect(one.named("call")).to_have_count(0)
    one.status("idle")
    done = mill.job(program(72))
    expect(one.named("call")).to_contain_text("Put in tool 72")
    one.press("call-confirm")
    expect(one.named("call")).to_have_count(0)
    mill.status(done, "completed")
    expect(one.named("tools-spindle")).to_contain_text("T72")
    expect(one.page.locator("[data-pin=tool-number] b")).to_have_text("72")


def test_the_tool_in_the_spindle_can_be_said_and_the_table_be_kept(
    mill: Daemon, screens: Callable[..., Screen]
) -> None:
    one = screens(mill.url, PHONE)
    one.go("mill/tools")
    expect(one.named("set-tool")).to_have_attribute("aria-disabled", "true")
    one.named("tool-number").fill("73")
    one.press("set-tool")
    expect(one.named("tools-spindle")).to_contain_text("T73")
    one.named("table-text").fill("T1 P1 D6.0 ;six mm\nnonsense\nT3 P3\n")
    one.press("save-table")
    expect(one.named("tool-table")).to_contain_text("Line 2")
    assert [tool["number"] for tool in mill.get("/machines/mill/tools")["tools"]] == [1, 3]
    one.named("table-text").fill("")
    one.press("save-table")
    until(lambda: mill.get("/machines/mill/tools")["tools"] is None)
    assert one.page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth") <= 0
