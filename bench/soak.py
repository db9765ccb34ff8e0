"""A year in a workshop in minutes of simulated time: jobs, pulled plugs, killed daemons, visitors. What grows?

Each kind of machine has its year in a process of its own, with retention and without. What there is at the end of each
month is printed. Judged is how much a job leaves behind in the life of the last daemon, eight months, and month 12
beside month 2. Nothing here is about speed. The one rule: what the machine executed is compared after
each job (soakmachines.py); a soak that loses a line has not passed.
"""

import logging
import multiprocessing
import os
from collections.abc import Callable, Collection, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from statistics import median

from bench.report import Figure, Report
from bench.soakmachines import MILLS
from bench.soaktrend import trend
from bench.soakyear import ALL, KILLING, MONTH_DAYS, SOME, Keeping, Sample, lived

TITLE = "soak: a year of jobs, breaks, restarts and visitors in simulated time"
GROWTH = 1.05
FIRST, LAST = 2, 12
"""The months that are compared: by the second all caches are full and retention has begun."""
SETTLED_DAYS = 30
"""Of the last daemon are not looked at: as long as the longest that it keeps (sessions, addresses, ended tokens)."""
LEFT_BY_A_JOB = {"objects": 1.0, "blocks": 1.0, "malloc_kb": 1.0, "sqlite_kb": 1.0}
"""Less than that, with a confidence of 95 %: one object, one piece of memory or a kibibyte for each job is the smallest
leak that is worth the name. One of a kibibyte is a kibibyte of malloc, or two blocks and more."""
FILES_LEFT_BY_A_JOB = {"programs": 0.05, "programs_kb": 0.05}
"""Of programs: the smallest is a quarter of a kibibyte."""
ROWS_LEFT_BY_A_JOB = 0.25
"""In each table: half of what one row a day is. The bytes are printed beside them, with those of the indexes, and not
judged: what a job says of its faults may be ten kilobytes in one month and nothing in the next."""
THE_SAME = ("tasks", "threads", "files")
"""Never more in the last month than in the second."""
RATIOS = ("objects", "blocks", "malloc_kb", "resident_mb")
WITH_THE_HISTORY = ("pages", "programs", "programs_kb")
"""What grows by the job where everything is kept. Of programs there are some thirty with retention, one more or less is
three percent: what a job leaves is all that is judged then."""
SQLITE_KB = 2000 + 1024
"""Its cache of pages (its default), which fills where everything is kept; 128 prepared statements and the tables' names
are some 600 beside it. That it stays full and no fuller is judged by the job."""
KEEPINGS = {"as [history] says": SOME, "everything is kept": ALL}
YEARS = {name: (name, "as [history] says") for name in MILLS} | {"kept": ("elvinto", "everything is kept")}
PARTS = tuple(YEARS)


@dataclass(frozen=True, slots=True)
class Lived:
    """A year as it is reported."""

    heading: str
    samples: tuple[Sample, ...]
    keep: Keeping


def months(samples: tuple[Sample, ...], *, days: int = MONTH_DAYS) -> list[tuple[Sample, ...]]:
    """The days of each month."""
    return [samples[at : at + days] for at in range(0, len(samples), days)]


def growth(samples: tuple[Sample, ...], keep: Keeping) -> Iterator[Figure]:
    """All figures of a year: what a job leaves behind, then the last month beside the second."""
    settled = samples[round(len(samples) * KILLING) + SETTLED_DAYS :]
    files = FILES_LEFT_BY_A_JOB if keep.history.removes else {}
    for name, goal in (LEFT_BY_A_JOB | files).items():
        yield _left(name, settled, [_value(sample, name) for sample in settled], goal)
    for table in sorted({table for sample in settled for table, rows in sample.rows.items() if rows}):
        rows = [float(sample.rows.get(table, 0)) for sample in settled]
        yield _left(f"rows of {table}", settled, rows, ROWS_LEFT_BY_A_JOB if keep.history.removes else None)
        bytes_ = [float(sample.payload.get(table, 0)) for sample in settled]
        yield _left(f"bytes of {table}", settled, bytes_, None)
    yield from _beside(samples, keep)


