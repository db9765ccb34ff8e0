"""Figures and goals as they are printed."""

import pytest

from bench.report import Figure, Report


@pytest.mark.parametrize(
    ("value", "goal", "sense", "met"),
    [(1.03, 1.03, "most", True), (1.04, 1.03, "most", False), (500, 500, "least", True), (499, 500, "least", False)],
)
def test_a_goal_is_met_up_to_itself(value: float, goal: float, sense: str, met: bool) -> None:
    figure = Figure("it", value, goal=goal, sense=sense)  # type: ignore[arg-type]
    assert figure.met is met
    assert ("MISSED" in str(figure)) is not met


def test_without_a_goal_there_is_none_to_miss() -> None:
    assert Figure("it", 5.0).met is None
    assert "goal" not in str(Figure("it", 5.0))


def test_a_report_finds_and_prints_its_figures() -> None:
    report = Report.of("title", [("one", [Figure("a", 1.0, "ms")]), ("two", [Figure("a", 2.0)])])
    assert report.value("two", "a") == 2.0
    assert str(report).splitlines()[0] == "=== title"
    assert "1.00 ms" in str(report)
    with pytest.raises(KeyError, match="three"):
        report.value("three", "a")


def test_a_spread_stands_behind_its_value() -> None:
    assert "1.000 x +- 0.004" in str(Figure("it", 1.0, "x", digits=3, spread=0.004))
