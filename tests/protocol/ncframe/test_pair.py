"""The promise, on hundreds of hostile runs: every frame once and in order, or the doubt named, and only then."""

from collections import Counter
from random import Random
from typing import Literal

import pytest

from protocol.events import BatchFailed, FateInDoubt, LinkReady, ProtocolFault
from protocol.ncframe.codec import Check
from protocol.ncframe.dialect import Dialect
from sim.faults import Drop, FaultRates
from sim.ncframe.settings import SimSettings
from tests.harness.ncpair import Mishap, NcPair, walk

COUNTER = pytest.mark.parametrize("counter", [True, False])
FRAMING = pytest.mark.parametrize("framing", ["length", "gap"])


def pair(seed: int, *, counter: bool = True, framing: str = "gap", parts: int = 6, **more: object) -> NcPair:
    settings = SimSettings(counter=counter, framing=framing, **more.pop("sim", {}))  # type: ignore[arg-type]
    dialect = more.pop("dialect", None) or Dialect(counter=counter)
    return NcPair(walk(seed, parts), settings, seed, dialect=dialect, **more)  # type: ignore[arg-type]


@COUNTER
@FRAMING
@pytest.mark.parametrize("check", ["none", "xor", "crc8"])
@pytest.mark.parametrize("baud", [0, 9600])
def test_a_perfect_wire(counter: bool, framing: str, check: Check, baud: int) -> None:
    dialect = Dialect(counter=counter, check=check)
    run = pair(1, counter=counter, framing=framing, sim={"check": check}, dialect=dialect, baud=baud).run()
    run.verify()
    assert run.outcome == "completed"
    assert run.of("ProtocolFault") == []
    enqs = sum(line.endswith("> ENQ") for line in run.console())
    assert enqs == (2 + len(run.executed) if counter else 1)


def test_a_machine_of_another_dialect_is_not_understood_and_moves_nothing() -> None:
    run = pair(1, sim={"check": "xor"}).run(120)
    assert run.outcome == "interrupted"
    assert run.executed == []
    assert run.failed is not None
    assert run.failed.reason == "error"


@FRAMING
@pytest.mark.parametrize("nth", range(1, 31))
def test_any_single_byte_from_the_machine_may_be_lost_where_it_counts(framing: str, nth: int) -> None:
    drop = FaultRates(drops=(Drop(match=lambda _: True, first=nth),))
    run = pair(nth, framing=framing, parts=2, up=drop).run()
    run.verify()
    assert run.outcome == "completed"


@pytest.mark.parametrize("nth", range(1, 31))
def test_any_single_byte_from_the_host_may_be_lost_where_it_counts(nth: int) -> None:
    drop = FaultRates(drops=(Drop(match=lambda _: True, first=nth),))
    run = pair(nth, parts=2, rates=drop, up=FaultRates()).run()
    run.verify()
    assert run.outcome == "completed"


@pytest.mark.parametrize("nth", range(2, 12))
def test_a_lost_ack_is_the_end_where_nothing_is_counted(nth: int) -> None:
    drop = FaultRates(drops=(Drop(match=lambda _: True, first=nth),))
    run = pair(nth, counter=False, parts=4, up=drop).run()
    run.verify()
    assert run.outcome == "interrupted"
    assert run.failed is not None
    assert run.failed.lines_done is not None
    assert run.failed.lines_touched == run.failed.lines_done + 1
    assert sum(len(run.program[place]) for place in run.done) + run.failed.lines_done == nth - 2


@pytest.mark.parametrize("nth", range(2, 32))
def test_a_byte_lost_within_a_frame_is_refused_and_mended_without_a_counter(nth: int) -> None:
    """Byte 1 is ENQ; a frame of one lost byte is not whole, and one of which all bytes are lost is none."""
    drop = FaultRates(drops=(Drop(match=lambda _: True, first=nth),))
    run = pair(nth, counter=False, parts=2, rates=drop, up=FaultRates()).run()
    run.verify()
    assert run.outcome == "completed"


def hostile(seed: int, *, noise: float = 0.0) -> FaultRates:
    random = Random(seed)
    rate = random.choice((0.001, 0.004, 0.01))
    return FaultRates(
        loss=rate,
        flip=rate,
        duplicate=rate / 2,
        noise=noise,
        delay=random.choice((0.0, 0.02)),
        delay_s=random.choice((0.1, 0.5)),
    )


