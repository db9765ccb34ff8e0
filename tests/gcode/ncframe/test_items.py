"""The items of a frame as text, and what does not fit."""

import pytest

from gcode.ncframe.items import Items


def test_the_text_has_the_order_of_the_frame() -> None:
    assert Items(t=33, s=7, f=50, r=-4, z=165000, x=40000, m=3, g=0).text() == "G0 M3 X40000 Z165000 R-4 F50 S7 T33"
    assert Items(m=0).text() == "M0"
    assert Items().text() == ""


def test_a_frame_with_a_zero_in_it_is_not_empty() -> None:
    assert not Items()
    assert Items(s=0)
    assert Items(g=0)


@pytest.mark.parametrize(
    ("items", "faults"),
    [
        (Items(g=99, m=99, x=-8388608, z=8388607, r=8388607, f=255, s=0, t=255), ""),
        (Items(g=100, m=-1), "GM"),
        (Items(x=8388608, z=-8388609, r=-8388609), "XZR"),
        (Items(f=256, s=-1, t=256), "FST"),
    ],
)
def test_each_item_that_does_not_fit_is_named(items: Items, faults: str) -> None:
    assert "".join(letter for letter, _ in items.faults()) == faults
    assert all("does not fit" in sentence for _, sentence in items.faults())
