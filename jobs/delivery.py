"""How batches reach the machines of one protocol, and what follows for a job: data, no code.

The one rule: nothing in jobs/ asks which protocol it is; it asks for what stands here.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from protocol.commands import OnError
from protocol.events import Status as MachineStatus

STANDING: Final[frozenset[MachineStatus]] = frozenset({"hold", "door"})
"""The machine itself holds the motion in the middle of a batch."""
AT_REST: Final[frozenset[MachineStatus]] = frozenset({"idle", "check"})


@dataclass(frozen=True, slots=True)
class Delivery:
    """`depth`: batches that may be with the engine at once; one more is planned and journaled. `least_blocks`: more of
    them may, as long as they hold no more blocks than that: a controller that proves lines by those behind them needs
    so many, and a batch of long ways has one or two.

    `remembers`: after a break the machine can be asked what became of them (elvinto §5.4); else they are in doubt.
    `holds`: it can stand still in the middle of a batch, go on, and drop what it has (grbl I, feed hold and reset).
    `forgets`: a reset, unseen where the link was broken, takes its modes and perhaps its position (grbl I).
    `locates`: it says where it stands; else only what it has certainly executed tells that (ncframe §4).
    """

    depth: int = 1
    least_blocks: int = 0
    remembers: bool = True
    holds: bool = False
    forgets: bool = False
    locates: bool = True

    @property
    def repeats(self) -> bool:
        """What is open after a break may go out again, the same bytes: the journal keeps them. Else it is in doubt."""
        return not self.forgets

    @property
    def most_open(self) -> int:
        """Rows of a job without a durable end, at most."""
        return max(self.depth, self.least_blocks) + 1


@dataclass(frozen=True, slots=True)
class Policy:
    """What a job wants of its run. `check`: the controller's own parser, without motion (grbl `$C`).

    `on_error`, `ignored_errors`: what follows a refused line (protocol.commands.SendBatch).
    """

    check: bool = False
    on_error: OnError = "hold"
    ignored_errors: frozenset[int] = frozenset()

    @classmethod
    def of(cls, row: Mapping[str, object]) -> "Policy":
        """From a job's row. A check collects every error: whatever its row says, it goes on."""
        codes = str(row["ignored_errors"] or "")
        ignored = frozenset(int(code) for code in codes.split(",") if code)
        if row["mode"] == "check":
            return cls(check=True, on_error="ignore")
        on_error: OnError = row["on_error"] or "hold"  # type: ignore[assignment]
        return cls(on_error=on_error, ignored_errors=ignored)
