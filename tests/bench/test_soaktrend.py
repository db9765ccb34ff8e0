"""The slope of the soak: exact where a line is one, honest about noise, and one left by each job is always found."""

import math
from random import Random

import pytest

from bench.soaktrend import STUDENT_95, trend

JOBS = [2.0 * day for day in range(181, 361)]
GOAL = 1.0


def test_a_line_is_its_slope() -> None:
    found = trend(JOBS, [7.0 + 3.0 * job for job in JOBS])
    assert found.slope == pytest.approx(3.0)
    assert found.at_most == pytest.approx(3.0)
    assert trend(JOBS, [5.0] * len(JOBS)).at_most == 0.0


def test_the_confidence_is_that_of_a_regression() -> None:
    """Worked by hand: three blocks of one, y = 0, 3, 0 over 0, 1, 2: slope 0, what is left 6, one degree of freedom."""
    found = trend([0.0, 1.0, 2.0], [0.0, 3.0, 0.0], block=1)
    assert found.slope == 0.0
    assert found.at_most == pytest.approx(STUDENT_95[1] * math.sqrt(6 / 1 / 2))
    assert found.spread == found.at_most


def test_a_sawtooth_of_days_and_a_day_out_of_line_are_no_growth() -> None:
    sawtooth = [50.0 * (day % 9) for day in range(180)]
    sawtooth[-1] += 1e6
    assert abs(trend(JOBS, sawtooth).at_most) < GOAL


@pytest.mark.parametrize("most", [50.0, 500.0, 5000.0])
def test_one_left_by_each_job_is_found_whatever_the_noise(most: float) -> None:
    """Nineteen of twenty times, that is: where the noise is too much to tell, nothing is taken for proven."""
    found = 0
    for seed in range(200):
        random = Random(seed)
        found += trend(JOBS, [job + random.uniform(-most, most) for job in JOBS]).at_most > GOAL
    assert found > 180


def test_a_noise_of_some_hundreds_alone_is_no_growth() -> None:
    met = 0
    for seed in range(200):
        random = Random(seed)
        met += trend(JOBS, [random.uniform(-200.0, 200.0) for _ in JOBS]).at_most < GOAL
    assert met > 195


def test_too_few_days_are_no_trend() -> None:
    with pytest.raises(ValueError, match="no three blocks"):
        trend(JOBS[:59], JOBS[:59])