@pytest.mark.slow
@pytest.mark.parametrize("block", range(4))
def test_hostile_wires_where_the_machine_counts(block: int) -> None:
    outcomes: Counter[str | None] = Counter()
    for seed in range(block * 40, block * 40 + 40):
        random = Random(seed)
        baud, speed = random.choice((0, 9600, 115200)), random.choice((0.3, 1.0, 5.0))
        run = pair(seed, rates=hostile(seed), baud=baud, sim={"speed_factor": speed}).run()
        assert run.misread == []
        run.verify()
        outcomes[run.outcome] += 1
        if run.outcome == "interrupted":  # the first frame of all, a frame refused ten times, a byte that became CAN
            assert run.of("FateInDoubt") or run.of("BatchFailed"), seed
    assert outcomes["completed"] >= 37


@pytest.mark.slow
def test_noise_where_the_machine_counts() -> None:
    """A burst of noise may hold CAN, which is believed, and frames whose check byte happens to fit."""
    outcomes: Counter[str | None] = Counter()
    for seed in range(50):
        run = pair(seed, rates=FaultRates(noise=0.02, noise_bytes=12)).run()
        if run.misread:
            outcomes["misread"] += 1
            continue
        run.verify()
        outcomes[run.outcome] += 1
    assert outcomes["completed"] >= 35
    assert outcomes["misread"] <= 2


def lies(seed: int, kinds: tuple[Literal["ack", "nak"], ...]) -> list[Mishap]:
    random = Random(seed)
    return [Mishap(random.uniform(0.3, 8), random.choice(kinds)) for _ in range(12)]


@FRAMING
def test_answers_that_nobody_gave_are_found_out_by_the_count(framing: str) -> None:
    """The frames run for long, so most of the lies fall into one."""
    for seed in range(40):
        sim = {"speed_factor": 0.1, "start_count": 7}
        run = pair(seed, framing=framing, parts=3, mishaps=lies(seed, ("ack", "nak")), sim=sim, expected_s=20.0).run()
        run.verify()
        assert run.outcome == "completed", seed


def test_a_nak_that_nobody_said_is_a_doubt_without_a_counter_and_never_a_second_execution() -> None:
    outcomes: Counter[str | None] = Counter()
    for seed in range(40):
        run = pair(seed, counter=False, parts=3, mishaps=lies(seed, ("nak",)), sim={"speed_factor": 0.1}).run()
        run.verify()
        outcomes[run.outcome] += 1
    assert outcomes["interrupted"] > 20


@pytest.mark.slow
def test_a_machine_that_finds_frames_by_their_length_alone() -> None:
    """Damage that changes the length gets past the check byte once in 256; all else is as it must be."""
    outcomes: Counter[str | None] = Counter()
    for seed in range(60):
        run = pair(seed, framing="length", rates=hostile(seed)).run()
        if run.misread:
            outcomes["misread"] += 1
            continue
        run.verify()
        outcomes[run.outcome] += 1
    assert outcomes["completed"] >= 50
    assert outcomes["misread"] <= 3


@pytest.mark.slow
@pytest.mark.parametrize("block", range(2))
def test_hostile_wires_without_a_counter(block: int) -> None:
    """Many runs end in a doubt of one frame; none executes a frame twice, loses one or misplaces the doubt."""
    outcomes: Counter[str | None] = Counter()
    for seed in range(block * 100, block * 100 + 100):
        baud = Random(seed).choice((0, 9600, 115200))
        run = pair(seed, counter=False, rates=hostile(seed), baud=baud).run()
        assert run.misread == []
        run.verify()
        outcomes[run.outcome] += 1
        if run.failed is not None:
            assert run.failed.lines_done is not None
            assert run.failed.lines_touched is not None
            assert run.failed.lines_touched - run.failed.lines_done <= 1
    assert outcomes["completed"] > 10
    assert outcomes["interrupted"] > 10


@pytest.mark.slow
@FRAMING
def test_unplugged_where_the_machine_counts(framing: str) -> None:
    """Nothing is lost or doubled; only a break in the very first frame of all cannot be told from a restart."""
    outcomes: Counter[str | None] = Counter()
    for seed in range(50):
        random = Random(seed)
        times = [random.uniform(0.3, 4) for _ in range(random.randint(1, 4))]
        breaks = [Mishap(at, "unplug", random.choice((0.0, 0.3, 3.0))) for at in times]
        run = pair(seed, framing=framing, mishaps=breaks, sim={"start_count": 7}).run()
        run.verify()
        outcomes[run.outcome] += 1
    assert set(outcomes) == {"completed"}