def _left(name: str, settled: tuple[Sample, ...], values: list[float], goal: float | None) -> Figure:
    found = trend([sample.jobs for sample in settled], values)
    return Figure(f"{name} left by a job: {found.slope:.3f}, at most", found.at_most, goal=goal, digits=3)


def _beside(samples: tuple[Sample, ...], keep: Keeping) -> Iterator[Figure]:
    """Of the last month and the second: the middle value, or the highest of what is never to be higher."""
    by_month = months(samples)[:LAST]
    first, last = by_month[min(FIRST, len(by_month)) - 1], by_month[-1]
    said = f"month {len(by_month)} / month {FIRST}"
    for name in (*RATIOS, *WITH_THE_HISTORY):
        by_the_job = name in WITH_THE_HISTORY and not keep.history.removes
        before, after = (
            median(_value(sample, name) / (sample.jobs if by_the_job else 1) for sample in month)
            for month in (first, last)
        )
        yield Figure(f"{name} by the job" if by_the_job else name, after, digits=2 if by_the_job else 0)
        judged = by_the_job or name not in FILES_LEFT_BY_A_JOB
        yield Figure(f"{name}: {said}", after / max(before, 1e-9), goal=GROWTH if judged else None, digits=3)
    yield Figure("sqlite_kb, at most", max(sample.sqlite_kb for sample in samples), goal=SQLITE_KB, digits=0)
    for name in (*THE_SAME, "wal_kb"):
        before, after = (max(_value(sample, name) for sample in month) for month in (first, last))
        yield Figure(f"{name}, at most", after, digits=0)
        goal = 1.0 if name in THE_SAME else GROWTH
        yield Figure(f"{name}, at most: {said}", after / max(before, 1e-9), goal=goal, digits=3)


def _value(sample: Sample, name: str) -> float:
    return float(getattr(sample, name))


def one_year(name: str, keeping: str, days: int, jobs_a_day: int) -> Lived:
    """In a process of its own: the memory of one machine."""
    logging.disable(logging.WARNING)  # of two tablets that take the control from each other, each time
    keep = KEEPINGS[keeping]
    told = f"{name}, {keeping}"
    try:
        samples, year = lived(
            name, keep, days=days, jobs_a_day=jobs_a_day, told=lambda sample: print(f"  {told}: {sample}", flush=True)
        )
    except AssertionError as error:  # before the other years have come to their end
        print(f"  {told}: BROKEN OFF: {error}", flush=True)
        raise
    heading = (
        f"{told}: {days} days, {year.jobs} jobs, {year.breaks} pulled plugs, {year.kills} killed daemons, "
        f"{year.restarts} restarts, {year.estops} e-stops, {year.people.asked} requests; {year.mill.taken_up} jobs "
        f"taken up at a line in doubt, {year.mill.given_up} given up"
    )
    return Lived(heading, tuple(samples), keep)


def run(
    only: Collection[str] = (),
    say: Callable[[object], None] = print,
    *,
    days: int = 12 * MONTH_DAYS,
    jobs_a_day: int = 2,
) -> Report:
    """All years, or `only` some of PARTS, as many at once as there are processors; each is told when it is over.

    Raises AssertionError when all are, if a job of any did not come out as it had to.
    """
    context = multiprocessing.get_context("spawn")
    years = [year for part, year in YEARS.items() if not only or part in only]
    groups: list[tuple[str, tuple[Figure, ...]]] = []
    broken_off: list[AssertionError] = []
    with ProcessPoolExecutor(os.cpu_count(), mp_context=context, max_tasks_per_child=1) as pool:
        for future in as_completed([pool.submit(one_year, *year, days, jobs_a_day) for year in years]):
            try:
                one = future.result()
            except AssertionError as error:
                broken_off.append(error)
                continue
            groups.append((one.heading, tuple(growth(one.samples, one.keep))))
            say(Report.of(TITLE, groups[-1:]))
    if broken_off:
        raise broken_off[0]
    return Report.of(TITLE, groups)
