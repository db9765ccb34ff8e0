"""What can go wrong in an expansion, and how far one may go. Not the place where either happens.

The one rule: a program that cannot be expanded ends in one ExpandError that says where and what to do; there is no
other exception and no endless loop, whatever the bytes.
"""

from dataclasses import dataclass


class ExpandError(ValueError):
    """The program cannot be made plain. `line` and `column` count from 1; `code` is stable, `message` for people."""

    def __init__(self, line: int, column: int, code: str, message: str) -> None:
        super().__init__(f"line {line}, column {column}: {message}")
        self.line = line
        self.column = column
        self.code = code
        self.message = message


class RefusalError(ValueError):
    """Something that cannot be computed, before it is known where in the program that stands."""

    def __init__(self, code: str, message: str) -> None:
        super().__init__(message)
        self.code = code
        self.message = message


@dataclass(frozen=True, slots=True)
class Limits:
    """How much a program may make of itself (gcode §1: bounds on loops and recursion).

    `max_lines_out`: plain lines; what is written with loops is short, its motion not millions of lines.
    `max_iterations`: jumps backwards, all loops together. `max_steps`: statements executed, also those that give no
    line; some minute of work, during which other programs wait for their checks. `max_depth`: subprograms within
    subprograms; LinuxCNC itself ends at 10, Fanuc at 4 to 15. `max_labels`: places that can be jumped to, kept in
    memory at about 100 bytes each.
    """

    max_lines_out: int = 1_000_000
    max_iterations: int = 200_000
    max_steps: int = 2_000_000
    max_depth: int = 32
    max_labels: int = 200_000


class Meter:
    """Counts what a program has made so far. Raises RefusalError at a limit."""

    def __init__(self, limits: Limits) -> None:
        self._limits = limits
        self._lines = 0
        self._iterations = 0
        self._steps = 0

    def line(self) -> None:
        """One more line comes out."""
        self._lines += 1
        if self._lines > self._limits.max_lines_out:
            raise RefusalError(
                "too_many_lines", f"the program becomes more than {self._limits.max_lines_out} lines: check its loops"
            )

    def iteration(self) -> None:
        """One more jump backwards."""
        self._iterations += 1
        if self._iterations > self._limits.max_iterations:
            raise RefusalError(
                "too_many_iterations",
                f"more than {self._limits.max_iterations} turns of loops: this one may never end, check its condition",
            )

    def step(self) -> None:
        """One more statement."""
        self._steps += 1
        if self._steps > self._limits.max_steps:
            raise RefusalError(
                "too_many_steps", f"more than {self._limits.max_steps} statements were executed: check the loops"
            )

    def depth(self, frames: int) -> None:
        """So many subprograms are open."""
        if frames > self._limits.max_depth:
            raise RefusalError(
                "too_deep", f"subprograms call each other more than {self._limits.max_depth} deep: is there an end?"
            )
