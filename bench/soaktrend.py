"""Does something grow by the job? A straight line through what was there, and how sure its slope is.

Pure, and not about any particular figure (soak.py has those). The one rule: what is judged is the most that the slope
may be, not its best guess: a noise in which a leak could hide is a goal that is missed.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import fmean

BLOCK_DAYS = 20
"""Of so many days the mean counts: what retention and the sawtooth of the tables do within them is no growth, and what
one block holds of the history is gone in the next."""
TRIMMED = 0.1
"""Of a block are left out at either end: a day on which something is under way in the evening."""
STUDENT_95 = (math.nan, 6.314, 2.920, 2.353, 2.132, 2.015, 1.943, 1.895, 1.860, 1.833, 1.812)
"""One-sided, by degrees of freedom (any table of Student's t; beyond ten the last one is a little too strict)."""


@dataclass(frozen=True, slots=True)
class Trend:
    """Growth for each job: the best guess, and what it is at most with a confidence of 95 %."""

    slope: float
    at_most: float

    @property
    def spread(self) -> float:
        """How far `at_most` is above."""
        return self.at_most - self.slope


def trend(jobs: Sequence[float], values: Sequence[float], *, block: int = BLOCK_DAYS) -> Trend:
    """Of `values`, one by each evening, over the number of jobs by then. Needs three whole blocks; what is left over at
    the beginning is not looked at."""
    blocks = range(len(jobs) % block, len(jobs), block)
    if len(blocks) < 3:
        raise ValueError(f"{len(jobs)} days are no three blocks of {block}")
    x = [_middle(jobs[at : at + block]) for at in blocks]
    y = [_middle(values[at : at + block]) for at in blocks]
    x_mean, y_mean = fmean(x), fmean(y)
    width = sum((one - x_mean) ** 2 for one in x)
    slope = sum((one - x_mean) * (other - y_mean) for one, other in zip(x, y, strict=True)) / width
    left = sum((other - y_mean - slope * (one - x_mean)) ** 2 for one, other in zip(x, y, strict=True))
    freedom = len(x) - 2
    error = math.sqrt(left / freedom / width)
    return Trend(slope, slope + STUDENT_95[min(freedom, len(STUDENT_95) - 1)] * error)


def _middle(values: Sequence[float]) -> float:
    """The mean of what is neither among the highest nor among the lowest."""
    out = int(len(values) * TRIMMED)
    return fmean(sorted(values)[out : len(values) - out])
