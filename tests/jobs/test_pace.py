"""What is left of a run: scripted machines in made-up time, slower than planned, paused, overridden, started anew."""

from dataclasses import dataclass, field
from itertools import pairwise
from math import inf, nan

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcode.timeline import Timeline
from jobs.experience import NO_EXPERIENCE, Experience, Run, learn
from jobs.pace import MOST_STRETCHES, Left, Pace, Reach

LINES = 600
BATCH = 4
CUT_S, RAPID_S = 1.5, 0.5
"""Planned for each line: two seconds, three quarters of which follow the feed override."""
TOTAL_S = LINES * (CUT_S + RAPID_S)


def timeline(lines: int = LINES, *, cut_s: float = CUT_S, rapid_s: float = RAPID_S, link_s: float = 0.0) -> Timeline:
    table = np.outer([cut_s, rapid_s, 0.0, link_s], np.arange(lines + 1.0))
    return Timeline(table, lines)


@dataclass
class Machine:
    """Executes batches of a job, `factor` times as slowly as planned, and says at every end how much is left."""

    factor: float = 1.0
    pace: Pace = field(default_factory=Pace)
    now: float = 1000.0
    line: int = 0
    feed: float = 1.0
    said: list[tuple[int, Left]] = field(default_factory=list)

    def begin(self) -> None:
        self.pace.begin(self.now, self.line)

    def run(self, upto: int = LINES) -> None:
        while self.line < upto:
            count = min(BATCH, upto - self.line)
            self.now += (CUT_S / self.feed + RAPID_S) * count * self.factor
            self.line += count
            self.pace.mark(self.now, self.line)
            if (left := self.left()) is not None:
                self.said.append((self.line, left))

    def override(self, percent: float) -> None:
        self.feed = percent / 100
        self.pace.conditions({"feed": percent}, standing=False)

    def left(self) -> Left | None:
        return self.pace.left(self.now, Reach(self.line, min(self.line + BATCH, LINES), LINES))

    def seconds(self) -> float:
        left = self.left()
        assert left is not None
        return left.seconds

    @property
    def true_s(self) -> float:
        return (LINES - self.line) * (CUT_S / self.feed + RAPID_S) * self.factor


def started(factor: float = 1.0, experience: Experience = NO_EXPERIENCE) -> Machine:
    machine = Machine(factor)
    machine.pace.supply(timeline(), experience)
    machine.begin()
    return machine


def test_at_first_it_is_the_plan_and_the_range_is_wide() -> None:
    left = started().left()
    assert left is not None
    assert left.seconds == pytest.approx(TOTAL_S)
    assert left.least_s < TOTAL_S * 0.75
    assert left.most_s > TOTAL_S * 1.4


