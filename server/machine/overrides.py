"""Brings the overrides of a Grbl to what was asked for, in steps of 10 and 1 percent, and sees from the reports whether
they are there.

Not the permission (switches.py). Grbl notes each real-time byte as a flag and looks at the flags between other work:
two equal bytes behind each other may count as one. So bytes go out one at a time, and what the reports say in the end
corrects what was counted. The one rule: the newest wish counts, and every wish ends, reached or not.
"""

import asyncio
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Final, Literal, TypeAlias

from protocol.commands import Override
from protocol.machine import MachineState
from server.machine.manual import MakeRealtime
from server.problems import ProblemError

Kind: TypeAlias = Literal["feed", "rapid", "spindle"]
Step: TypeAlias = Literal["reset", "+10", "-10", "+1", "-1", "50", "25"]

LEAST_PERCENT: Final = 10
MOST_PERCENT: Final = 200
NEUTRAL_PERCENT: Final = 100
RAPIDS: Final[dict[int, Step]] = {100: "reset", 50: "50", 25: "25"}
"""All that rapids can be set to."""
STEP_S: Final = 0.05
"""Between two bytes: longer than a status report keeps the controller from looking at its flags (5-20 ms)."""
SETTLED_S: Final = 1.0
"""Behind the last byte, until a report must have told what came of it: at rest five come a second, and one of them
may tell the work offset instead. A report from before the byte proves nothing."""
MOST_ROUNDS: Final = 3
"""Corrections, after which what the reports say stands: somebody at a pendant wants something else."""

_CHANGES: Final[dict[Step, int]] = {"+10": 10, "-10": -10, "+1": 1, "-1": -1}


def steps(present: int | None, wanted: int) -> list[Step]:
    """The fewest bytes from `present` percent (None: not known) to `wanted`, over 100 % where that is shorter."""
    over: list[Step] = ["reset", *_walk(NEUTRAL_PERCENT, wanted)]
    if present is None:
        return over
    return min(_walk(present, wanted), over, key=len)


def after(percent: int, step: Step) -> int:
    """What a byte makes of a percentage of feed or spindle."""
    by = _CHANGES.get(step)
    return NEUTRAL_PERCENT if by is None else min(max(percent + by, LEAST_PERCENT), MOST_PERCENT)


def _walk(start: int, end: int) -> list[Step]:
    """Tens first, one too many where ones back are shorter; the bounds of the controller cut a step off (195 + 10 is
    200)."""
    tens = min(range(abs(end - start) // 10, abs(end - start) // 10 + 2), key=lambda n: n + _ones(start, end, n))
    ten: Step = "+10" if end > start else "-10"
    place = _place(start, end, tens)
    one: Step = "+1" if end > place else "-1"
    return [ten] * tens + [one] * abs(end - place)


def _place(start: int, end: int, tens: int) -> int:
    way = 10 * tens if end > start else -10 * tens
    return min(max(start + way, LEAST_PERCENT), MOST_PERCENT)


def _ones(start: int, end: int, tens: int) -> int:
    return abs(end - _place(start, end, tens))


@dataclass(slots=True)
class _Wish:
    wanted: int
    expected: int | None
    """What the bytes that went come to, should none be lost; None: not known."""
    todo: list[Step]
    rounds: int = 1
    settled_at: float | None = None


class Overrides:
    """Of one machine. `press` puts a byte on the wire, `state` is the newest that is known."""

    def __init__(
        self,
        state: Callable[[], MachineState],
        press: Callable[[MakeRealtime], object],
        loop: asyncio.AbstractEventLoop,
    ) -> None:
        self._state = state
        self._press = press
        self._loop = loop
        self._wishes: dict[Kind, _Wish] = {}
        self._timer: asyncio.TimerHandle | None = None

    @property
    def wanted(self) -> dict[str, int]:
        """What is being brought about."""
        return {kind: wish.wanted for kind, wish in self._wishes.items()}

    def want(self, wishes: Mapping[Kind, int]) -> None:
        """Bring these about; what was wanted of the same before does not count any more. The first bytes go out at
        once. Raises ProblemError without a link."""
        for kind, wanted in wishes.items():
            # Bytes of the wish before may be under way, not reported yet.
            under_way = self._wishes.get(kind)
            present = self._reported(kind) if under_way is None else under_way.expected
            self._wishes[kind] = self._plan(kind, wanted, present)
        if self._timer is None:
            self._step()

    def _plan(self, kind: Kind, wanted: int, present: int | None, rounds: int = 1) -> _Wish:
        if kind == "rapid":
            return _Wish(wanted, present, [RAPIDS[wanted]], rounds)
        return _Wish(wanted, present, steps(present, wanted), rounds)

    def _reported(self, kind: Kind) -> int | None:
        return self._state().overrides.get(kind)

    def _step(self) -> None:
        """A byte of each, then a look at the reports. Raises ProblemError without a link: then nothing is wanted any
        more, for a controller that comes back begins at 100 %."""
        self._timer = None
        try:
            for kind, wish in tuple(self._wishes.items()):
                self._pursue(kind, wish)
        except ProblemError:
            self._wishes.clear()
            raise
        if self._wishes:
            self._timer = self._loop.call_later(STEP_S, self._tick)

    def _tick(self) -> None:
        with suppress(ProblemError):
            self._step()

    def _pursue(self, kind: Kind, wish: _Wish) -> None:
        if wish.todo:
            self._send(kind, wish)
        elif wish.settled_at is None:
            wish.settled_at = self._loop.time() + SETTLED_S
        elif self._loop.time() >= wish.settled_at:
            self._conclude(kind, wish)

    def _send(self, kind: Kind, wish: _Wish) -> None:
        step = wish.todo.pop(0)
        self._press(lambda token: Override(token, kind, step))
        if step == "reset" or wish.expected is not None:
            wish.expected = after(wish.expected or NEUTRAL_PERCENT, step)

    def _conclude(self, kind: Kind, wish: _Wish) -> None:
        if self._reported(kind) == wish.wanted or wish.rounds >= MOST_ROUNDS:
            del self._wishes[kind]
        else:
            self._wishes[kind] = self._plan(kind, wish.wanted, self._reported(kind), wish.rounds + 1)
