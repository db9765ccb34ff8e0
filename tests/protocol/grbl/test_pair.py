"""The engine against the virtual Grbl: what it calls executed is executed, whatever befalls them."""

from collections.abc import Callable
from random import Random
from typing import Any

import pytest

from protocol.commands import (
    CheckMode,
    ClearAlarm,
    CycleStart,
    EmergencyStop,
    FeedHold,
    Home,
    Jog,
    JogCancel,
    ReadSettings,
    Restore,
    RunBlock,
    SoftReset,
    Stop,
    WriteSetting,
)
from sim.faults import FaultRates
from sim.grbl.core import State
from sim.grbl.simsettings import SimSettings
from tests.harness.grblpair import GrblPair, walk

FAST = {110: 6000.0, 111: 6000.0, 112: 6000.0, 120: 500.0, 121: 500.0, 122: 500.0}
FLAVOURS = ("1.1h", "grblHAL")
Act = Callable[[GrblPair], Any]


def board(flavour: str, dollar: dict[int, float] | None = None, **more: Any) -> SimSettings:
    return SimSettings(flavour=flavour, dollar={**FAST, **(dollar or {})}, **more)  # type: ignore[arg-type]


def pressing(make: Callable[[int], Any]) -> Act:
    return lambda pair: pair.press(make)


MISHAPS: dict[str, Callable[[Random, float], list[tuple[float, Act]]]] = {
    "none": lambda random, at: [],
    "stop": lambda random, at: [(at, pressing(Stop))],
    "reset": lambda random, at: [(at, pressing(SoftReset))],
    "emergency": lambda random, at: [(at, pressing(EmergencyStop))],
    "hold": lambda random, at: [(at, pressing(FeedHold)), (at + random.uniform(0, 2), pressing(CycleStart)),
                                (at + 3, pressing(CycleStart))],
    "restart": lambda random, at: [(at, lambda pair: pair.machine.restart(pair.now))],
    "limit": lambda random, at: [(at, lambda pair: pair.machine.press("X", pair.now))],
    "pendant": lambda random, at: [(at, lambda pair: pair.machine.set_mpg(True, pair.now)),
                                   (at + 1, lambda pair: pair.machine.set_mpg(False, pair.now))],
}  # fmt: skip


def hostile(seed: int) -> GrblPair:
    """A run as its seed has it."""
    random = Random(seed)
    mishap = random.choice([*MISHAPS, "lossy", "refused", "refused and stopped"])
    flavour = "grblHAL" if mishap == "pendant" else random.choice(FLAVOURS)
    program = walk(seed, random.randint(1, 8))
    at = random.uniform(0.1, 3)
    acts = MISHAPS.get(mishap, MISHAPS["none"])(random, at)
    if mishap.startswith("refused"):
        which = random.randrange(len(program))
        lines = list(program[which])
        lines.insert(random.randint(0, len(lines)), "G1X1X2")
        program[which] = tuple(lines)
        acts = [(seconds, pressing(CycleStart)) for seconds in (5.0, 8.0, 11.0)]
    return GrblPair(
        program,
        board(flavour, {10: random.choice((1.0, 3.0)), 21: float(mishap == "limit")}),
        seed=seed,
        at=acts if mishap != "refused and stopped" else [],
        rates=FaultRates(loss=0.0005, flip=0.0005) if mishap == "lossy" else FaultRates(),
        on_error="stop" if mishap == "refused and stopped" else "hold",
    )


@pytest.mark.slow
@pytest.mark.parametrize("first", range(0, 80, 10))
def test_hostile_runs(first: int) -> None:
    for seed in range(first, first + 10):
        pair = hostile(seed)
        pair.run(120)
        assert pair.finished, f"seed {seed}: hangs in {pair.engine._phase}, gate {pair.engine._gate()}"
        pair.run(3, until=lambda _: False)
        pair.verify()


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_a_program_runs_to_its_end(flavour: str) -> None:
    pair = GrblPair(walk(1, 10), board(flavour), seed=1).run()
    pair.verify()
    assert pair.done == list(range(1, 12))
    assert pair.machine.most_ring_bytes > 100


def test_a_board_that_resets_on_open() -> None:
    from protocol.grbl.dialect import Dialect

    pair = GrblPair(walk(1, 2), board("1.1h", reset_on_open=True), dialect=Dialect()).run()
    assert pair.now > 1.5
    pair.verify()


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_stop_keeps_the_position(flavour: str) -> None:
    pair = GrblPair((("G21G90", "G1F3000", "X100", "X0"),), board(flavour))
    pair.ready().run(1.0, until=lambda _: False)
    pair.press(Stop)
    pair.run(5.0, until=lambda p: bool(p.of("ControllerReset")))
    assert pair.of("ControllerReset")[0].position_kept
    assert pair.machine.position["X"] - pair.machine.true_position["X"] == pytest.approx(
        50.0, abs=0.01
    )  # it began at -50
    pair.run(2.0, until=lambda p: p.engine.free() > 0)
    assert pair.engine.free() > 0


