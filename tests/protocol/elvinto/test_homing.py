"""Which blocks by hand lead an ElVinto machine to its limit switches."""

import pytest

from protocol.elvinto.homing import homing


@pytest.mark.parametrize(
    ("blocks", "ignored", "homed", "behind"),
    [
        (("G28",), False, True, False),
        (("g28",), False, True, False),
        (("G0 X1", "G028"), False, True, False),
        (("G29",), False, True, False),
        (("G28X0Y0",), False, True, False),
        (("G27",), False, False, False),
        (("G28.1",), False, False, False),
        (("G280",), False, False, False),
        (("X1 Y2",), True, False, True),
        (("G28",), True, False, True),
        (("W93", "G28"), False, False, True),
        (("W94", "G28"), True, True, False),
        (("G28", "W93"), False, True, True),
        ((), True, False, True),
    ],
)
def test_what_homes(blocks: tuple[str, ...], ignored: bool, homed: bool, behind: bool) -> None:
    assert homing(blocks, ignored=ignored) == (homed, behind)
