"""All harnesses by name: one for each parser that takes what others have written.

A harness takes any bytes and returns; an exception is a finding. Seeds lie in tests/fuzz/seeds/NAME, one input a file.
The one rule: what was found stays: its smallest form becomes a seed and is tried in each run.
"""

from collections.abc import Callable
from pathlib import Path

from tests.fuzz import network, texts, wire

SEEDS = Path(__file__).parent / "seeds"

Harness = Callable[[bytes], None]

HARNESSES: dict[str, Harness] = {
    "elvinto": wire.elvinto,
    "grbl": wire.grbl,
    "ncframe": wire.ncframe,
    "words": texts.words,
    "motion": texts.motion,
    "check": texts.check,
    "config": texts.config,
    "tools": texts.tools,
    "socket": network.socket,
    "query": network.query,
    "outbound": network.outbound,
}


def seeds(name: str) -> list[bytes]:
    """The inputs that are kept for a harness, in the order of their names."""
    return [path.read_bytes() for path in sorted((SEEDS / name).iterdir())]
