"""When STATE is due."""

from sim.elvinto.reports import Reports
from sim.elvinto.settings import SimSettings


def test_the_interval_runs_over_batches() -> None:
    reports = Reports(SimSettings(state_interval_s=0.2))
    reports.moving(1.0)
    assert reports.due_at == 1.0
    reports.said(1.0)
    reports.cancel()
    reports.moving(1.05)
    assert reports.due_at == 1.2
    reports.moving(1.1)
    assert reports.due_at == 1.2


def test_idle_is_said_so_many_times() -> None:
    reports = Reports(SimSettings(state_interval_s=0.5, idle_reports=2))
    reports.came_to_rest(1.0)
    assert reports.due_at == 1.5
    reports.repeat(1.5, alarm=False, running=False)
    assert reports.due_at == 2.0
    reports.repeat(2.0, alarm=False, running=False)
    assert reports.due_at is None


def test_no_idle_reports() -> None:
    reports = Reports(SimSettings(idle_reports=0))
    reports.came_to_rest(1.0)
    assert reports.due_at is None


def test_an_alarm_stands_before_the_rest() -> None:
    reports = Reports(SimSettings(alarm_repeat_s=3.0))
    reports.came_to_rest(1.0)
    reports.alarm(1.1)
    assert reports.due_at == 4.1
    reports.repeat(4.1, alarm=True, running=False)
    assert reports.due_at == 7.1
