"""A table of phases as a page of docs/: what stands in it, and its diagram. The pages of all engines look alike.

Not the tables; those are in each dialect, with what their columns say. The one rule: a page is made from the table that
the engine obeys, and a test keeps it true.
"""

from collections.abc import Iterable, Sequence
from enum import Enum
from typing import Any

Arrow = tuple[Enum, str, Enum]
"""From, why, to."""


def arrows_of(steps: Any, outcomes: Iterable[Arrow]) -> list[Arrow]:
    """The ways that a table of steps (`awaits`, `then`, `on_silence`) tells, and `outcomes`, which it does not."""
    found = [(phase, step.awaits, step.then) for phase, step in steps.items() if step.then is not None]
    found += [(phase, "silence", step.on_silence) for phase, step in steps.items() if step.on_silence is not None]
    return [*found, *outcomes]


def page(
    *,
    engine: str,
    module: str,
    notes: Sequence[str],
    columns: Sequence[str],
    rows: Iterable[Sequence[str]],
    begins: Sequence[str],
    arrows: Iterable[Arrow],
    behind: Sequence[str] = (),
) -> str:
    """In Markdown. `begins`: where the diagram is entered, `PHASE: why`; `behind`: lines below the diagram."""
    lines = sorted({f"    {before.name} --> {after.name}: {why}" for before, why, after in arrows})
    return "\n".join(
        (
            f"# The phases of the {engine} engine",
            "",
            f"Made from the tables in `{module.replace('.', '/')}.py` by `python -m {module}`;",
            "a test keeps it true.",
            *notes,
            "",
            f"| {' | '.join(columns)} |",
            "|" + " --- |" * len(columns),
            *(f"| {' | '.join(row)} |" for row in rows),
            "",
            "```mermaid",
            "stateDiagram-v2",
            *(f"    [*] --> {entry}" for entry in begins),
            *lines,
            "```",
            "",
            *behind,
        )
    )
