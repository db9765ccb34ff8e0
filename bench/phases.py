"""What was measured in turns: the same thing under several conditions, round for round, and how far it is certain.

Not what is measured. The order is turned round each time, so that a computer which gets slower does not favour one
condition. The one rule: a ratio is told with its spread, which is what the rounds say about each other.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import sqrt
from statistics import median

from bench.report import Figure


@dataclass(frozen=True, slots=True)
class Sums:
    """What one phase adds up to; its mean is `total / count`."""

    total: float
    count: float

    def __add__(self, other: "Sums") -> "Sums":
        return Sums(self.total + other.total, self.count + other.count)

    @property
    def mean(self) -> float:
        return self.total / self.count if self.count else 0.0


NOTHING = Sums(0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Ratio:
    """`value` of all rounds together; `spread` is its standard error."""

    value: float
    spread: float

    def figure(self, name: str, *, goal: float | None = None) -> Figure:
        """The row for it."""
        return Figure(name, self.value, "x", goal=goal, digits=3, spread=self.spread)


def ratio(phases: Sequence[Sums], others: Sequence[Sums]) -> Ratio:
    """The mean of `phases` against that of `others`, of the same rounds. The spread is found by leaving out each
    round in turn (the jackknife); one round has none."""
    value = _ratio(phases, others)
    count = min(len(phases), len(others))
    if count < 2:
        return Ratio(value, 0.0)
    without = [_ratio(_but(phases, left_out), _but(others, left_out)) for left_out in range(count)]
    mean = sum(without) / count
    return Ratio(value, sqrt((count - 1) / count * sum((one - mean) ** 2 for one in without)))


def _ratio(phases: Sequence[Sums], others: Sequence[Sums]) -> float:
    under, base = sum(phases, NOTHING).mean, sum(others, NOTHING).mean
    return under / base if base else 0.0


def _but(phases: Sequence[Sums], left_out: int) -> list[Sums]:
    return [phase for number, phase in enumerate(phases) if number != left_out]


def median_ratio(samples: Sequence[float], others: Sequence[float]) -> float:
    """Of the middle ones: what a few that were disturbed do not change."""
    return median(samples) / base if samples and others and (base := median(others)) else 0.0


def in_turns(conditions: Sequence[str], rounds: int) -> Iterator[str]:
    """Every condition once in each round, there and back: A B, B A, A B."""
    for number in range(rounds):
        yield from conditions if number % 2 == 0 else reversed(conditions)
