"""Settings that no machine can have are refused by name."""

from typing import Any

import pytest

from sim.elvinto.settings import SimSettings


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("speed_factor", 0.0),
        ("acceleration", -1.0),
        ("state_interval_s", 0.0),
        ("boot_s", -1.0),
        ("alarm_repeat_s", -0.1),
        ("max_message_bytes", 10),
        ("crc_radix", 8),
        ("travel", {"Q": (0.0, 1.0)}),
        ("travel", {"X": (1.0, 0.0)}),
    ],
)
def test_refused(name: str, value: Any) -> None:
    with pytest.raises(ValueError, match=name):
        SimSettings(**{name: value})
