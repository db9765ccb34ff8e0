"""The memory of what the machine was told."""

from gcode.ncframe.items import Items
from gcode.ncframe.writer import DWELL_G, Memory


def test_only_what_is_new_goes_out() -> None:
    memory = Memory()
    assert memory.items(g=1, x=5, f=9, s=2, t=3) == Items(g=1, x=5, f=9, s=2, t=3)
    assert memory.items(g=1, x=5, z=0, f=9, s=2, t=3, m=8, r=4) == Items(x=5, m=8, r=4)
    assert memory.items(g=0, f=10) == Items(g=0, f=10)
    assert memory.items() == Items()


def test_what_is_not_named_stays_known() -> None:
    memory = Memory()
    memory.items(g=1, f=9, s=2, t=3)
    memory.items(m=8)
    assert memory.items(g=1, f=9, s=2, t=3) == Items()


def test_a_dwell_is_sent_each_time_and_the_motion_behind_it_anew() -> None:
    memory = Memory()
    memory.items(g=1)
    assert memory.items(g=DWELL_G, x=1500) == Items(g=4, x=1500)
    assert memory.items(g=DWELL_G, x=1500) == Items(g=4, x=1500)
    assert memory.items(g=1) == Items(g=1)


def test_forgetting_may_leave_the_tool() -> None:
    memory = Memory()
    memory.items(g=1, f=9, s=2, t=3)
    memory.forget(tool=False)
    assert memory.items(g=1, f=9, s=2, t=3) == Items(g=1, f=9, s=2)
    memory.forget()
    assert memory.items(t=3) == Items(t=3)
