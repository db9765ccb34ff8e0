"""jobs/stretch.py: columns say of each block what the block by itself says, however they are cut and put together."""

from itertools import accumulate
from math import inf

from hypothesis import given, settings
from hypothesis import strategies as st

from jobs.barriers import Barrier
from jobs.stretch import Ahead, Stretch, Upcoming

AXES = 2
ALONE = Upcoming(99, "M0", 0.0, 0.0, moves=False, end=(0.0,) * AXES, barrier=Barrier())
COSTS_S = (0.0, 0.0, 0.25, 0.5, 3.0, inf)

upcoming = st.builds(
    Upcoming,
    line=st.integers(1, 4),
    text=st.sampled_from(("X1", "G1X1.5Y2F300", "M8")),
    seconds=st.sampled_from((0.0, 0.25, 7.0)),
    cost_s=st.sampled_from(COSTS_S),
    moves=st.booleans(),
    end=st.tuples(*[st.sampled_from((0.0, 1.5))] * AXES),
    reach_mm=st.sampled_from((0.0, 1.5)),
    part=st.sampled_from((0, 0, 0, 2)),
    io=st.sampled_from(((), (), (("T", 3),), (("M", 8), ("M", 9)))),
)
several = st.lists(upcoming, max_size=6)
quick = settings(derandomize=True, deadline=None, max_examples=75)


def blocks_of(stretch: Stretch) -> list[Upcoming]:
    return [stretch.one(place) for place in range(len(stretch.texts))]


@given(several, several, st.integers(0, 6))
@quick
def test_cut_and_put_together_they_are_the_same_blocks(before: list[Upcoming], after: list[Upcoming], cut: int) -> None:
    first = Stretch.of(before).since(min(cut, len(before)))
    assert blocks_of(first) == before[cut:]
    both = first.then(Stretch.of(after, ALONE))
    assert blocks_of(both) == [*before[cut:], *after]
    assert both.alone is ALONE
    assert list(both.sizes) == [len(block.text) for block in (*before[cut:], *after)]


def one_by_one(blocks: list[Upcoming], most_blocks: int, most_bytes: int, most_s: float) -> int:
    """How many fit, by looking at one after the other."""
    for count, block in enumerate(blocks[:most_blocks]):
        timed = [each.cost_s for each in blocks[: count + 1] if each.cost_s]
        if len("|".join(each.text for each in blocks[: count + 1])) > most_bytes:
            return count
        if block.cost_s and len(timed) > 1 and sum(timed) > most_s:
            return count
    return min(len(blocks), most_blocks)


@given(st.lists(several, max_size=4), st.integers(1, 5), st.integers(12, 40), st.sampled_from((0.25, 1.0)))
@quick
def test_what_fits_is_what_one_by_one_fits(
    pieces: list[list[Upcoming]], most_blocks: int, most_bytes: int, most_s: float
) -> None:
    ahead, waiting = Ahead(), list[Upcoming]()
    for piece in pieces:
        ahead.add(Stretch.of(piece))
        waiting += piece
        assert ahead.left == len(waiting)
        count = ahead.fitting(most_blocks, most_bytes, most_s)
        assert count == one_by_one(waiting, most_blocks, most_bytes, most_s)
        if not count:
            continue
        moving = [place for place, block in enumerate(waiting[:count], 1) if block.moves]
        assert ahead.up_to_motion(count) == max(moving, default=0)
        assert ahead.end(count) == waiting[count - 1].end
        lines = [block.line for block in waiting[:count]]
        follow = lines == list(accumulate([1] * (count - 1), initial=lines[0]))
        assert ahead.lines(count) == (() if follow else tuple(lines))
        ahead.at += count
        del waiting[:count]
