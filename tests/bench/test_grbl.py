"""Streaming to a Grbl, in a tiny setting: what simulated time says is a test, what a clock says is only looked at."""

import asyncio
from pathlib import Path

import pytest

from bench import grbl, grblrig
from bench.grblpeer import Witness, settings
from bench.programs import as_bytes
from bench.report import Report


def test_a_grbl_line_is_kept_full_and_its_planner_fed() -> None:
    # Simulated time: nothing of this depends on the computer.
    groups = dict(grbl.in_simulated_time(700))
    report = Report.of(grbl.TITLE, groups.items())
    for heading, figures in report.groups:
        assert [str(figure) for figure in figures if figure.met is False] == [], heading
    full = report.value("check mode, as it is, simulated time", "of what the line can carry")
    assert grbl.GOAL_WIRE <= full <= 100
    assert report.value("lines of 5 ms, simulated time", "from the first move to the end of the last") > 3


def test_a_line_that_is_not_kept_full_shows() -> None:
    # One line, wait, the next one: what the figures of the window are measured against.
    found = grbl.simulated(as_bytes(grbl.carved(1, 200)), compact=False, mode="check", streaming="line")
    assert found.wire < 0.95


def test_a_planner_that_runs_dry_shows() -> None:
    """Two lines 10 s apart, each a move of a second or so."""
    witness = Witness(settings(500.0), now=0.0)
    for number, at in enumerate((1.0, 11.0)):
        line = b"G1X%dF600\n" % (10 * (number + 1))
        witness.heard(line, at)
        witness.machine.receive_data(line, at)
        while (due_at := witness.machine.next_timer()) is not None and due_at < at + 9:
            witness.machine.handle_timer(due_at)
    found = witness.seen(grbl.BAUD)
    assert found.starved == 1
    assert 8 < found.starved_s < 10
    assert found.starved_s + 1 < found.motion_s < 13
    assert witness.lines == 2


@pytest.mark.parametrize(("way_mm", "feed_mm_min"), [(100, 1000), (100, 6000)])
def test_between_long_ways_the_machine_never_comes_to_rest(way_mm: int, feed_mm_min: int) -> None:
    """Of lines of a second and more a batch holds few: all the same enough are inside to prove the first of them."""
    ways = [f"G1 X{10 + way_mm * (row % 2)} Y{10 + row} F{feed_mm_min}" for row in range(60)]
    found = grbl.simulated(as_bytes(iter(["G21 G90", *ways])), compact=True)
    assert found.motion_s > 55
    assert found.starved == 0


@pytest.mark.real
def test_grbl_in_real_time() -> None:
    program = [*grbl.carved(1, 60)]
    found = asyncio.run(grbl.streamed(program, compact=True))
    plain, cpu_s = asyncio.run(grbl.sent_and_waited(program, check=True))
    assert found.lines == plain.lines == 59
    assert found.line_bytes < plain.line_bytes
    assert found.most_waiting_bytes <= 128
    assert found.dropped_bytes == plain.dropped_bytes == 0
    assert found.motion_s > 0
    assert 0 < plain.wire < 1
    assert cpu_s >= 0


@pytest.mark.real
def test_grbl_pauses() -> None:
    found = asyncio.run(grbl.paused(2, readers=3))
    assert len(found) == 2
    assert found[0] > 0


@pytest.mark.real
def test_grblsim_where_it_is(tmp_path: Path) -> None:
    if (grblsim := grblrig.compiled(tmp_path)) is None:
        pytest.skip("grblsim.c or a C compiler is not there")
    (_, bare), *groups = grbl.on_grblsim(grblsim, 60, 120)
    assert {figure.name: figure.value for figure in bare}["lines a second"] > 0
    assert len(groups) == 4
    for heading, rows in groups:
        figures = {figure.name: figure for figure in rows}
        assert figures["lines a second"].value > 0, heading
        assert figures["most bytes without an answer"].met
        assert figures["overflows"].met


def test_without_grblsim_the_report_says_so(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(grblrig, "SOURCE", tmp_path / "nowhere.c")
    assert grblrig.compiled(tmp_path) is None
