import asyncio

import pytest

from server.machine.heldjog import HEARTBEAT_S, STEP_S, HeldJogs, step
from server.problems import ProblemError
from tests.harness.fakeworkshop import FakeMachine, settle
from tests.harness.simloop import run_simulated as run

ME, SOMEBODY_ELSE = object(), object()
FEED = 600.0
BEAT_S = 0.1


class Bench:
    """A machine that runs each step for its time, as a real one would, and when its steps began."""

    def __init__(self, *, answers_at_once: bool = False) -> None:
        self.machine = FakeMachine("router")
        self.held = HeldJogs(lambda name: {"router": self.machine}[name])
        self.began_at: list[float] = []
        self.busy_until = 0.0
        self.answers_at_once = answers_at_once
        self.machine.while_jogging = self.run_step

    async def run_step(self) -> None:
        loop = asyncio.get_running_loop()
        if loop.time() < self.busy_until - 1e-6:
            raise ProblemError("machine_busy", "still moving")
        self.began_at.append(loop.time())
        self.busy_until = loop.time() + STEP_S * 1.1
        if not self.answers_at_once:
            await asyncio.sleep(STEP_S * 1.1)

    async def beat(self, owner: object = ME) -> None:
        await self.held.beat("router", owner, {"x": 1.0}, FEED)


def test_a_step_goes_as_far_as_the_feed_goes_in_its_time() -> None:
    assert step({"x": 1.0}, 600) == {"x": 1.5}
    assert step({"x": -100.0}, 600) == {"x": -1.5}
    assert step({"x": 3.0, "y": -4.0, "z": 0.0}, 600) == {"x": 0.9, "y": -1.2}


@pytest.mark.parametrize("answers_at_once", [False, True])
def test_it_moves_while_the_heart_beats_and_stops_when_it_does(answers_at_once: bool) -> None:
    async def main() -> None:
        bench = Bench(answers_at_once=answers_at_once)
        loop = asyncio.get_running_loop()
        for _ in range(30):
            await bench.beat()
            await asyncio.sleep(BEAT_S)
        last_beat = loop.time() - BEAT_S
        await asyncio.sleep(10)
        assert 15 <= len(bench.began_at) <= 21, "three seconds of steps, without a backlog"
        assert bench.began_at[-1] < last_beat + HEARTBEAT_S
        assert bench.machine.names()[-1] == "cancel_jog"

    run(main())


def test_letting_go_ends_it_at_once() -> None:
    async def main() -> None:
        bench = Bench()
        await bench.beat()
        bench.held.release("router", ME)
        assert bench.machine.names()[-1] == "cancel_jog"
        steps = len(bench.began_at)
        await asyncio.sleep(5)
        assert len(bench.began_at) == steps

    run(main())


def test_closing_the_socket_ends_all_of_its_jogs_and_no_others() -> None:
    async def main() -> None:
        machines = {name: FakeMachine(name) for name in ("one", "two", "three")}
        held = HeldJogs(machines.__getitem__)
        await held.beat("one", ME, {"x": 1}, FEED)
        await held.beat("two", ME, {"x": 1}, FEED)
        await held.beat("three", SOMEBODY_ELSE, {"x": 1}, FEED)
        held.release_all(ME)
        assert ["cancel_jog" in machine.names() for machine in machines.values()] == [True, True, False]
        await asyncio.sleep(1)

    run(main())


def test_two_people_cannot_jog_one_machine() -> None:
    async def main() -> None:
        bench = Bench()
        await bench.beat(ME)
        with pytest.raises(ProblemError) as caught:
            await bench.beat(SOMEBODY_ELSE)
        assert caught.value.code == "machine_busy"
        bench.held.release("router", SOMEBODY_ELSE)
        assert "cancel_jog" not in bench.machine.names(), "and not stop each other's either"
        await asyncio.sleep(1)
        await bench.beat(SOMEBODY_ELSE)
        await asyncio.sleep(1)

    run(main())


def test_a_machine_that_refuses_is_told_to_the_first_beat() -> None:
    async def main() -> None:
        bench = Bench()
        bench.machine.refusals["jog"] = ProblemError("alarm_active", "in alarm")
        with pytest.raises(ProblemError) as caught:
            await bench.beat()
        assert caught.value.code == "alarm_active"
        del bench.machine.refusals["jog"]
        await bench.beat()
        await asyncio.sleep(1)

    run(main())


def test_a_busy_machine_is_told_to_the_first_beat_and_waited_for_later() -> None:
    async def main() -> None:
        bench = Bench()
        bench.busy_until = asyncio.get_running_loop().time() + 1
        with pytest.raises(ProblemError) as caught:
            await bench.beat()
        assert caught.value.code == "machine_busy"

    run(main())


async def refused_in_the_middle(bench: Bench) -> None:
    """Two steps have run, the third was refused, and the heart still beats."""
    await bench.beat()
    await bench.beat()
    bench.machine.refusals["jog"] = ProblemError("alarm_active", "limit switch")
    await asyncio.sleep(0.19)
    assert len(bench.began_at) == 2
    assert bench.machine.names() == ["jog"] * 3


def test_a_later_refusal_is_told_to_the_next_beat_and_ends_it() -> None:
    async def main() -> None:
        bench = Bench()
        await refused_in_the_middle(bench)
        with pytest.raises(ProblemError) as caught:
            await bench.beat()
        assert caught.value.code == "alarm_active"
        await asyncio.sleep(1)
        assert bench.machine.names() == ["jog"] * 3, "told, and not tried again"

    run(main())


def test_a_refusal_that_nobody_heard_of_bars_nobody() -> None:
    async def main() -> None:
        for next_one, pause_s in ((SOMEBODY_ELSE, 0.0), (ME, 60.0)):
            bench = Bench()
            await refused_in_the_middle(bench)
            bench.machine.refusals.clear()
            await asyncio.sleep(pause_s)
            await bench.beat(next_one)
            assert len(bench.began_at) >= 3
            await asyncio.sleep(1)

    run(main())


def test_the_old_jog_does_not_end_the_new_one() -> None:
    async def main() -> None:
        bench = Bench(answers_at_once=True)
        await bench.beat()
        bench.held.release("router", ME)
        bench.busy_until = 0.0
        await bench.beat(SOMEBODY_ELSE)
        cancels = bench.machine.names().count("cancel_jog")
        await asyncio.sleep(HEARTBEAT_S / 2)
        await settle()
        assert bench.machine.names().count("cancel_jog") == cancels
        await asyncio.sleep(1)

    run(main())
