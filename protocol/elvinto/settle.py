"""What happened to batches whose fate was lost (elvinto §5.4): the evidence and the verdicts. Sends nothing.

The one rule: a verdict is given only where the evidence admits a single reading; everything else is doubt.
"""

from dataclasses import dataclass, field
from itertools import combinations

from protocol.commands import Position, SendBatch

PROBES_NEEDED = 5
"""Restart probes without an answer before a machine counts as not restarted (elvinto §5.4.1: up to five)."""
PROBES_NEEDED_RECEIVED = 3
"""The same where the batch is known to have been accepted and only its end is missing: the position is compared too."""
PROBES_MOST = 10
STATES_OF_A_RESTART = 2
"""A machine that ends a motion may print one last STATE by itself; a restarted one prints one for every probe."""


@dataclass(slots=True)
class RestartProbe:
    """Counts rounds of the restart probe (`W95` under an ID that only a machine without memory executes)."""

    needed: int
    rounds: int = 0
    states: int = 0
    state_in_round: bool = False

    def heard_state(self) -> None:
        """A STATE that is not `run` came in."""
        self.state_in_round = True

    def still_running(self) -> None:
        """STATE `run`: the machine executes; nothing that came before says anything. The present round is void."""
        self.rounds, self.states = -1, 0
        self.state_in_round = False

    def end_round(self) -> bool | None:
        """True: restarted. False: it kept its memory. None: probe again."""
        self.rounds += 1
        self.states += self.state_in_round
        self.state_in_round = False
        if self.states >= STATES_OF_A_RESTART:
            return True
        if self.rounds >= PROBES_MOST or (self.states == 0 and self.rounds >= self.needed):
            return False
        return None


@dataclass(slots=True)
class Case:
    """Open batches in order, what is known of them, and how the case was opened.

    `accepted`: the machine is known to have taken the one batch in question; only its end is open.
    `move_until`: after this instant nothing that moves the machine is sent again (elvinto §5.5).
    """

    batches: tuple[SendBatch, ...]
    start: Position
    move_until: float
    accepted: bool = False
    done: list[int] = field(default_factory=list)
    ask_until: float = 0.0
    probe: RestartProbe = field(default_factory=lambda: RestartProbe(PROBES_NEEDED))

    def __post_init__(self) -> None:
        if self.accepted:
            self.probe.needed = PROBES_NEEDED_RECEIVED

    @property
    def remaining(self) -> tuple[SendBatch, ...]:
        """Batches that are not known to be done, in order."""
        return tuple(batch for batch in self.batches if batch.id not in self.done)

    @property
    def remaining_ids(self) -> tuple[int, ...]:
        return tuple(batch.id for batch in self.remaining)

    def holds(self, id: int) -> bool:
        return id in self.remaining_ids

    def finished(self, id: int) -> None:
        """`id` is done, and so is every batch before it: one at a time, in order (elvinto §5)."""
        ids = self.remaining_ids
        if id in ids:  # else it was known already, and says nothing about those that remain
            self.done.extend(ids[: ids.index(id) + 1])

    def next_to_repeat(self, tolerance_mm: float) -> SendBatch | None:
        """The batch to send once more (elvinto §5.4.2), or None where the position alone will tell.

        The standard repeats first and asks then. A repetition of something that moves is the one message that a
        flipped digit of its ID can turn into a second execution, so it is left to the case that the places where the
        batches end cannot be told apart. The end of a program makes the machine forget its IDs (§5.6): were it
        executed, a batch before it would be executed a second time; alone it may be repeated, run twice it does no
        harm.
        """
        remaining = self.remaining
        if not remaining or self.accepted:
            return None
        if any(batch.ends_program for batch in remaining):
            return remaining[0] if len(remaining) == 1 else None
        places = self._places
        tellable = not any(possible(a, b, tolerance_mm) for a, b in combinations(places, 2))
        return None if tellable else remaining[0]

    @property
    def _places(self) -> list[Position]:
        """Where the machine may stand: before the first open batch, or at the end of one of them."""
        remaining = self.remaining
        origin = self.batches[-len(remaining) - 1].end if self.done else self.start
        return [origin, *(batch.end for batch in remaining)]

    @property
    def expected_s(self) -> float:
        """Seconds that the open batches may still take."""
        return sum(batch.expected_s for batch in self.remaining)

    def located(self, position: Position, tolerance_mm: float) -> bool:
        """Read the position, once the machine executes nothing more. True: settled. False: doubt.

        The machine stands at the start or at the end of one of the batches. Exactly one of these places may be
        possible; an axis that is not known excludes nothing.
        """
        remaining = self.remaining
        if self.accepted:
            return possible(remaining[-1].end, position, tolerance_mm) and self._all_done()
        places = self._places
        if remaining and all(batch.ends_program for batch in remaining):
            # Not sent or not heard: run once more it does no harm, so it stays undone.
            return possible(places[0], position, tolerance_mm)
        fitting = [i for i, place in enumerate(places) if possible(place, position, tolerance_mm)]
        if len(fitting) != 1:
            return False
        for batch in remaining[: fitting[0]]:
            self.done.append(batch.id)
        return True

    def _all_done(self) -> bool:
        self.done.extend(self.remaining_ids)
        return True


def possible(place: Position, position: Position, tolerance_mm: float) -> bool:
    """Whether a machine that reports `position` may stand at `place`, as far as both are known."""
    return all(abs(place[axis] - position[axis]) <= tolerance_mm for axis in place if axis in position)