def test_the_run_corrects_itself_by_its_own_pace() -> None:
    machine = started(1.2)
    machine.run(LINES // 4)
    assert machine.seconds() == pytest.approx(machine.true_s, rel=0.03)
    machine.run(LINES // 2)
    assert machine.seconds() == pytest.approx(machine.true_s, rel=0.015)


def test_the_range_holds_the_truth_and_collapses() -> None:
    machine = started(1.2)
    machine.run()
    widths = [(left.most_s - left.least_s) for _, left in machine.said]
    assert all(later <= before for before, later in pairwise(widths))
    for line, left in machine.said:
        assert left.least_s <= (LINES - line) * (CUT_S + RAPID_S) * 1.2 <= left.most_s
    assert machine.said[-1][1] == Left(0.0, 0.0, 0.0)


def test_after_a_few_runs_of_a_machine_that_is_a_fifth_slower_the_next_is_right_from_the_beginning() -> None:
    runs: list[Run] = []
    errors: list[float] = []
    for _ in range(4):
        machine = started(1.2, learn(runs))
        errors.append(abs(machine.seconds() / machine.true_s - 1.0))
        machine.run()
        machine.pace.stop()
        runs.append(Run(*machine.pace.so_far()))
        assert runs[-1].taken_s / runs[-1].planned_s == pytest.approx(1.2)
    assert errors == sorted(errors, reverse=True)
    assert errors[0] == pytest.approx(1 - 1 / 1.2)
    assert errors[3] < 0.05


@pytest.mark.parametrize("percent", [50.0, 125.0, 200.0])
def test_a_feed_override_counts_at_once_and_for_the_cuts_alone(percent: float) -> None:
    machine = started()
    machine.run(LINES // 2)
    machine.override(percent)
    assert machine.seconds() == pytest.approx((LINES - machine.line) * (CUT_S * 100 / percent + RAPID_S), rel=0.01)
    machine.run()
    for line, left in machine.said[LINES // 2 // BATCH :]:
        assert left.seconds == pytest.approx((LINES - line) * (CUT_S * 100 / percent + RAPID_S), rel=0.02, abs=0.1)
    planned_s, taken_s = machine.pace.so_far()
    assert taken_s / planned_s == pytest.approx(1.0, rel=1e-6), "an override is no slowness of the machine"


def test_overrides_that_make_no_sense_are_none() -> None:
    machine = started()
    for percent in (0.0, nan, inf, -20.0):
        machine.pace.conditions({"feed": percent, "spindle": 50}, standing=False)
        assert machine.seconds() == pytest.approx(TOTAL_S)


def test_a_pause_freezes_it_and_is_in_no_pace() -> None:
    machine = started(1.2)
    machine.run(200)
    machine.pace.stop()
    frozen = machine.left()
    machine.now += 5000.0
    assert machine.left() == frozen
    machine.begin()
    assert machine.seconds() == pytest.approx(frozen.seconds if frozen else 0)
    machine.run()
    planned_s, taken_s = machine.pace.so_far()
    assert (planned_s, taken_s / planned_s) == (pytest.approx(TOTAL_S), pytest.approx(1.2))


def test_a_break_of_the_link_is_in_no_pace_and_the_first_end_after_it_begins_anew() -> None:
    machine = started()
    machine.run(200)
    machine.pace.stop()
    frozen = machine.left()
    machine.now += 77.0
    assert machine.left() == frozen
    machine.run()
    planned_s, taken_s = machine.pace.so_far()
    assert planned_s == pytest.approx(TOTAL_S - BATCH * (CUT_S + RAPID_S))
    assert taken_s / planned_s == pytest.approx(1.0)


def test_a_hold_of_the_machine_itself_freezes_it() -> None:
    machine = started()
    machine.run(200)
    machine.pace.conditions({}, standing=True)
    before = machine.left()
    machine.now += 60.0
    machine.pace.mark(machine.now, machine.line)  # news of what was over before
    machine.begin()
    assert machine.left() == before
    machine.pace.conditions({}, standing=False)
    machine.run()
    planned_s, taken_s = machine.pace.so_far()
    assert taken_s / planned_s == pytest.approx(1.0)


def test_it_counts_down_within_a_batch_and_no_further() -> None:
    machine = started()
    machine.run(400)
    at_end = machine.seconds()
    machine.now += 3.0
    assert machine.seconds() == pytest.approx(at_end - 3.0)
    machine.now += 500.0
    assert machine.seconds() == pytest.approx(at_end - BATCH * (CUT_S + RAPID_S), abs=0.1)


def test_a_daemon_that_begins_anew_goes_on_with_what_was_known() -> None:
    before = started(1.3)
    before.run(300)
    stored = before.pace.so_far()
    after = Machine(1.3, Pace(*stored), now=5.0, line=300)
    assert after.left() is None, "the program has not been read again yet"
    after.pace.supply(timeline(), NO_EXPERIENCE)
    assert after.seconds() == pytest.approx(before.seconds())
    after.run()
    planned_s, taken_s = after.pace.so_far()
    assert taken_s / planned_s == pytest.approx(1.3)


def test_what_happens_before_the_timeline_is_there_counts_when_it_is() -> None:
    machine = Machine(1.5)
    machine.begin()
    machine.run(100)
    machine.pace.stop()
    machine.begin()
    machine.run(200)
    assert (machine.left(), machine.pace.so_far()) == (None, (0.0, 0.0))
    machine.pace.supply(timeline(), NO_EXPERIENCE)
    assert machine.pace.so_far() == pytest.approx((400.0, 600.0))


def test_what_waits_for_a_timeline_that_never_comes_is_bounded() -> None:
    pace = Pace()
    for number in range(5 * MOST_STRETCHES):
        pace.begin(number * 10.0, number)
        pace.mark(number * 10.0 + 1.0, number + 1)
        pace.stop()
    assert len(pace._uncounted) == MOST_STRETCHES


def test_never_faster_than_the_link() -> None:
    pace = Pace()
    pace.supply(timeline(link_s=5.0), Experience(-1.0, 0.02, 9))
    left = pace.left(0.0, Reach(100, 104, LINES))
    assert left == Left(496 * 5.0, 496 * 5.0, 496 * 5.0)


@pytest.mark.parametrize("second", [0.0, nan])
def test_a_plan_without_time_is_no_estimate(second: float) -> None:
    pace = Pace()
    pace.supply(timeline(cut_s=second, rapid_s=0.0), NO_EXPERIENCE)
    pace.begin(0.0, 0)
    pace.mark(10.0, 5)
    assert pace.left(10.0, Reach(5, 9, LINES)) is None


def test_a_part_of_a_program_is_as_long_as_its_lines() -> None:
    pace = Pace()
    pace.supply(timeline(), NO_EXPERIENCE)
    left = pace.left(0.0, Reach(99, 99, 199))
    assert left is not None
    assert left.seconds == pytest.approx(200.0)


step = st.one_of(
    st.tuples(st.just("mark"), st.integers(0, 20), st.floats(0, 100)),
    st.tuples(st.just("stop"), st.just(0), st.floats(0, 100)),
    st.tuples(st.just("begin"), st.just(0), st.floats(0, 100)),
    st.tuples(st.just("feed"), st.integers(-10, 300), st.floats(0, 1)),
    st.tuples(st.just("hold"), st.integers(0, 1), st.floats(0, 1)),
)


@given(st.lists(step, max_size=40), st.integers(0, 40))
def test_whatever_happens_the_range_is_around_the_estimate(steps: list[tuple[str, int, float]], known: int) -> None:
    pace, now, line = Pace(), 0.0, 0
    for number, (what, value, passed_s) in enumerate(steps):
        now += passed_s
        if number == known:
            pace.supply(timeline(), NO_EXPERIENCE)
        match what:
            case "mark":
                line = min(line + value, LINES)
                pace.mark(now, line)
            case "stop":
                pace.stop()
            case "begin":
                pace.begin(now, line)
            case "feed":
                pace.conditions({"feed": value}, standing=False)
            case _:
                pace.conditions({}, standing=bool(value))
        left = pace.left(now, Reach(line, min(line + 8, LINES), LINES))
        assert (left is None) == (number < known)
        if left is not None:
            assert 0.0 <= left.least_s <= left.seconds <= left.most_s < inf
    planned_s, taken_s = pace.so_far()
    assert 0.0 <= taken_s <= now
    assert 0.0 <= planned_s < inf
