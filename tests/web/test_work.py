"""A day's work on the dashboard, in a real browser: upload, check, start, pause, resume, history, queue, files."""

import json
import re
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import expect

from tests.harness.browser import Screen
from tests.harness.process import Daemon, until

pytestmark = pytest.mark.real

CLEAN = "G21 G90\nG28\nM3 S12000\n"
PART = CLEAN + "".join(f"G1 X{i % 20} Y{i % 7} F3000\n" for i in range(1, 120)) + "M5\nM30\n"
LASTING = CLEAN + "".join(f"G1 X{i % 20} Y{i % 7} F3000\n" for i in range(1, 4001)) + "M5\nM30\n"
"""A minute: it still runs when the slowest computer has found the next button."""
FAULTY = "G21 G90\nG1 X5 F1000\nG55\nM30\n"


def held(mill: Daemon, name: str, text: str, **options: Any) -> int:
    program = mill.http.post("/api/v1/programs", params={"name": name}, content=text).json()
    body = {"program": program["id"], "machine": "mill", "hold": True, "force": True, **options}
    return int(mill.post("/jobs", body)["id"])


def upload(person: Screen, name: str, text: str) -> None:
    person.go("mill/programs")
    person.named("file").set_input_files({"name": name, "mimeType": "text/plain", "buffer": text.encode()})
    expect(person.named("program").locator("h2")).to_contain_text(name)


def test_from_the_upload_to_the_history(person: Screen, mill: Daemon) -> None:
    begun(person, "lasting.nc", LASTING)
    person.status("run")
    done = person.named("done")
    expect(done).to_have_text(re.compile(r"line [1-9][\d,]* of 4,?005"))
    person.press("pause")
    person.status("hold")
    expect(person.named("status")).to_have_text("Paused")
    lasting = mill.get("/jobs?limit=1")[0]
    assert lasting["status"] == "paused"
    expect(done).to_contain_text(re.compile(rf"line {lasting['progress']['line']:,}".replace(",", ",?")))
    person.press("resume")
    person.status("run")
    person.press("stop")
    person.status("idle")
    begun(person, "part.nc", PART)
    part = mill.get("/jobs?limit=1")[0]
    mill.status(part["id"], "completed")
    person.page.get_by_role("link", name="Jobs").click()
    expect(person.page.locator(f"tr[data-job='{lasting['id']}']")).to_have_attribute("data-status", "cancelled")
    row = person.page.locator(f"tr[data-job='{part['id']}']")
    expect(row).to_have_attribute("data-status", "completed")
    row.click()
    expect(person.named("certain")).to_have_text("line 124 of 124")


def begun(person: Screen, name: str, text: str) -> None:
    """Hand it in and run it; G28 is a warning on this controller."""
    upload(person, name, text)
    expect(person.named("report")).to_have_attribute("data-verdict", "warnings")
    person.press("run")
    person.press("force")
    expect(person.page).to_have_url(re.compile("/machine$"))


def test_a_file_is_dropped_in_from_anywhere_on_the_page(person: Screen) -> None:
    person.go("mill/programs")
    dropped = person.page.evaluate_handle(
        """(text) => {
            const files = new DataTransfer();
            files.items.add(new File([text], "dropped.nc"));
            return files;
        }""",
        f"{CLEAN}G1 X4 F900\nM30\n",
    )
    person.page.dispatch_event("body", "dragover", {"dataTransfer": dropped})
    expect(person.page.locator(".drop")).to_have_class(re.compile("over"))
    person.page.dispatch_event("body", "drop", {"dataTransfer": dropped})
    expect(person.named("program").locator("h2")).to_contain_text("dropped.nc")
    expect(person.named("report")).to_be_visible()


def test_a_program_with_errors_cannot_be_started_and_shows_the_line(person: Screen) -> None:
    upload(person, "faulty.nc", FAULTY)
    expect(person.named("report")).to_have_attribute("data-verdict", "errors")
    for button in ("run", "enqueue"):
        expect(person.named(button)).to_have_attribute("aria-disabled", "true")
        expect(person.named(button)).to_contain_text("check has errors")
    person.page.locator("[data-name=report] button[data-line='3']").click()
    expect(person.page.locator(".lines li.shown")).to_have_attribute("data-line", "3")
    expect(person.page.locator(".lines li.m-errors code")).to_have_text("G55")


def test_the_queue_is_put_in_another_order_and_started(person: Screen, mill: Daemon) -> None:
    first, second, third = (held(mill, f"p{n}.nc", f"{CLEAN}G1 X{n} F900\nM30\n") for n in (1, 2, 3))
    names = person.page.locator("[data-name=queue] li .name")
    expect(names).to_have_text(["p1.nc", "p2.nc", "p3.nc"])
    person.page.locator(f"[data-name=queue] li[data-job='{third}']").get_by_role("button", name="Earlier").click()
    expect(names).to_have_text(["p1.nc", "p3.nc", "p2.nc"])
    person.page.locator(f"[data-name=queue] li[data-job='{first}'] [data-name=remove]").click()
    expect(names).to_have_text(["p3.nc", "p2.nc"])
    person.press("start")
    mill.status(third, "completed")
    expect(names).to_have_text(["p2.nc"])
    assert mill.get(f"/jobs/{second}")["status"] == "queued"


