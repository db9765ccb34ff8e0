"""What kind of tool changer is simulated: its times, its magazine, its habits, its faults.

The one rule: every field has a default, and the defaults together are a changer that keeps to the page.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final, Literal

EMPTY_POCKET: Final = -2
WRONG_TOOL: Final = -3
NOT_PREPARED: Final = -4
"""Reasons that this changer gives of itself, besides those of `ChangerSettings`."""


def _magazine() -> dict[int, int]:
    return {pocket: pocket for pocket in range(1, 13)}


@dataclass(frozen=True, slots=True)
class ChangerSettings:
    """Times in seconds. Chances from 0 to 1, drawn once a request by `seed`."""

    magazine: Mapping[int, int] = field(default_factory=_magazine)
    """Which tool is in which pocket."""
    spindle: int = 0
    """The tool in the spindle at power-on; 0: none."""
    random: bool = False
    """The old tool goes where the new one came from; else back to its own pocket."""

    prepare_s: float = 1.5
    change_s: float = 3.0
    answer_s: float = 0.01
    """Until a level that needs no work follows: acknowledgements, and answers that fall with their request."""
    restore_s: float = 1.0
    """To put the old tool back when a change is aborted in the middle."""
    jitter: float = 0.0
    """Every time is longer or shorter by up to this share of it."""
    fault_s: float = 0.5
    """How long a fault lasts after it was acknowledged."""
    seed: int = 0

    on_abort: Literal["restore", "finish"] = "restore"
    """A change in the middle is taken back, or finished and reported late all the same."""
    acknowledges_aborts: bool = True
    prepare_fault: float = 0.0
    change_fault: float = 0.0
    """Chances that a request ends in a fault; the old tool stays in the spindle."""
    both: float = 0.0
    """The chance that a change is done, and reported together with a fault."""
    silence: float = 0.0
    """The chance that a request is never answered."""
    reasons: tuple[int, ...] = (-1, 0, 1)
    """One of them goes with a fault by chance."""
    stuck: Mapping[str, bool] = field(default_factory=dict)
    """Lines that do not move."""

    def __post_init__(self) -> None:
        """Raises ValueError for what no changer has."""
        for name in ("prepare_fault", "change_fault", "both", "silence", "jitter"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise ValueError(f"{name} is a chance from 0 to 1, not {getattr(self, name)}")
        for name in ("prepare_s", "change_s", "answer_s", "restore_s", "fault_s"):
            if getattr(self, name) < 0.0:
                raise ValueError(f"{name} is a time, not {getattr(self, name)}")
        if not self.reasons:
            raise ValueError("reasons: a fault needs one")
