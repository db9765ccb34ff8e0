"""What a job under way is: what people want of it, how it stands with the link, how it stopped; and telling that.

What changes it is in runner.py. The one rule: the status is derived, never stored, and every change of it is told once.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

from jobs import outcome
from jobs.delivery import AT_REST, STANDING, Delivery, Policy
from jobs.effects import Effect, Note, RowStatus, SetStatus
from jobs.feed import Feed
from jobs.flight import Inheritance, LinkSide, Wishes
from jobs.job import ENDED, JobError, Status
from jobs.ledger import Flight, Ledger
from jobs.outcome import MACHINE_GONE, Outcome
from jobs.toolchange import ToolChange
from protocol.events import Status as MachineStatus


@dataclass(slots=True)
class RunState:
    """One job. `feed` yields what comes after the open rows; times in `now` are the engine's clock in seconds.

    `has_changer`: M6 is a dialogue with the tool changer (`tools`); else with a controller that has one of its own.
    `_reported`: what the machine has last said that it is doing. `_refusal`: the line for which the job was held.
    """

    job_id: int
    resume_within_s: float
    feed: Feed
    ledger: Ledger = field(default_factory=Ledger)
    announced: Status = Status.CHECKING
    restarted: bool = False
    delivery: Delivery = field(default_factory=Delivery)
    policy: Policy = field(default_factory=Policy)
    has_changer: bool = False
    tools: ToolChange = field(default_factory=ToolChange)
    refused: int = 0
    _reported: MachineStatus | None = None
    _refusal: JobError | None = None
    _first_refusal: str = ""
    _wishes: Wishes = field(default_factory=Wishes)
    _link: LinkSide = field(default_factory=LinkSide)
    _outcome: Outcome | None = None
    _told: tuple[Any, ...] = ()
    _effects: list[Effect] = field(default_factory=list)

    # --- what is derived --------------------------------------------------------------------------------------

    @property
    def _standing(self) -> bool:
        """The machine holds the motion by itself, or somebody at the machine does; or the tool is in, and a pause that
        was demanded meanwhile keeps it from going on."""
        parked = self._reported == "tool" and self._wishes.hold
        return self.delivery.holds and (self._reported in STANDING or parked)

    @property
    def status(self) -> Status:
        """The job's status; derived, never stored."""
        if self._outcome is not None:
            return self._outcome.status
        if self._wishes.waiting:
            return Status.WAITING
        if self._standing or (self._wishes.hold and not self.ledger.open):
            return Status.PAUSED
        return Status.RUNNING

    @property
    def error(self) -> JobError | None:
        """What went wrong, with the lines that are in doubt; or the line for which it is held."""
        if self._outcome is None:
            return self._refusal
        if not self._outcome.code:
            return None
        return JobError(self._outcome.code, self._outcome.message, *self.ledger.lines_in_doubt())

    @property
    def over(self) -> bool:
        """The job has ended and nothing more will be learnt about it."""
        return not self.ledger.open and self.status in ENDED

    @property
    def linked(self) -> bool:
        """The machine takes commands; what became of everything before is settled."""
        return self._link.up

    @property
    def holding(self) -> bool:
        """A pause is demanded (the batch in flight may still be executing), or the machine holds."""
        return self._wishes.hold or self._standing

    @property
    def can_resume(self) -> bool:
        """It stands, or is to, and nobody has demanded its end."""
        return self._outcome is None and not self._wishes.cancel and self.holding

    @property
    def can_pause(self) -> bool:
        """Nobody has demanded a pause yet. That the machine holds may be the old news of one that has just gone on."""
        paused = self.status is Status.PAUSED and not self._wishes.hold
        return paused or self.status in (Status.RUNNING, Status.WAITING)

    @property
    def cancelling(self) -> bool:
        """Its end is demanded."""
        return self._wishes.cancel

    @property
    def tool(self) -> int | None:
        """The tool it waits for."""
        return self._wishes.tool if self._wishes.waiting else None

    @property
    def flights(self) -> tuple[Flight, ...]:
        """The rows that are with the machine, or may be."""
        return tuple(self.ledger.open)

    @property
    def has_room(self) -> bool:
        """One more batch may be with the machine."""
        flights, blocks = self.ledger.open, self.delivery.least_blocks
        if len(flights) < self.delivery.depth:
            return True
        for flight in flights:
            blocks -= len(flight.entry.batch.blocks)
            if blocks <= 0:
                return False
        return True

    @property
    def _goes_on(self) -> bool:
        """Would the job send by itself if it could?"""
        wishes = self._wishes
        return self._outcome is None and not (wishes.hold or wishes.cancel or wishes.waiting)

    def deadline(self) -> float | None:
        """When a break becomes too long to be bridged without asking (elvinto §5.5)."""
        if self._link.last_life_at is None or not self._goes_on:
            return None
        return self._link.last_life_at + self.resume_within_s

    def inherit(self) -> Inheritance:
        """What a new epoch is told: what is open, and until when it may move the machine to find out.

        A job that is to stand still (paused, waiting, being cancelled, interrupted) never moves by itself.
        """
        deadline = self.deadline()
        return Inheritance(
            tuple(flight.entry.command() for flight in self.ledger.open),
            dict(self.ledger.position) if self._located else {},
            -math.inf if deadline is None else deadline,
            self.ledger.executed,
        )

    @property
    def _located(self) -> bool:
        """Whether where the last certain batch ended says where the machine stands, as far as the job has moved it."""
        return self.delivery.locates or not (self.ledger.doubtful or self.ledger.inherited_doubt)

    # --- stopping ---------------------------------------------------------------------------------------------

    @property
    def _cancelled(self) -> Outcome:
        """Cancelled; where the machine was stopped in the middle of lines it says so."""
        in_doubt = self.ledger.lines_in_doubt() != (None, None)
        return outcome.STOPPED_IN_THE_MIDDLE if in_doubt else Outcome(Status.CANCELLED)

    def _end(self, end: Outcome) -> None:
        """Nothing is left to do. A check is passed only by a program of which no line was refused. A machine that
        can hold has to say that it is at rest (grbl I): only then may the next job have it."""
        if self.delivery.holds and self._reported not in AT_REST:
            return
        if self.policy.check and self.refused and end.status is Status.COMPLETED:
            end = outcome.lines_refused(self.refused, self._first_refusal)
        self._stop(end)

    def broken(self, reason: str) -> list[Effect]:
        """A fault of ours: nothing more goes out. What is open may still end, if the machine says so."""
        self._interrupt(outcome.broken(reason))
        return self._drain()

    def _check_break(self, now: float) -> None:
        deadline = self.deadline()
        if deadline is not None and now >= deadline:
            self._interrupt(outcome.break_too_long(self.resume_within_s))

    def _interrupt(self, cause: Outcome) -> None:
        """Later evidence may name a graver cause, but an end stays an end and a restart the gravest."""
        if self.status not in ENDED and (self._outcome is None or self._outcome.code != MACHINE_GONE.code):
            self._outcome = cause
            self._shelve()

    def _stop(self, cause: Outcome) -> None:
        if self._outcome is None:
            self._outcome = cause
            self._shelve()

    def _shelve(self) -> None:
        """Take the batch ahead back: its row says that it was never sent, before anything else is written."""
        entry = self.feed.shelve()
        if entry is not None:
            self._emit(self.ledger.unsent(entry))

    def _doubt(self, flights: Iterable[Flight], status: RowStatus) -> None:
        self._emit(*self.ledger.doubt(flights, status))

    # --- telling ----------------------------------------------------------------------------------------------

    def _note(self, kind: str, **data: Any) -> None:
        self._emit(Note(kind, data))

    def _emit(self, *effects: Effect) -> None:
        self._effects.extend(effects)

    def _drain(self) -> list[Effect]:
        told = (self.status, self.error, self.tool, self.restarted)
        if told != self._told:
            self._tell(told)
        effects, self._effects = self._effects, []
        return effects

    def _tell(self, told: tuple[Status, JobError | None, int | None, bool]) -> None:
        status, error, tool, restarted = told
        if self._told or status is not self.announced:
            done = self.ledger.cursor.done
            self._emit(SetStatus(self.announced, status, done, error=error, tool=tool, restarted=restarted))
            self.announced = status
        self._told = told