def test_a_part_of_a_program_waits_on_hold_with_a_note_and_what_the_controller_lacks_says_so(
    person: Screen, mill: Daemon
) -> None:
    upload(person, "options.nc", PART.replace("X1 ", "X2 "))
    person.named("options").click()
    for name in ("mode", "on_error"):
        expect(person.named(name)).to_be_disabled()
    expect(person.page.locator("label", has=person.named("mode"))).to_contain_text("not on this controller")
    person.named("start_line").fill("4")
    person.named("end_line").fill("9")
    person.named("note").press_sequentially("left vice ")
    person.press("enqueue")
    person.press("force")
    expect(person.page).to_have_url(re.compile("/jobs$"))
    [job] = mill.get("/jobs?status=queued")
    assert [job[key] for key in ("start_line", "end_line", "note", "hold")] == [4, 9, "left vice", True]
    person.go(f"mill/jobs/{job['id']}")
    expect(person.named("job")).to_contain_text("4 – 9")
    expect(person.named("job")).to_contain_text("left vice")
    person.go(f"mill/programs/{job['program']}")
    person.named("options").click()
    person.named("end_line").fill("5")
    person.named("hold").uncheck()
    expect(person.named("enqueue")).to_contain_text("begins by itself")
    person.press("enqueue")
    person.press("force")
    until(lambda: "completed" in [one["status"] for one in mill.get("/jobs?limit=1")])


def test_the_history_is_filtered_run_again_and_taken_away_as_files(person: Screen, mill: Daemon) -> None:
    done = mill.job(f"{CLEAN}G1 X1 F900\nM30\n")
    mill.status(done, "completed")
    cancelled = held(mill, "held.nc", f"{CLEAN}G1 X2 F900\nM30\n")
    mill.post(f"/jobs/{cancelled}/cancel")
    person.go("mill/jobs")
    rows = person.page.locator("tr[data-job]")
    expect(rows.nth(0)).to_have_attribute("data-job", str(cancelled))
    expect(rows.nth(1)).to_have_attribute("data-job", str(done))
    person.page.locator("[data-filter=cancelled]").click()
    expect(person.page.locator(f"tr[data-job='{done}']")).to_have_count(0)
    expect(rows.nth(0)).to_have_attribute("data-job", str(cancelled))
    person.go(f"mill/jobs/{done}")
    person.page.locator("[data-journal=batches]").click()
    assert downloaded(person, "csv").startswith("seq,wire_id,line_from,line_to,")
    assert json.loads(downloaded(person, "json"))["job"]["status"] == "completed"
    person.press("rerun")
    expect(person.page).to_have_url(re.compile(rf"/jobs/{cancelled + 1}$"))
    expect(person.named("job")).to_have_attribute("data-status", "completed")


def downloaded(person: Screen, button: str) -> str:
    with person.page.expect_download() as waiting:
        person.named(button).click()
    return Path(waiting.value.path()).read_text(encoding="utf-8")


def test_a_million_lines_open_at_once(person: Screen, mill: Daemon) -> None:
    text = "".join(f"G1 X{i % 900}.{i % 10} Y{i % 70} F3000 (line {i})\n" for i in range(1, 1_000_001))
    stored = mill.http.post("/api/v1/programs?name=long.nc", content=text).json()
    lines, shown = person.page.locator(".lines li"), person.page.locator(".lines li.shown")
    person.go(f"mill/programs/{stored['id']}")
    expect(lines.first).to_have_text(re.compile(r"^1\s*G1 X1\.1 Y1 F3000 \(line 1\)$"))
    person.named("go-line").fill("765432")
    person.named("go-line").press("Enter")
    expect(shown).to_have_text(re.compile(r"^765432\s*.*\(line 765432\)$"))
    person.named("lines").press("End")
    expect(lines.last).to_have_text(re.compile(r"^1000000\s*.*\(line 1000000\)$"))
    person.named("lines").press("PageUp")
    seen = person.page.evaluate("[...document.querySelectorAll('.lines li')].map((one) => Number(one.dataset.line))")
    assert seen == list(range(seen[0], seen[-1] + 1))
    assert seen[-1] < 1_000_000
    assert len(seen) < 120, "only what is in sight is drawn"
    box = "document.querySelector('.lines')"
    person.page.evaluate(f"{box}.scrollTop = {box}.scrollHeight / 2")
    expect(lines.nth(5)).to_have_text(re.compile(r"\(line (49|50)\d{4}\)$"))


def test_what_files_and_people_say_is_text(person: Screen, mill: Daemon) -> None:
    trap = "<img src=x onerror=alert>"
    job = held(mill, f"{trap}.nc", f"{CLEAN}(a comment)\nM30\n", note=trap)
    program = mill.get(f"/jobs/{job}")["program"]
    for place in ("", "mill/programs", f"mill/programs/{program}", "mill/jobs", f"mill/jobs/{job}"):
        person.go(place)
        expect(person.page.get_by_text(trap).first).to_be_visible()
        assert person.page.locator("img[src=x]").count() == 0
