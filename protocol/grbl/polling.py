"""Status questions: when the next `?` goes out, and how long silence may last (grbl I, II.5).

The one rule: one question outstanding; repeated questions collapse into one answer anyway (II.2).
"""

from dataclasses import dataclass
from typing import Final

REPEAT_S: Final = 1.0
"""Without an answer for so long the question was lost, or the controller is in something that answers none."""


@dataclass(slots=True)
class Poll:
    """`mark`: how many lines were acknowledged when the outstanding question went out, if none was open then: only
    after such a question does Idle mean that they are executed. An auto-start waits until the RX ring has run dry
    (II.4): before that the controller says Idle with a full planner."""

    next_at: float = 0.0
    asked: int = 0
    outstanding: bool = False
    mark: int | None = None
    quiet_since: float = 0.0
    rests: int = 0
    rest_mark: int | None = None

    def begin(self, now: float) -> None:
        """Ask as soon as possible."""
        self.next_at, self.outstanding, self.mark, self.quiet_since = now, False, None, now

    def sent(self, now: float, mark: int | None) -> None:
        """The question has gone out."""
        self.mark = None if self.outstanding else mark
        self.asked += 1
        self.outstanding = True
        self.next_at = now + REPEAT_S

    def answered(self, now: float, interval_s: float) -> int | None:
        """A report came; the mark that it proves, if Idle."""
        mark, self.mark = (self.mark, None) if self.outstanding else (None, None)
        self.outstanding = False
        self.next_at = now + interval_s
        return mark

    def rested(self, mark: int | None) -> None:
        """Count Idle reports in a row that prove the same mark."""
        if mark is None:
            self.rests = 0
        else:
            self.rests = self.rests + 1 if mark == self.rest_mark else 1
        self.rest_mark = mark

    def heard(self, now: float) -> None:
        """Any line came."""
        self.quiet_since = now

    def silent_s(self, now: float) -> float:
        """How long nothing was heard."""
        return now - self.quiet_since
