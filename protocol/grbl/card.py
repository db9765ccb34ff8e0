"""A program that a grblHAL reads from its SD card: when it runs, and when it has ended.

Not the listing (asking.py). The one rule: while it runs no line is sent, for it would be thrown away without an answer;
real-time bytes are heard as ever.
"""

from dataclasses import dataclass

from protocol.grbl.reports import StatusReport


@dataclass(slots=True)
class CardRun:
    """`asked`: number of the question that was out when the run was answered; older reports say nothing of it."""

    running: bool = False
    asked: int = 0

    def begin(self, asked: int) -> None:
        """The controller has the file open."""
        self.running, self.asked = True, asked

    def end(self) -> bool:
        """Whether one was running until now."""
        ran, self.running = self.running, False
        return ran

    def seen(self, report: StatusReport, asked: int) -> bool:
        """Whether a report shows that the program has ended. It may show one that was begun before we came."""
        if report.sd is not None:
            self.running = True
            return False
        resting = report.status in ("idle", "check", "alarm")
        return self.running and resting and asked > self.asked and self.end()
