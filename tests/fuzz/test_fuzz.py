"""Each parser with any bytes, for a second or two; `make fuzz` does the same for minutes.

Properties are in the harnesses. The one rule: that time does not grow faster than the input is counted in steps of the
interpreter, not in seconds, so it says the same on every machine.
"""

import sys
from collections.abc import Iterator
from types import FrameType
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings

from tests.fuzz import network
from tests.fuzz.harnesses import HARNESSES, SEEDS, Harness, seeds
from tests.fuzz.inputs import inputs
from tests.harness.effort import more

EXAMPLES = {"check": 8, "motion": 12, "query": 25, "config": 40}
"""The dear ones; the others take more in the same time."""
USUAL = 100
DEAR = ("check", "motion")
GROWTH_BYTES = 1000
GROWTH_MOST = 7.0
"""Four times the input may take so many times the steps: 4 and some, where twice nested would be 16."""

each = pytest.mark.parametrize("name", HARNESSES)


@pytest.fixture(scope="module", autouse=True)
def _served() -> Iterator[None]:
    yield
    network.close()


@each
def test_what_was_found_before(name: str) -> None:
    for seed in seeds(name):
        HARNESSES[name](seed)


@each
def test_any_bytes(name: str) -> None:
    @settings(
        max_examples=more(EXAMPLES.get(name, USUAL)),
        derandomize=True,
        database=None,
        deadline=None,
        suppress_health_check=list(HealthCheck),
    )
    @given(inputs(seeds(name)))
    def tried(data: bytes) -> None:
        HARNESSES[name](data)

    tried()


def test_every_folder_of_seeds_has_its_harness() -> None:
    assert {path.name for path in SEEDS.iterdir()} == set(HARNESSES)


@pytest.mark.parametrize("name", [name for name in HARNESSES if name != "query"])
def test_four_times_the_input_is_not_sixteen_times_the_work(name: str) -> None:
    """The seeds one after the other, and each byte that means something alone, over and over."""
    harness = HARNESSES[name]
    texts = [b"\n".join(seeds(name)), b"(", b"<", b"[", b"a", b"1,", b"\n", b"{", b"G1X1"]
    for text in texts[:: 8 if name in DEAR else 2]:
        small = (text * (GROWTH_BYTES // len(text) + 1))[:GROWTH_BYTES]
        large = (text * (4 * GROWTH_BYTES // len(text) + 1))[: 4 * GROWTH_BYTES]
        before, after = steps(harness, small), steps(harness, large)
        assert after < GROWTH_MOST * max(before, 1000), (text[:20], before, after)


def steps(harness: Harness, data: bytes) -> int:
    """Calls, of Python's functions and of the built-in ones, that a harness takes for an input."""
    count = 0

    def seen(_frame: FrameType, event: str, _argument: Any) -> None:
        nonlocal count
        count += event in ("call", "c_call")

    earlier = sys.getprofile()
    sys.setprofile(seen)
    try:
        harness(data)
    finally:
        sys.setprofile(earlier)
    return count