def test_unplugged_without_a_counter_is_in_doubt() -> None:
    for seed in range(30):
        run = pair(seed, counter=False, mishaps=[Mishap(Random(seed).uniform(0.4, 1.0), "unplug", 0.2)]).run()
        run.verify()
        assert run.outcome == "interrupted"
        assert isinstance(run.events[-1][1], FateInDoubt | LinkReady) or run.of("FateInDoubt")
        assert len(run.doubt) == 1


@pytest.mark.slow
@pytest.mark.parametrize("rate", [0.0, 0.003])
def test_restarts_where_the_machine_counts(rate: float) -> None:
    """Interrupted in every run that the restart hit, with at most one frame in doubt."""
    interrupted = 0
    for seed in range(100):
        random = Random(seed)
        mishap = Mishap(random.uniform(0.3, 1.2), "restart")
        rates = FaultRates(loss=rate, flip=rate)
        sim = {"boot_s": random.choice((0.01, 0.5, 2.0)), "start_count": random.choice((0, 7, 2**32 - 100))}
        run = pair(seed, mishaps=[mishap], rates=rates, sim=sim).run()
        run.verify()
        ran = run.lathe.executed
        untouched = not ran or ran[0].at > mishap.at  # it restarted before it had executed anything
        assert run.outcome == "interrupted" or run.now <= mishap.at or untouched, seed
        interrupted += run.outcome == "interrupted"
        if run.failed is not None:
            assert run.failed.lines_done is not None
            assert run.failed.lines_touched is not None
            assert run.failed.lines_touched - run.failed.lines_done <= 1
    assert interrupted > 80


@pytest.mark.slow
def test_restarts_and_breaks_together_right_behind_power_on() -> None:
    """The first frames of all, where a restarted machine may count what it had counted before."""
    for seed in range(150):
        random = Random(seed)
        kinds = [random.choice(("restart", "restart", "unplug")) for _ in range(random.randint(1, 3))]
        mishaps = [Mishap(random.uniform(0.25, 0.6), kind, random.choice((0.0, 0.3))) for kind in kinds]  # type: ignore[arg-type]
        sim = {"boot_s": random.choice((0.001, 0.05)), "start_count": random.choice((0, 1)), "speed_factor": 0.3}
        run = pair(seed, mishaps=mishaps, rates=hostile(seed), parts=3, sim=sim).run()
        run.verify()


def test_a_restart_without_a_counter_is_in_doubt_when_a_frame_was_on_its_way() -> None:
    for seed in range(20):
        run = pair(seed, counter=False, mishaps=[Mishap(0.6, "restart")], sim={"boot_s": 0.01}).run()
        run.verify()
        assert run.outcome == "interrupted"


@COUNTER
def test_the_hold_key_makes_nothing_wrong(counter: bool) -> None:
    for seed in range(20):
        random = Random(seed)
        holds = [Mishap(random.uniform(0.3, 2), "hold", random.choice((0.0, 1.0, 15.0))) for _ in range(2)]
        run = pair(seed, counter=counter, mishaps=holds).run()
        run.verify()
        assert run.outcome == "completed"


@COUNTER
def test_the_stop_button_is_an_alarm(counter: bool) -> None:
    for seed in range(20):
        run = pair(seed, counter=counter, mishaps=[Mishap(Random(seed).uniform(0.3, 1), "panic")]).run()
        run.verify()
        assert run.outcome == "interrupted"
        assert [event.status for event in run.of("StateReported")][-1] == "alarm"


def test_after_a_break_too_long_nothing_moves_again_by_itself() -> None:
    halves = 0
    for seed in range(40):
        mishap = Mishap(Random(seed).uniform(0.4, 1.5), "unplug", 20.0)
        run = pair(seed, mishaps=[mishap], resume_within_s=10, sim={"start_count": 7})
        run.run(until=lambda run: run.epochs == 2)
        before = run.executed
        run.run(until=lambda run: len(run.of("LinkReady")) == 2)
        assert run.executed == before
        halves += any(isinstance(event, BatchFailed) for _, event in run.events)
        if run.failed is not None:
            assert run.failed.lines_done == run.failed.lines_touched
    assert halves > 5


def test_the_same_seed_gives_the_same_run() -> None:
    def history(seed: int) -> list[str]:
        return [repr(event) for event in pair(seed, rates=hostile(seed)).run().events]

    assert history(7) == history(7)
    assert any(isinstance(event, ProtocolFault) for _, event in pair(7, rates=hostile(7)).run().events)
