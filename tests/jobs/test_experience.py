"""What runs say about the next: robust, drawn to the plan, and never sure of itself too early."""

from math import inf, log, nan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from jobs.experience import FURTHEST, MAD_TO_SIGMA, NO_EXPERIENCE, SPREAD_AT_FIRST, SPREAD_AT_LEAST, Run, learn

HOUR = 3600.0


def slower(count: int, factor: float = 1.2, planned_s: float = HOUR) -> list[Run]:
    return [Run(planned_s, planned_s * factor)] * count


def test_without_runs_the_plan_stands() -> None:
    assert learn([]) == NO_EXPERIENCE
    assert (NO_EXPERIENCE.factor, NO_EXPERIENCE.spread) == (1.0, SPREAD_AT_FIRST)


@pytest.mark.parametrize("factor", [0.8, 1.2, 1.5])
def test_a_few_runs_tell_a_machine_that_is_slower_or_faster(factor: float) -> None:
    found = [learn(slower(count, factor)).factor for count in range(6)]
    away = [abs(log(one / factor)) for one in found]
    assert away == sorted(away, reverse=True), "each run brings it nearer"
    assert abs(found[1] - 1.0) < abs(factor - 1.0) * 0.75, "one run alone is not believed"
    assert found[5] == pytest.approx(factor, rel=0.05)
    assert learn(slower(3)).factor == pytest.approx(1.2, rel=0.05)


def test_the_range_narrows_with_runs_that_agree_and_not_with_others() -> None:
    spreads = [learn(slower(count)).spread for count in range(8)]
    assert spreads == sorted(spreads, reverse=True)
    assert spreads[7] < SPREAD_AT_FIRST / 2
    scattered = [Run(HOUR, HOUR * factor) for factor in (0.7, 0.9, 1.2, 1.5, 1.9)]
    assert learn(scattered).spread > 2 * learn(slower(5)).spread


def test_one_odd_run_changes_little() -> None:
    odd = Run(HOUR, HOUR * 4)
    assert learn([*slower(4), odd]).factor == pytest.approx(learn(slower(4)).factor, rel=0.03)


def test_short_runs_count_less() -> None:
    assert learn(slower(3, 1.2, 5.0)).factor < learn(slower(3)).factor
    long_and_short = [*slower(1, 1.2), *slower(5, 2.0, 5.0)]
    assert learn(long_and_short).factor < 1.2


@pytest.mark.parametrize("odd", [Run(0.0, 5.0), Run(5.0, 0.0), Run(nan, 5.0), Run(5.0, inf), Run(-1.0, 5.0)])
def test_what_says_nothing_is_left_out(odd: Run) -> None:
    assert learn([odd]) == NO_EXPERIENCE
    assert learn([odd, *slower(2)]) == learn(slower(2))


seconds = st.one_of(st.floats(), st.floats(0.001, 1e6))


@given(st.lists(st.builds(Run, seconds, seconds), max_size=20))
def test_whatever_was_there_the_factor_is_one_to_calculate_with(runs: list[Run]) -> None:
    found = learn(runs)
    assert abs(found.log_factor) <= FURTHEST
    assert SPREAD_AT_LEAST <= found.spread <= MAD_TO_SIGMA * 2 * FURTHEST
    other = learn(reversed(runs))
    assert (other.log_factor, other.spread) == pytest.approx((found.log_factor, found.spread), abs=1e-9)
