"""The soak in a tiny setting: days of jobs, pulled plugs, restarts and visitors leave nothing but the history."""

from dataclasses import replace

import pytest

from bench import soak
from bench.soakmachines import MILLS
from bench.soakyear import ALL, SOME, Sample, lived
from tests.harness.effort import LONG, more

DAYS = 30


@pytest.mark.slow
@pytest.mark.parametrize("name", MILLS)
def test_days_of_jobs_leave_nothing_behind(name: str) -> None:
    samples, year = lived(name, SOME, days=more(1), jobs_a_day=1)
    assert year.jobs == len(samples)
    for settled in samples[5:] if LONG else samples[-1:]:  # a few screens are left open by then
        assert settled.tasks == samples[min(5, len(samples) - 1)].tasks
        assert settled.files == samples[0].files
        assert settled.rows["jobs"] <= 3 * settled.day
    # A job that stayed would be thousands of objects; some hundred a day go into windows of limited length.
    assert samples[-1].objects - samples[0].objects < 4000 * len(samples)


FLAT = Sample(1, 1000, 70.0, 2, 1, 9, 50, 4000.0, 40, 10.0, 8)


def month(number: int, **changes: float) -> tuple[Sample, ...]:
    return tuple(replace(FLAT, day=DAYS * number + day, jobs=8 * (DAYS * number + day), **changes) for day in range(30))


def missed(samples: tuple[Sample, ...], keep: soak.Keeping) -> list[str]:
    return [figure.name.partition(",")[0] for figure in soak.growth(samples, keep) if figure.met is False]


def test_what_grows_shows() -> None:
    names = [*soak.NEVER_MORE, *soak.OF_THE_HISTORY]
    flat = sum((month(number) for number in range(1, 13)), ())
    grown = {name: 2 * getattr(FLAT, name) for name in names}
    assert missed(flat, SOME) == []
    assert missed((*flat[:-DAYS], *month(12, **grown)), SOME) == names


def test_where_everything_is_kept_the_history_grows_by_the_job() -> None:
    by_the_job = sum(
        (month(n, pages=40 * DAYS * n, programs=8 * DAYS * n, programs_kb=80.0 * n) for n in range(1, 13)), ()
    )
    assert missed(by_the_job, ALL) == []
    assert missed((*by_the_job[:-DAYS], *month(12, pages=40 * DAYS * 20)), ALL) == ["pages by the job"]
