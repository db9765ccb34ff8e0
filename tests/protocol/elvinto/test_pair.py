"""The promise, on thousands of hostile runs: every block once and in order, or the doubt named, and only then."""

from collections import Counter
from random import Random

import pytest

from protocol.elvinto.dialect import Dialect
from protocol.events import BatchDone, LinkReady, ProtocolFault
from sim.elvinto.settings import SimSettings
from sim.faults import Drop, FaultRates
from tests.harness.effort import more
from tests.harness.pair import Mishap, Pair, walk

BOTH = pytest.mark.parametrize("repeat", ["silent", "reack"])


def settings(repeat: str, **more) -> SimSettings:
    return SimSettings(repeat=repeat, speed_factor=more.pop("speed_factor", 5.0), **more)


@BOTH
@pytest.mark.parametrize("instant", [False, True])
def test_a_perfect_wire(repeat, instant):
    pair = Pair(walk(1, 20), settings(repeat, instant=instant)).run()
    pair.verify()
    assert pair.outcome == "completed"
    assert not any(isinstance(e, ProtocolFault) or (isinstance(e, BatchDone) and e.inferred) for e in pair.events)


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        ("header", {"header_name": "CRC"}),
        ("radix", {"crc_radix": 16}),
        ("scope", {"checksum_scope": "gcode"}),
        ("init", {"init_acknowledged": False}),
    ],
)
def test_every_dialect(name, changes):
    pair = Pair(walk(2, 5), settings("silent", **changes), dialect=Dialect(**changes)).run()
    pair.verify()
    assert pair.outcome == "completed"


def test_the_standards_own_spelling_of_state():
    pair = Pair(walk(2, 5), settings("silent", literal_state=True)).run()
    pair.verify()
    assert pair.outcome == "completed"


@BOTH
@pytest.mark.parametrize("kind", ["RECEIVED", "OK", "STATE", "READY", "GCODE", "INIT"])
@pytest.mark.parametrize("first", range(1, 9))
def test_any_single_message_may_be_lost(repeat, kind, first):
    pair = Pair(walk(first, 6), settings(repeat), seed=first, rates=FaultRates(drops=(Drop(kind, first),))).run()
    pair.verify()
    assert pair.outcome == "completed"


def hostile(seed: int) -> FaultRates:
    random = Random(seed)
    bad = 10 ** random.uniform(-4.5, -2.7)
    return FaultRates(
        loss=bad * random.random(),
        flip=bad * random.random(),
        duplicate=bad * random.random(),
        noise=random.choice((0, 0, 0.02)),
        delay=random.choice((0, 0, 0.05)),
        delay_s=random.choice((0.1, 0.5, 1.0)),
    )


@BOTH
@pytest.mark.parametrize("block", range(more(4)))
@pytest.mark.slow
def test_flips_losses_duplicates_noise_and_delays(repeat, block):
    outcomes: Counter[str | None] = Counter()
    for seed in range(block * 100, block * 100 + 100):
        pair = Pair(walk(seed, 6), settings(repeat), seed=seed, rates=hostile(seed)).run()
        pair.verify()
        outcomes["flipped" if pair.flipped else pair.outcome] += 1
    assert outcomes["flipped"] <= 2
    assert set(outcomes) <= {"completed", "flipped"}


@BOTH
def test_a_repetition_whose_id_flips_upwards_is_executed_twice_and_named(repeat):
    """Seed 2778: the OK is lost, the repetition arrives as another ID, and that ID is acknowledged."""
    pair = Pair(walk(2778, 6), settings(repeat), seed=2778, rates=hostile(2778)).run()
    pair.verify()
    assert (pair.outcome, pair.flipped, pair.doubt) == ("interrupted", True, (5,))
    assert pair.executed[-2 * len(pair.blocks(pair.doubt)) :] == 2 * pair.blocks(pair.doubt)


@BOTH
@pytest.mark.parametrize("block", range(more(2)))
@pytest.mark.slow
def test_crashes_and_pulled_plugs_on_a_hostile_wire(repeat, block):
    outcomes: Counter[str | None] = Counter()
    for seed in range(block * 100, block * 100 + 100):
        random = Random(seed)
        mishaps = [
            Mishap(random.uniform(0.05, 3), random.choice(("crash", "unplug")), random.choice((0.0, 0.3, 2.0)))
            for _ in range(random.randint(1, 3))
        ]
        rates = hostile(seed) if seed % 2 else FaultRates()
        pair = Pair(walk(seed, 8), settings(repeat), seed=seed, rates=rates, mishaps=mishaps, durable_lag=seed % 2)
        pair.run().verify()
        outcomes[pair.outcome] += 1
    assert set(outcomes) == {"completed"}


@BOTH
@pytest.mark.parametrize("block", range(more(2)))
@pytest.mark.slow
def test_restarts_of_the_machine(repeat, block):
    """Interrupted in every run in which the restart hit the program, and never a block twice or out of turn."""
    for seed in range(block * 100, block * 100 + 100):
        random = Random(seed)
        rates = hostile(seed) if seed % 2 else FaultRates()
        mishap = Mishap(random.uniform(0.3, 1.5), "restart")
        boot_s = random.choice((0.05, 0.5, 2.0))
        pair = Pair(walk(seed, 8), settings(repeat, boot_s=boot_s), seed=seed, rates=rates, mishaps=[mishap])
        pair.run().verify()
        if not seed % 2 and pair.now > mishap.at + boot_s:
            assert pair.outcome == "interrupted", seed


@BOTH
def test_after_a_break_too_long_nothing_moves_again_by_itself(repeat):
    for seed in range(60):
        mishap = Mishap(Random(seed).uniform(0.3, 2), "crash", 20.0)
        pair = Pair(walk(seed, 8), settings(repeat), seed=seed, mishaps=[mishap], resume_within_s=10)
        pair.run(until=lambda pair=pair: pair.epochs == 2)
        before = pair.executed
        pair.run(until=lambda pair=pair: any(isinstance(e, LinkReady) for e in pair.events[-3:]))
        assert pair.executed == before
        assert pair.outcome != "interrupted"


def test_the_same_seed_gives_the_same_run():
    def history(seed: int) -> list[str]:
        pair = Pair(walk(seed, 6), settings("reack"), seed=seed, rates=hostile(seed)).run()
        return [repr(event) for event in pair.events]

    assert history(7) == history(7)
