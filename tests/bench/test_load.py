"""The load of many at once, in a tiny setting; what a crowd takes away and what it got is told right."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from bench import load, loadrig
from bench.load import CROWD, QUIET, STAND_IN, Crowded, Plan
from bench.loadclients import Crowd, Load
from bench.loadrig import Phase
from bench.report import Report
from bench.tap import DeadTime

WHO = Crowd("", 0, readers=2, topics="state", requests_s=50.0, upload_bytes=load.UPLOAD_BYTES)


def dead(seconds: float) -> DeadTime:
    return DeadTime(11, 20, 10.0 + seconds, 10.0, 0.1, 0.1, 0.0, seconds - 0.1, 0.0, 0.0)


def crowded(**phases: list[Phase]) -> Crowded:
    daemon = SimpleNamespace(address=("127.0.0.1", 1), resident_mb=lambda: 70.0)
    shop: Any = SimpleNamespace(daemon=daemon)
    found = Crowded(shop, WHO, load.silent)
    found.phases |= phases
    return found


def phase(dead_s: float, row_s: float, dry_s: float = 0.0) -> Phase:
    return Phase(5.0, dead(dead_s), [row_s] * 4, dry_s, 1.0)


@pytest.mark.parametrize(("seconds", "met"), [(0.2, True), (0.209, True), (0.3, False)])
def test_dead_time_is_held_against_the_quiet_phases(seconds: float, met: bool) -> None:
    found = crowded(quiet=[phase(0.2, 1.0)] * 2, crowd=[phase(seconds, 1.0)] * 2)
    report = Report.of("", [("it", load.on_elvinto(found))])
    ratio = report.groups[0][1][0]
    assert ratio.value == pytest.approx(seconds / 0.2)
    assert ratio.met is met
    assert report.value("it", "dead time of a batch, crowd") == pytest.approx(100 * seconds)
    assert report.value("it", "  the daemon between OK and the next command, quiet") == pytest.approx(10.0)
    assert report.value("it", "batches, crowd") == 20


@pytest.mark.parametrize(("seconds", "met"), [(1.0, True), (1.04, True), (1.06, False)])
def test_rows_that_take_longer_and_a_planner_run_dry_show(seconds: float, met: bool) -> None:
    found = crowded(quiet=[phase(0.2, 1.0)] * 2, crowd=[phase(0.2, seconds, dry_s=0.05)] * 2)
    report = Report.of("", [("it", load.on_grbl(found))])
    assert report.groups[0][1][0].value == pytest.approx(seconds)
    assert report.groups[0][1][0].met is met
    assert report.value("it", "planner run dry, of the time, crowd") == pytest.approx(1.0)
    assert report.value("it", "planner run dry, of the time, quiet") == 0


def test_what_the_computer_takes_away_itself_stands_beside_it() -> None:
    phases = {QUIET: [phase(0.2, 1.0)], CROWD: [phase(0.22, 1.0)], STAND_IN: [phase(0.21, 1.02)]}
    found = crowded(**phases)
    name = "with a stand-in for the daemon / the quiet phases'"
    assert Report.of("", [("it", load.on_elvinto(found))]).value("it", name) == pytest.approx(1.05)
    assert Report.of("", [("it", load.on_grbl(found))]).value("it", name) == pytest.approx(1.02)


def test_a_crowd_that_did_not_get_what_it_asked_for_shows() -> None:
    found = crowded(quiet=[phase(0.2, 1.0)], crowd=[phase(0.2, 1.0)])
    found.loads[CROWD] = Load(
        requests=500, uploaded_bytes=2 * 10**9, seconds=10.0, answers_s=[0.01, 0.02], messages=400
    )
    report = Report.of("", [("it", load.came(found, WHO))])
    assert report.value("it", "messages a second to each reader") == 20
    assert [str(figure) for figure in report.groups[0][1] if figure.met is False] == []
    found.loads[CROWD] = Load(requests=480, uploaded_bytes=10**8, seconds=10.0, refusals={"/jobs: 500": 1})
    missed = [figure.name for figure in load.came(found, WHO) if figure.met is False]
    assert missed == ["requests a second", "refused or cut off, /jobs: 500", "uploaded meanwhile"]


@pytest.mark.real
def test_everything_at_once_beside_two_jobs(monkeypatch: pytest.MonkeyPatch) -> None:
    """A daemon, two machines, a crowd, its stand-in: each part tells what it found before the next one begins. It takes
    some seconds, for these are six processes and two jobs; what it holds together is tried nowhere else."""
    monkeypatch.setattr(loadrig, "SETTLE_S", 0.05)
    monkeypatch.setattr(loadrig, "AT_WORK_BLOCKS", 5)
    said: list[str] = []
    plan = Plan(readers=3, upload_bytes=2_000_000, phase_s=0.4, rounds=1, pressed=2, pressed_quiet=2, pause_rounds=1)
    report = load.run(("workshop", "pause"), say=said.append, plan=plan)
    on_elvinto, on_grbl, got, quiet, crowd, stand_in, beside = [heading for heading, _ in report.groups]
    assert report.value(on_elvinto, "dead time / the quiet phases'") > 0
    assert report.value(on_grbl, "time of a row / the quiet phases'") > 0
    assert report.value(got, "refused or cut off") == 0
    for name in ("requests a second", "uploaded meanwhile", "messages a second to each reader"):
        assert report.value(got, name) > 0
        assert report.value(beside, name) > 0
    assert report.value(got, "memory of the daemon, highest") >= report.value(got, "memory of the daemon before") > 10
    for presses in (quiet, crowd, stand_in):
        assert report.value(presses, "presses") == 2
        assert 0 < report.value(presses, "median") <= report.value(presses, "longest")
    lines = [line for line in said if line.startswith("  ") and "/" in line]
    assert [line.split()[2] for line in lines if "workshop" in line] == [QUIET, CROWD, STAND_IN]
    assert said.index(lines[-1]) > max(number for number, text in enumerate(said) if on_elvinto in text)


def test_the_length_of_a_run_is_known_before() -> None:
    plan = Plan()
    assert plan.seconds(("dashboards",)) < plan.seconds(load.PARTS) <= 300
    assert replace(plan, rounds=9).seconds(("pause",)) == plan.seconds(("pause",))
