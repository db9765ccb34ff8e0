"""How a machine's runs compare with what was planned for them: a factor, and how far a run strays from it.

Not the present run (pace.py) and not the database (store.py). The one rule: a few runs, short runs or odd ones never
move the factor far; without any the plan stands as it is, and nobody claims to know it well.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from math import exp, isfinite, log, sqrt

RUNS_CONSIDERED = 20
"""The last ones: a machine is changed, and so are the figures in its configuration."""

FURTHEST = log(5.0)
"""A run five times slower or faster than planned says nothing about the next: a wrong plan, a clock that was set."""

HALF_WEIGHT_S = 60.0
"""A run that was planned to be so long weighs half of a long one: waits at its ends are a large part of it."""

DOUBT_RUNS = 0.5
"""The plan itself counts as much as so many long runs: one run moves the factor two thirds of the way, three six
sevenths."""

SPREAD_AT_FIRST = 0.25
"""Of the logarithm: without experience one run in ten is off by more than half as much again."""

SPREAD_AT_LEAST = 0.02
"""No two runs are the same to within that, whatever the last few were."""

MAD_TO_SIGMA = 1.4826
"""The median of the distances from the median, of a normal distribution, is 1/1.4826 of its deviation."""


@dataclass(frozen=True, slots=True)
class Run:
    """A run that was completed: what was planned and what it took while the machine was executing, in s."""

    planned_s: float
    taken_s: float


@dataclass(frozen=True, slots=True)
class Experience:
    """`log_factor`: logarithm of taken / planned; `spread`: how far a run is from it, as one deviation; `runs` used."""

    log_factor: float = 0.0
    spread: float = SPREAD_AT_FIRST
    runs: int = 0

    @property
    def factor(self) -> float:
        """What to multiply planned seconds with."""
        return exp(self.log_factor)


NO_EXPERIENCE = Experience()


def learn(runs: Iterable[Run]) -> Experience:
    """What runs of one machine say about its next. The median, weighed by length and drawn towards the plan."""
    weighed = [
        (found, run.planned_s / (run.planned_s + HALF_WEIGHT_S))
        for run in runs
        if (found := deviation(run)) is not None
    ]
    if not weighed:
        return NO_EXPERIENCE
    weight = sum(one for _, one in weighed)
    middle = _median(weighed)
    strays = MAD_TO_SIGMA * _median([(abs(found - middle), one) for found, one in weighed])
    variance = (DOUBT_RUNS * SPREAD_AT_FIRST**2 + weight * strays**2) / (DOUBT_RUNS + weight)
    return Experience(middle * weight / (DOUBT_RUNS + weight), max(sqrt(variance), SPREAD_AT_LEAST), len(weighed))


def deviation(run: Run) -> float | None:
    """Logarithm of taken / planned, within bounds; None where either says nothing."""
    if not (isfinite(run.planned_s) and isfinite(run.taken_s) and run.planned_s > 0.0 and run.taken_s > 0.0):
        return None
    return max(-FURTHEST, min(FURTHEST, log(run.taken_s) - log(run.planned_s)))


def _median(weighed: list[tuple[float, float]]) -> float:
    """Half of the weight lies on either side; the middle between two where it falls between them."""
    ordered = sorted(weighed)
    half = sum(weight for _, weight in ordered) / 2.0
    reached = 0.0
    for at, (value, weight) in enumerate(ordered):
        reached += weight
        if reached > half:
            return value
        if reached == half and at + 1 < len(ordered):
            return (value + ordered[at + 1][0]) / 2.0
    return ordered[-1][0]
