"""When STATE goes out by itself: while moving (W90), once more when motion has ended, and as long as an alarm stands.

The one rule: it only keeps the time; what STATE says is the machine's.
"""

from sim.elvinto.settings import SimSettings


class Reports:
    """`due_at` is when the next STATE is to be said; `said` and one of the others are called at every change."""

    def __init__(self, settings: SimSettings) -> None:
        self._settings = settings
        self._said_at = float("-inf")
        self._idle_left = 0
        self.due_at: float | None = None

    def said(self, at: float) -> None:
        """STATE has gone out, for whatever reason."""
        self._said_at = at

    def cancel(self) -> None:
        self.due_at = None
        self._idle_left = 0

    def moving(self, at: float) -> None:
        """A block moves: every `state_interval_s`, over a row of shorter batches too."""
        if self.due_at is None:
            self.due_at = max(at, self._said_at + self._settings.state_interval_s)

    def came_to_rest(self, at: float) -> None:
        """Motion has ended: the place is said once nothing has followed for a while."""
        self._idle_left = self._settings.idle_reports
        self.due_at = at + self._settings.state_interval_s if self._idle_left else None

    def alarm(self, at: float) -> None:
        self._idle_left = 0
        self.due_at = at + self._settings.alarm_repeat_s if self._settings.alarm_repeat_s else None

    def repeat(self, at: float, *, alarm: bool, running: bool) -> None:
        """A due report has gone out: when is the next?"""
        self.due_at = None
        if alarm:
            self.alarm(at)
        elif running:
            self.due_at = at + self._settings.state_interval_s
        else:
            self._idle_left -= 1
            self.due_at = at + self._settings.state_interval_s if self._idle_left > 0 else None
