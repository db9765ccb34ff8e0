"""A year in a workshop in minutes of simulated time: jobs, pulled plugs, killed daemons, visitors. What grows?

Each kind of machine has its year in a process of its own, with retention and without. What there is at the end of each
month is printed; at the end month 12 stands beside month 2. Nothing here is about speed. The one rule: what the machine
executed is compared after each job (soakmachines.py); a soak that loses a line has not passed.
"""

import multiprocessing
import os
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass

from bench.report import Figure, Report
from bench.soakmachines import MILLS
from bench.soakyear import ALL, MONTH_DAYS, SOME, Keeping, Sample, lived

TITLE = "soak: a year of jobs, breaks, restarts and visitors in simulated time"
GROWTH = 1.05
PAGES_GROWTH = 1.15
"""A token that was revoked keeps its row, so that no backup brings it back: one a day is 20 pages of 150 in a year."""
NEVER_MORE = ("objects", "resident_mb", "tasks", "threads", "files")
"""Whatever is kept."""
OF_THE_HISTORY = ("pages", "wal_kb", "programs", "programs_kb")
"""What grows with the history: with retention it does not, without it goes by the job."""
FIRST, LAST = 2, 12
"""The months that are compared: by the second all caches are full and retention has begun."""
KEEPINGS = {"as [history] says": SOME, "everything is kept": ALL}
YEARS = (*((name, "as [history] says") for name in MILLS), ("elvinto", "everything is kept"))


@dataclass(frozen=True, slots=True)
class Lived:
    """A year as it is reported."""

    heading: str
    samples: tuple[Sample, ...]
    keep: Keeping


def months(samples: tuple[Sample, ...], *, days: int = MONTH_DAYS) -> list[tuple[Sample, ...]]:
    """The days of each month."""
    return [samples[at : at + days] for at in range(0, len(samples), days)]


def growth(samples: tuple[Sample, ...], keep: Keeping, *, days: int = MONTH_DAYS) -> Iterator[Figure]:
    """The most of the last month beside the most of the second."""
    by_month = months(samples, days=days)[:LAST]
    first, last = by_month[min(FIRST, len(by_month)) - 1], by_month[-1]
    for name in (*NEVER_MORE, *OF_THE_HISTORY):
        by_the_job = name in OF_THE_HISTORY and not keep.history.removes and name != "wal_kb"
        before, after = (max(_value(sample, name, by_the_job) for sample in month) for month in (first, last))
        goal = PAGES_GROWTH if name == "pages" else GROWTH
        said = f"{name} by the job" if by_the_job else name
        yield Figure(f"{said}, at most", after, digits=2 if by_the_job else 0)
        yield Figure(f"{said}, month {len(by_month)} / month {FIRST}", after / max(before, 1e-9), goal=goal, digits=3)


def _value(sample: Sample, name: str, by_the_job: bool) -> float:
    value = float(getattr(sample, name))
    return value / sample.jobs if by_the_job else value


def one_year(name: str, keeping: str, days: int, jobs_a_day: int) -> Lived:
    """In a process of its own: the memory of one machine."""
    keep = KEEPINGS[keeping]
    told = f"{name}, {keeping}"
    samples, year = lived(
        name, keep, days=days, jobs_a_day=jobs_a_day, told=lambda sample: print(f"  {told}: {sample}", flush=True)
    )
    heading = (
        f"{told}: {days} days, {year.jobs} jobs, {year.breaks} pulled plugs, {year.kills} killed daemons, "
        f"{year.restarts} restarts, {year.estops} e-stops, {year.people.asked} requests; {year.mill.taken_up} jobs "
        f"taken up at a line in doubt, {year.mill.given_up} given up"
    )
    return Lived(heading, tuple(samples), keep)


def run(*, days: int = 12 * MONTH_DAYS, jobs_a_day: int = 2) -> Report:
    """All years, as many at once as there are processors."""
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(os.cpu_count(), mp_context=context, max_tasks_per_child=1) as pool:
        futures = [pool.submit(one_year, name, keeping, days, jobs_a_day) for name, keeping in YEARS]
        years = [future.result() for future in futures]
    return Report.of(TITLE, [(one.heading, tuple(growth(one.samples, one.keep))) for one in years])
