"""Overrides in steps: the fewest bytes, one at a time, corrected by what the reports say, and always an end."""

import asyncio
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from protocol.commands import Override
from protocol.machine import MachineState
from server.machine.overrides import LEAST_PERCENT, MOST_PERCENT, NEUTRAL_PERCENT, STEP_S, Overrides, after, steps
from server.problems import ProblemError
from tests.harness.simloop import run_simulated

PERCENT = st.integers(LEAST_PERCENT, MOST_PERCENT)
MOST_STEPS = 16
"""Reset, ten tens, five ones."""


@given(st.none() | PERCENT, PERCENT)
def test_steps_lead_from_anywhere_to_everywhere(present: int | None, wanted: int) -> None:
    way = steps(present, wanted)
    assert len(way) <= MOST_STEPS
    if present is None:
        assert way[0] == "reset"
    percent = present or 55
    for step in way:
        percent = after(percent, step)
    assert percent == wanted


@pytest.mark.parametrize(
    ("present", "wanted", "expected"),
    [
        (100, 100, []),
        (100, 110, ["+10"]),
        (100, 123, ["+10", "+10", "+1", "+1", "+1"]),
        (100, 109, ["+10", "-1"]),
        (100, 91, ["-10", "+1"]),
        (180, 100, ["reset"]),
        (180, 101, ["reset", "+1"]),
        (195, 200, ["+10"]),
        (12, 10, ["-10"]),
        (None, 90, ["reset", "-10"]),
    ],
)
def test_the_fewest_bytes(present: int | None, wanted: int, expected: list[str]) -> None:
    assert steps(present, wanted) == expected


class Grbl:
    """A controller that notes bytes as flags, looks at them every `look_s`, and reports every 0.2 s."""

    def __init__(self, *, look_s: float = 0.001, feed: int = 100) -> None:
        self.loop = asyncio.get_running_loop()
        self.state = MachineState(status="run", overrides={"feed": feed, "rapid": 100, "spindle": 100})
        self.now: dict[str, int] = dict(self.state.overrides)
        self.flags: list[Override] = []
        self.pressed: list[tuple[float, str, str]] = []
        self.deaf = False
        self.linked = True
        self._every(look_s, self.look)
        self._every(0.2, self.report)

    def _every(self, seconds: float, do: Callable[[], None]) -> None:
        def again() -> None:
            do()
            self.loop.call_later(seconds, again)

        self.loop.call_later(seconds, again)

    def press(self, make: Callable[[int], Any]) -> None:
        if not self.linked:
            raise ProblemError("not_connected", "router is disconnected.")
        command = make(0)
        self.pressed.append((self.loop.time(), command.what, command.step))
        if command not in self.flags:
            self.flags.append(command)

    def look(self) -> None:
        for flag in self.flags if not self.deaf else ():
            if flag.what == "rapid":
                self.now["rapid"] = {"reset": 100, "50": 50, "25": 25}[flag.step]
            else:
                self.now[flag.what] = after(self.now[flag.what], flag.step)
        self.flags.clear()

    def report(self) -> None:
        self.state = MachineState(status="run", overrides=dict(self.now))

    def overrides(self) -> Overrides:
        return Overrides(lambda: self.state, self.press, self.loop)

    def steps_of(self, kind: str) -> list[str]:
        return [step for _, what, step in self.pressed if what == kind]


def test_a_wish_comes_true_in_the_reports() -> None:
    async def main() -> None:
        grbl = Grbl()
        overrides = grbl.overrides()
        overrides.want({"feed": 123, "rapid": 25, "spindle": 87})
        assert grbl.pressed == [(0.0, "feed", "+10"), (0.0, "rapid", "25"), (0.0, "spindle", "-10")]
        assert overrides.wanted == {"feed": 123, "rapid": 25, "spindle": 87}
        await asyncio.sleep(2.0)
        assert grbl.state.overrides == {"feed": 123, "rapid": 25, "spindle": 87}
        assert overrides.wanted == {}
        assert grbl.steps_of("feed") == ["+10", "+10", "+1", "+1", "+1"]

    run_simulated(main())


def test_bytes_go_one_at_a_time() -> None:
    async def main() -> None:
        grbl = Grbl()
        grbl.overrides().want({"feed": 150})
        await asyncio.sleep(2.0)
        times = [at for at, _, _ in grbl.pressed]
        assert min(after - before for before, after in pairwise(times)) >= STEP_S * 0.99

    run_simulated(main())


def test_two_wishes_at_once_do_not_send_bytes_at_once() -> None:
    async def main() -> None:
        grbl = Grbl()
        overrides = grbl.overrides()
        for wanted in (110, 120, 130):
            overrides.want({"feed": wanted})
        await asyncio.sleep(2.0)
        times = [at for at, _, _ in grbl.pressed]
        assert min(after - before for before, after in pairwise(times)) >= STEP_S * 0.99
        assert (grbl.now["feed"], grbl.steps_of("feed")) == (130, ["+10"] * 3)

    run_simulated(main())


def test_bytes_that_counted_as_one_are_made_good() -> None:
    """It looks at its flags so rarely that two of three bytes are lost."""

    async def main() -> None:
        grbl = Grbl(look_s=3 * STEP_S)
        grbl.overrides().want({"feed": 130})
        await asyncio.sleep(10.0)
        assert grbl.state.overrides["feed"] == 130
        assert len(grbl.steps_of("feed")) > 3

    run_simulated(main())


def test_a_wish_that_is_never_heeded_ends() -> None:
    async def main() -> None:
        grbl = Grbl()
        grbl.deaf = True
        overrides = grbl.overrides()
        overrides.want({"feed": 110})
        await asyncio.sleep(20.0)
        assert (overrides.wanted, grbl.steps_of("feed")) == ({}, ["+10"] * 3)

    run_simulated(main())


def test_the_newest_wish_counts_and_goes_on_from_where_the_bytes_have_led() -> None:
    """A slider that is dragged: no way back over 100 %."""

    async def main() -> None:
        grbl = Grbl()
        overrides = grbl.overrides()
        for wanted in (120, 130, 140, 160):
            overrides.want({"feed": wanted})
            await asyncio.sleep(2 * STEP_S)
        await asyncio.sleep(3.0)
        assert grbl.state.overrides["feed"] == 160
        assert grbl.steps_of("feed") == ["+10"] * 6

    run_simulated(main())


def test_what_is_so_already_needs_no_byte() -> None:
    async def main() -> None:
        grbl = Grbl(feed=120)
        overrides = grbl.overrides()
        overrides.want({"feed": 120})
        await asyncio.sleep(2.0)
        assert (grbl.pressed, overrides.wanted) == ([], {})

    run_simulated(main())


def test_without_reports_it_begins_at_100() -> None:
    async def main() -> None:
        grbl = Grbl(feed=120)
        grbl.state = MachineState(status="run")
        grbl.overrides().want({"feed": 110})
        await asyncio.sleep(1.0)
        assert grbl.steps_of("feed") == ["reset", "+10"]
        assert grbl.now["feed"] == NEUTRAL_PERCENT + 10

    run_simulated(main())


def test_a_broken_link_ends_every_wish() -> None:
    async def main() -> None:
        grbl = Grbl()
        overrides = grbl.overrides()
        overrides.want({"feed": 150})
        grbl.linked = False
        await asyncio.sleep(1.0)
        assert (overrides.wanted, len(grbl.pressed)) == ({}, 1)
        with pytest.raises(ProblemError):
            overrides.want({"feed": 120})
        assert overrides.wanted == {}

    run_simulated(main())