def test_a_reset_in_motion_loses_it() -> None:
    pair = GrblPair((("G21G90", "G1F3000", "X100"),), board("1.1h"))
    pair.ready().run(1.0, until=lambda _: False)
    pair.press(EmergencyStop)
    pair.run(5.0, until=lambda p: bool(p.of("ControllerReset")))
    assert not pair.of("ControllerReset")[0].position_kept


def test_jogs_and_their_cancel() -> None:
    pair = GrblPair((), board("1.1h"))
    pair.run(5.0, until=lambda p: p.engine.free() > 0)
    for _ in range(8):
        pair.submit(lambda token: Jog(token, {"x": 20.0}, 3000.0))
    pair.run(0.7, until=lambda _: False)
    assert pair.machine.state is State.JOG
    token = pair.press(JogCancel)
    pair.run(5.0, until=lambda p: any(event.token == token for event in p.of("CommandDone")))
    at = pair.machine.position["X"]
    pair.run(2.0, until=lambda _: False)
    assert pair.machine.state is State.IDLE
    assert 0 < pair.machine.position["X"] == at < 160


def by_hand(pair: GrblPair, make: Callable[[int], Any], seconds: float = 100.0) -> Any:
    """The answer to a command."""
    pair.run(5.0, until=lambda p: p.engine.free() > 0)
    token = pair.submit(make)
    answers: list[Any] = []

    def answered(p: GrblPair) -> bool:
        answers[:] = [
            event for kind in ("CommandDone", "CommandFailed") for event in p.of(kind) if event.token == token
        ]
        return bool(answers)

    pair.run(seconds, until=answered)
    assert answers, "no answer"
    return answers[0]


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_commands_by_hand(flavour: str) -> None:
    pair = GrblPair((), board(flavour, {22: 1.0, 24: 500.0, 25: 3000.0}))
    for make in (
        ClearAlarm,
        Home,
        lambda token: WriteSetting(token, 11, "0.02"),
        ReadSettings,
        lambda token: RunBlock(token, ("G21G91", "G1X-5F3000")),
        lambda token: CheckMode(token, on=True),
        lambda token: CheckMode(token, on=False),
        ClearAlarm,
        lambda token: Restore(token, "settings"),
    ):
        answer = by_hand(pair, make)
        assert type(answer).__name__ == "CommandDone", answer
    assert pair.of("Homed")
    assert pair.of("SettingsRead")[-1].values


def tangle(seed: int) -> list[tuple[str, ...]]:
    """Moves of less than a step, changes of units, distance mode, origin, EEPROM writes, dwells, arcs; the feed makes
    each line unlike any other. What proves execution must not be fooled by any of them."""
    random = Random(seed)
    program: list[tuple[str, ...]] = [("G21G90G94", "G1F2000")]
    number = 2000
    for _ in range(random.randint(2, 8)):
        lines = []
        for _ in range(random.randint(1, 15)):
            number += 1
            block = random.choice(
                (
                    f"G1X{random.choice((0, 1, 5, 5.001, 5.004, 7, 20))}Y{random.choice((0, 1, 2))}",
                    f"G1X{random.choice((0, 5, 5.001, 5.004))}",
                    f"G91G1X{random.choice((0, 0.001, 0.004, 1, -1))}",
                    f"G90G0X{random.uniform(0, 30):.3f}",
                    f"G20G1X{random.choice((0, 0.0001, 0.1))}",
                    "G21",
                    f"G92X{random.choice((0, 1))}",
                    f"G{random.choice((54, 55))}",
                    f"G10L2P{random.choice((1, 2))}X{random.choice((0, 1))}",
                    f"M{random.choice((3, 5))}S1000",
                    f"G90G2X{random.uniform(0, 20):.3f}Y1R50",
                )
            )
            lines.append(f"{block}F{number}" if random.random() < 0.95 else f"G4P0.0{number}")
        program.append(tuple(lines))
    return program


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(12))
def test_what_proves_execution_is_not_fooled(seed: int) -> None:
    random = Random(seed)
    settings = board(random.choice(FLAVOURS), {10: random.choice((1.0, 3.0))})
    pair = GrblPair(tangle(seed), settings, seed=seed, on_error="ignore").run(600)
    assert pair.finished
    assert not pair.failed
    pair.verify()
