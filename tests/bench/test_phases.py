"""Ratios of phases that take turns, by hand."""

import pytest

from bench.phases import Ratio, Sums, in_turns, median_ratio, ratio


def test_every_round_has_each_condition_and_the_order_is_turned_round() -> None:
    assert list(in_turns("ABC", 3)) == [*"ABC", *"CBA", *"ABC"]


def test_a_ratio_is_of_all_rounds_together() -> None:
    """10 and 1 gaps: the phase with more of them counts for more."""
    found = ratio([Sums(20.0, 10), Sums(4.0, 1)], [Sums(10.0, 10), Sums(1.0, 1)])
    assert found.value == pytest.approx((24 / 11) / (11 / 11))


def test_rounds_that_agree_have_no_spread_and_others_have() -> None:
    quiet = [Sums(1.0, 1)] * 3
    assert ratio([Sums(1.1, 1)] * 3, quiet).spread == pytest.approx(0.0, abs=1e-9)
    # Of three single values the jackknife is the standard error of their mean.
    found = ratio([Sums(one, 1) for one in (1.0, 1.2, 1.4)], quiet)
    assert found.value == pytest.approx(1.2)
    assert found.spread == pytest.approx(0.2 / 3**0.5)


def test_a_drift_of_the_computer_falls_out() -> None:
    """It gets slower all the time; the phases of both conditions are equal otherwise."""
    found: dict[str, list[Sums]] = {"A": [], "B": []}
    for time, condition in enumerate(in_turns("AB", 4)):
        found[condition].append(Sums(10.0 + time, 1))
    assert ratio(found["A"], found["B"]).value == pytest.approx(1.0)


@pytest.mark.parametrize("phases", [[], [Sums(0.0, 0)]])
def test_where_nothing_was_seen_there_is_no_ratio(phases: list[Sums]) -> None:
    assert ratio(phases, [Sums(1.0, 1)]) == Ratio(0.0, 0.0)
    assert ratio([Sums(1.0, 1)], phases) == Ratio(0.0, 0.0)


def test_a_median_does_not_see_the_one_that_was_disturbed() -> None:
    assert median_ratio([1.1, 1.1, 9.0], [1.0, 1.0, 1.0]) == pytest.approx(1.1)
    assert median_ratio([], [1.0]) == 0.0


def test_the_spread_stands_beside_the_ratio() -> None:
    assert "1.012 x +- 0.004" in str(Ratio(1.012, 0.004).figure("it", goal=1.05))
