"""A plan to take a program up at a line, as data: steps to be shown, edited and sent; and why there may be none.

How it is made is in resume.py. The one rule: nothing here does anything; a plan is run by somebody else, on the
operator's word.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, NoReturn

Purpose = Literal[
    "units",
    "diameter",
    "plane",
    "distance",
    "arc_distance",
    "return",
    "feed_mode",
    "home",
    "system",
    "offset",
    "length",
    "mode",
    "beam_off",
    "lift",
    "tool",
    "operator",
    "over",
    "spindle",
    "wait",
    "coolant",
    "approach",
    "plunge",
    "focus",
    "motion",
    "feed",
    "first",
]
"""What a step is for. `operator`: something that no block can do; the plan stops there."""

REASONS = {
    "compensation": "cutter compensation is on (G41, G42), or G40 has not led the tool back yet",
    "ended": "the program has ended before this line (M2, M30)",
    "distance_unknown": "nobody knows whether G90 or G91 holds",
    "position_unknown": "the path goes on at a place that the lines before do not tell",
    "shift_unknown": "G92 was set at a place that nobody knows, and the controller has forgotten it",
    "tool_unknown": "a tool was loaded, but nothing says which",
    "length_unknown": "the tool length in force is not known",
    "scaling": "the coordinates are scaled (G51), which is not followed",
    "saved_modes": "modes were saved (M70, W70) that the rest may restore",
    "spindle_unknown": "nobody knows whether the spindle turns",
    "motion_unknown": "the line goes on with a motion that is not followed here",
    "cycle_moved": "the machine is moved between the holes of a cycle that goes on by modal words only",
    "no_code": "the controller has no code to say what is needed",
    "bad_value": "a number of the plan is not one",
}
"""Why a program cannot be taken up at a line: each reason, and what it means."""


class CannotResumeError(ValueError):
    """The program cannot be taken up here. `reason` is one of REASONS; the message says why and what to do."""

    def __init__(self, reason: str, message: str) -> None:
        super().__init__(message)
        self.reason = reason


def refuse(reason: str, advice: str) -> NoReturn:
    """Raises CannotResumeError; `advice`: what to do instead."""
    raise CannotResumeError(reason, f"The program cannot be taken up here: {REASONS[reason]}. {advice}")


def number(value: float) -> str:
    """In a block. So many decimals that a full circle does not become an arc of nothing; no exponent, no idle zeros."""
    text = f"{value:.8f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


@dataclass(frozen=True, slots=True)
class Step:
    """One block of the plan, without a text where it is the operator who has to do something. `note`: for people."""

    text: str
    purpose: Purpose
    note: str = ""


@dataclass(frozen=True, slots=True)
class Reentry:
    """`steps` in order; then the rest, without its first `takes_over` blocks, which the plan says itself.

    `warnings`: what could not be restored, or is for the operator to make sure of. `place`: where the path goes on,
    program coordinates in mm by lower-case axis.
    """

    steps: tuple[Step, ...]
    takes_over: int
    warnings: tuple[str, ...]
    place: Mapping[str, float]

    @property
    def blocks(self) -> tuple[str, ...]:
        """What is sent."""
        return tuple(step.text for step in self.steps if step.text)

    def to_json(self) -> dict[str, Any]:
        """For a dashboard."""
        steps = [{"text": step.text, "purpose": step.purpose, "note": step.note} for step in self.steps]
        warnings, place = list(self.warnings), dict(self.place)
        return {"steps": steps, "takes_over": self.takes_over, "warnings": warnings, "place": place}


@dataclass(frozen=True, slots=True)
class Way:
    """How the machine is to get back to the path. Lengths in mm, feeds in mm/min.

    `clearance_mm`: where it may move freely, along the axis that is lifted; in program coordinates, or with
    `clearance_is_machine` in those of the machine (G53). `along`: the axis that is lifted, Z where nothing is said,
    X on a lathe. `laser`: M3 and M4 light a beam, and nothing is plunged into.
    """

    clearance_mm: float
    plunge_feed_mm_min: float
    spindle_wait_s: float = 0.0
    clearance_is_machine: bool = False
    along: str | None = None
    laser: bool = False
