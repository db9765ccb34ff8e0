"""The soak in a tiny setting: days of jobs, pulled plugs and restarts leave nothing behind but the history."""

from bench import soak
from tests.harness.effort import more


def test_days_of_jobs_leave_nothing_behind() -> None:
    samples, year = soak.lived(more(7), 2)
    assert year.jobs == 2 * len(samples)
    assert year.restarts >= len(samples)
    settled = samples[3:]
    assert len({sample.tasks for sample in settled}) == 1
    assert max(sample.files for sample in settled) == settled[0].files
    assert samples[-1].jobs <= min(year.jobs, soak.KEEP.keep_jobs)
    # A job that stayed would be thousands of objects; some hundred a day go into windows of limited length.
    assert samples[-1].objects - samples[3].objects < 1500 * (len(samples) - 4)


def test_what_grows_shows() -> None:
    flat = [soak.Sample(1000, 70.0, 2, 9, 50, 40, 500) for _ in range(6)]
    leaks = [soak.Sample(1000 * day, 70.0 * day, 2 * day, 9 * day, 50 * day, 40 * day, 500) for day in range(1, 7)]
    assert all(figure.met is not False for figure in soak.growth(flat))
    missed = [figure.name for figure in soak.growth(leaks) if figure.met is False]
    assert [name.partition(",")[0] for name in missed] == ["objects", "resident_mb", "tasks", "files", "pages", "jobs"]
