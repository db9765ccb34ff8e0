"""The magazine: no tool is lost or doubled."""

from hypothesis import given
from hypothesis import strategies as st

from sim.changer.magazine import Magazine

POCKETS = {1: 1, 2: 5, 3: 7}


def test_a_tool_goes_back_to_its_own_pocket() -> None:
    magazine = Magazine(POCKETS, 0, random=False)
    assert magazine.load(2, 5)
    assert (magazine.spindle, magazine.pockets) == (5, {1: 1, 3: 7})
    assert magazine.load(3, 7)
    assert (magazine.spindle, magazine.pockets) == (7, {1: 1, 2: 5})
    assert magazine.load(0, 0)
    assert (magazine.spindle, magazine.pockets) == (0, POCKETS)


def test_a_tool_put_in_by_hand_gets_the_first_free_pocket() -> None:
    magazine = Magazine(POCKETS, 9, random=False)
    assert magazine.load(2, 5)
    assert magazine.pockets == {1: 1, 2: 9, 3: 7}


def test_in_a_random_changer_two_tools_change_places() -> None:
    magazine = Magazine({**POCKETS, 4: 0}, 9, random=True)
    assert magazine.load(2, 5)
    assert (magazine.spindle, magazine.pockets) == (5, {1: 1, 2: 9, 3: 7, 4: 0})
    assert magazine.load(4, 0)
    assert (magazine.spindle, magazine.pockets) == (0, {1: 1, 2: 9, 3: 7, 4: 5})


def test_what_is_not_there_is_not_loaded() -> None:
    for random in (False, True):
        magazine = Magazine(POCKETS, 9, random=random)
        assert not magazine.load(1, 5)
        assert not magazine.load(8, 5)
        assert (magazine.spindle, magazine.pockets) == (9, POCKETS)
        assert magazine.load(0, 9)
    assert not Magazine(POCKETS, 9, random=True).holds(4, 0)
    assert Magazine(POCKETS, 9, random=False).holds(0, 0)


@given(st.lists(st.tuples(st.integers(0, 5), st.integers(0, 9)), max_size=20), st.booleans())
def test_no_tool_is_lost_or_doubled(loads: list[tuple[int, int]], random: bool) -> None:
    magazine = Magazine(POCKETS, 9, random=random)
    for pocket, tool in loads:
        magazine.load(pocket, tool)
        tools = sorted(tool for tool in (*magazine.pockets.values(), magazine.spindle) if tool)
        assert tools == [1, 5, 7, 9]
