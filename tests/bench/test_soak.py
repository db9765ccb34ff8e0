"""The soak in a tiny setting: days of jobs, pulled plugs, restarts and visitors leave nothing but the history."""

import re
from collections.abc import Callable
from dataclasses import replace
from random import Random

import pytest

from bench import soak
from bench.soakmachines import MILLS
from bench.soakyear import ALL, MONTH_DAYS, SOME, Sample, lived
from tests.harness.effort import LONG, more


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


FLAT = Sample(
    day=1,
    objects=100_000,
    blocks=500_000,
    malloc_kb=23_000.0,
    sqlite_kb=900.0,
    resident_mb=100.0,
    tasks=2,
    threads=1,
    files=9,
    pages=80,
    wal_kb=4000.0,
    programs=30,
    programs_kb=8.0,
    jobs=0,
    rows={"events": 200, "tokens": 31},
    payload={"events": 50_000, "tokens": 9000},
)
JOBS_A_DAY = 2
Change = Callable[[Sample, float], Sample]


def a_year(change: Change = lambda sample, _noise: sample, *, days: int = 12 * MONTH_DAYS) -> tuple[Sample, ...]:
    """`change` is given each evening, and a number from -1 to 1 that differs from day to day."""
    random = Random(3)
    evenings = [replace(FLAT, day=day, jobs=JOBS_A_DAY * day) for day in range(1, days + 1)]
    return tuple(change(evening, random.uniform(-1.0, 1.0)) for evening in evenings)


def missed(samples: tuple[Sample, ...], keep: soak.Keeping = SOME) -> set[str]:
    return {re.split("[ :,]", figure.name)[0] for figure in soak.growth(samples, keep) if figure.met is False}


def grown(**a_job: float) -> Change:
    """So much more for each job; beside the noise of a real year."""
    noise = {
        "objects": 150.0,
        "blocks": 300.0,
        "malloc_kb": 20.0,
        "sqlite_kb": 50.0,
        "programs": 3.0,
        "programs_kb": 0.8,
    }

    def change(sample: Sample, by: float) -> Sample:
        values = {
            name: getattr(sample, name) + by * most + a_job.get(name, 0.0) * sample.jobs for name, most in noise.items()
        }
        return replace(sample, **values)

    return change


def test_what_goes_up_and_down_is_no_growth() -> None:
    assert missed(a_year()) == set()
    assert missed(a_year(grown())) == set()


@pytest.mark.parametrize("name", [*soak.LEFT_BY_A_JOB, "programs"])
def test_one_left_behind_by_each_job_is_found(name: str) -> None:
    assert name in missed(a_year(grown(**{name: 1.0})))


def test_a_row_left_behind_every_other_job_is_found() -> None:
    def change(sample: Sample, by: float) -> Sample:
        rows = {"events": 200 + 60 * by, "tokens": 31 + sample.jobs / 2, "jobs": 14}
        return replace(sample, rows={table: int(count) for table, count in rows.items()})

    year = a_year(change)
    figures = [figure for figure in soak.growth(year, SOME) if figure.name.startswith("rows of")]
    assert {figure.name.split()[2]: figure.met for figure in figures} == {"events": True, "tokens": False, "jobs": True}
    assert missed(year, ALL) == set(), "that is the history itself"


def test_the_last_month_is_held_against_the_second() -> None:
    for name in (*soak.RATIOS, "pages", *soak.THE_SAME, "wal_kb"):
        more = replace(FLAT, **{name: 2 * getattr(FLAT, name)})
        # In the first half of the year already: nothing is left by a job of the second.
        assert missed(
            a_year(lambda sample, _by, more=more: sample if sample.day < 100 else replace(more, **told(sample)))
        ) == {name}


def test_where_everything_is_kept_the_history_grows_by_the_job() -> None:
    def change(sample: Sample, _by: float, *, more: int = 1) -> Sample:
        a_job = {"pages": 20 * more, "programs": 4 * more, "programs_kb": 2.0 * more}
        return replace(sample, **{name: much * sample.jobs for name, much in a_job.items()})

    assert missed(a_year(change), ALL) == set()
    assert missed(a_year(lambda sample, by: change(sample, by, more=1 + sample.day // 300)), ALL) == {
        "pages",
        "programs",
        "programs_kb",
    }


def told(sample: Sample) -> dict[str, int]:
    """Which evening it is."""
    return {"day": sample.day, "jobs": sample.jobs}
