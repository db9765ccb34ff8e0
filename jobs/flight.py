"""What a runner holds in its hands: what it inherits, what people want of it and whether there is a link.

Plain data of jobs/runner.py; no behaviour and no rule of its own.
"""

from dataclasses import dataclass

from jobs.effects import Entry
from jobs.job import JobError, Status
from protocol.commands import Position, SendBatch


@dataclass(frozen=True, slots=True)
class Adopted:
    """What the database knows of a job that was under way when the daemon died."""

    status: Status
    open: tuple[Entry, ...] = ()
    hold: bool = False
    tool: int | None = None
    error: JobError | None = None
    restarted: bool = False


@dataclass(frozen=True, slots=True)
class Inheritance:
    """What the next epoch's engine is told (protocol.engine.OpenWork)."""

    batches: tuple[SendBatch, ...]
    start: Position
    move_until: float
    executed: int | None = None


@dataclass(slots=True)
class Wishes:
    """What people want of the job. `waiting`: for an operator, to put in `tool` where the program named one."""

    hold: bool = False
    cancel: bool = False
    tool: int | None = None
    waiting: bool = False


@dataclass(slots=True)
class LinkSide:
    """`up`: the machine takes commands. `last_life_at`: the old epoch's last sign of life, while it is not."""

    up: bool = False
    last_life_at: float | None = None
