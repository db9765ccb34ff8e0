"""How fast the present run of a job gets on, and how long it will still take. Pure: `now` comes in, no clock.

Times are taken between ends of batches under the same conditions, so pauses, waits for an operator and breaks of the
link are in none of them. The one rule: noting the end of a batch costs a few assignments; everything else is worked
out when somebody looks.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import exp, isfinite, log, sqrt
from typing import NamedTuple

from gcode.timeline import AS_PROGRAMMED, Overrides, Timeline, overrides_of
from jobs.experience import FURTHEST, NO_EXPERIENCE, Experience

OWN_SPREAD_S = 1.0
"""Variance of the logarithm of a run's pace after one planned second; it falls with their number (0.1 after 100 s,
0.02 after an hour, as one deviation): the beginning of a run is not yet what the rest will be like."""

REST_SPREAD = 0.02
"""However well the pace so far is known, the rest is other lines."""

RANGE = 1.64
"""Deviations on either side of the estimate: nine of ten runs end within."""

MOST_STRETCHES = 100
"""Kept until the timeline is there; what is more does not count."""


class Left(NamedTuple):
    """Seconds that a job will still take: the best estimate, and what it lies between in nine cases of ten."""

    seconds: float
    least_s: float
    most_s: float


class Reach(NamedTuple):
    """Lines of a job: everything up to `done` is executed, up to `sent` handed over, `last` is its last one."""

    done: int
    sent: int
    last: int


@dataclass(frozen=True, slots=True)
class Stretch:
    """The lines after `behind` up to `line` took so long under these overrides."""

    behind: int
    line: int
    taken_s: float
    overrides: Overrides


@dataclass(slots=True)
class Pace:
    """`planned_s`, `taken_s`: of all stretches that have been counted, those of daemons before this one included."""

    planned_s: float = 0.0
    taken_s: float = 0.0
    timeline: Timeline | None = None
    experience: Experience = NO_EXPERIENCE
    _overrides: Overrides = AS_PROGRAMMED
    _percent: Mapping[str, float] = field(default_factory=dict)
    _standing: bool = False
    _began: tuple[float, int] | None = None
    _at: float = 0.0
    _line: int = 0
    _uncounted: list[Stretch] = field(default_factory=list)

    def of_job(self, planned_s: float, taken_s: float) -> "Pace":
        """That of a job that begins or goes on under the same conditions; what it has behind it."""
        return Pace(planned_s, taken_s, _overrides=self._overrides, _percent=self._percent, _standing=self._standing)

    def supply(self, timeline: Timeline, experience: Experience) -> None:
        """What was planned, and what is known of the machine."""
        self.timeline, self.experience = timeline, experience

    # --- what happens -------------------------------------------------------------------------------------------

    def begin(self, now: float, line: int) -> None:
        """The machine begins to execute what comes after `line`; nothing is in flight."""
        self.stop()
        if not self._standing:
            self._began, self._at, self._line = (now, line), now, line

    def mark(self, now: float, line: int) -> None:
        """Everything up to `line` is executed. After a break or a change the next stretch begins here."""
        if self._began is None:
            if self._standing:
                return
            self._began = now, line
        self._at, self._line = now, line

    def stop(self) -> None:
        """It does not go on as before: paused, waiting, broken, ended. The stretch is over where it was marked last."""
        began, self._began = self._began, None
        if began is None or self._line <= began[1] or self._at <= began[0]:
            return
        if len(self._uncounted) < MOST_STRETCHES:
            self._uncounted.append(Stretch(began[1], self._line, self._at - began[0], self._overrides))
        self._count()

    def conditions(self, percent: Mapping[str, float], *, standing: bool) -> None:
        """Overrides by name in per cent, and whether the machine itself holds the motion (feed hold, door)."""
        if percent is self._percent and standing == self._standing:
            return  # most reports of a machine tell where it is
        self._percent = percent
        overrides = overrides_of(percent)
        if (overrides, standing) != (self._overrides, self._standing):
            self.stop()
            self._overrides, self._standing = overrides, standing

    # --- what follows from it -----------------------------------------------------------------------------------

    def so_far(self) -> tuple[float, float]:
        """Planned and taken seconds of this job up to the last mark, under the overrides of their time."""
        self._count()
        if self.timeline is None or self._began is None:
            return self.planned_s, self.taken_s
        here = self.timeline.between(self._began[1], self._line).seconds(self._overrides)
        return self.planned_s + here, self.taken_s + self._at - self._began[0]

    def left(self, now: float, reach: Reach) -> Left | None:
        """None while it is not known, or where the plan has no time at all."""
        timeline = self.timeline
        if timeline is None or not 0.0 < timeline.total_s < float("inf"):
            return None
        log_factor, spread = self._likely()
        factor = exp(log_factor)
        sent = min(reach.sent, reach.last)
        in_flight_s = timeline.between(reach.done, sent).seconds(self._overrides) * factor
        unsent = timeline.between(sent, reach.last)
        rest_s = in_flight_s + unsent.seconds(self._overrides) * factor
        if self._began is not None:
            # What is in flight is being executed; it is not over before it is marked.
            rest_s -= min(max(now - self._at, 0.0), in_flight_s)
        # Never faster than the link carries what has not been handed over yet.
        link_s = unsent.link_s
        apart = exp(RANGE * spread)
        seconds, least, most = [max(s, link_s, 0.0) for s in (rest_s, rest_s / apart, rest_s * apart)]
        return Left(seconds, least, most) if isfinite(most) else None

    def _likely(self) -> tuple[float, float]:
        """Logarithm of the factor of the rest, and its deviation: the machine's and this run's, by their worth."""
        known, variance = self.experience.log_factor, self.experience.spread**2
        planned_s, taken_s = self.so_far()
        if planned_s > 0.0 and taken_s > 0.0:
            own = max(-FURTHEST, min(FURTHEST, log(taken_s / planned_s)))
            own_variance = OWN_SPREAD_S / planned_s
            known = (known * own_variance + own * variance) / (variance + own_variance)
            variance = variance * own_variance / (variance + own_variance)
        return known, sqrt(variance + REST_SPREAD**2)

    def _count(self) -> None:
        """Stretches that had to wait for the timeline."""
        if self.timeline is None or not self._uncounted:
            return
        for stretch in self._uncounted:
            self.planned_s += self.timeline.between(stretch.behind, stretch.line).seconds(stretch.overrides)
            self.taken_s += stretch.taken_s
        self._uncounted.clear()
