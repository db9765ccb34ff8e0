"""What a benchmark has found: rows of a name, a value, a goal. Printing is here, measuring is not.

The one rule: a goal is printed beside its figure, never enforced.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True, slots=True)
class Figure:
    """`value` in `unit`, give or take `spread`; with `goal` it is to be at most or at least that (`sense`)."""

    name: str
    value: float
    unit: str = ""
    goal: float | None = None
    sense: Literal["most", "least"] = "most"
    digits: int = 2
    spread: float | None = None

    @property
    def met(self) -> bool | None:
        """Whether the goal is met; None without one."""
        if self.goal is None:
            return None
        return self.value <= self.goal if self.sense == "most" else self.value >= self.goal

    def __str__(self) -> str:
        value = f"{self.value:>12,.{self.digits}f} {self.unit}"
        if self.spread is not None:
            value += f" +- {self.spread:.{self.digits}f}"
        if self.goal is None:
            return f"  {self.name:<52} {value}".rstrip()
        word = "ok" if self.met else "MISSED"
        sign = "<=" if self.sense == "most" else ">="
        return f"  {self.name:<52} {value:<28} goal {sign} {self.goal:g}: {word}"


@dataclass(frozen=True, slots=True)
class Report:
    """One benchmark: figures in groups, in the order in which they are printed."""

    title: str
    groups: tuple[tuple[str, tuple[Figure, ...]], ...]

    @classmethod
    def of(cls, title: str, groups: Iterable[tuple[str, Iterable[Figure]]]) -> "Report":
        return cls(title, tuple((heading, tuple(figures)) for heading, figures in groups))

    def value(self, group: str, name: str) -> float:
        """One figure. Raises KeyError."""
        for heading, figures in self.groups:
            for figure in figures:
                if (heading, figure.name) == (group, name):
                    return figure.value
        raise KeyError(f"{self.title}: {group}: {name}")

    def __str__(self) -> str:
        lines = [f"=== {self.title}"]
        for heading, figures in self.groups:
            lines += ["", heading, *map(str, figures)]
        return "\n".join(lines)
