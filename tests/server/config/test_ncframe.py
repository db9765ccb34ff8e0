"""server/config/ncframe.py: what is handed on, and what no lathe is like."""

import pytest
from pydantic import ValidationError

from gcode.motion import Motion
from gcode.ncframe.rules import FrameRules
from protocol.ncframe.codec import COUNTS_MOST, Frame
from protocol.ncframe.dialect import Dialect
from server.config.ncframe import TEXT_BYTES_MOST, NcFrameConfig


def test_defaults_are_those_of_the_engine_and_of_the_translation() -> None:
    assert NcFrameConfig().dialect(Motion()) == Dialect()
    assert NcFrameConfig().rules() == FrameRules()


def test_every_key_is_handed_on() -> None:
    config = NcFrameConfig(
        check="xor",
        counter=False,
        ack_timeout=3.0,
        enq_timeout=1.0,
        enq_tries=4,
        gap=0.2,
        max_naks=3,
        poll_interval=0,
        auxiliary_time=1.0,
        resolution=0.01,
        feed_unit=2.0,
        feed_table=(10.0, 20.0),
        speed_unit=10.0,
        diameter_programming=True,
        compensation="offset",
        tool_radius=0.4,
        tools={"3": 0.8},
        systems={"G55": {"z": -40.0}},
        semicolon="remark",
        encoding="gb18030",
        max_batch_blocks=4,
        max_batch_seconds=1.5,
    )
    assert config.dialect(Motion(max_rate={"x": 900.0, "z": 1200.0})) == Dialect(
        "xor", False, 3.0, 1.0, 4, 0.2, 3, 0, 0.01, True, 2.0, (10.0, 20.0), 900.0, 1.0
    )
    assert config.rules() == FrameRules(
        resolution_mm=0.01,
        compensation="offset",
        tool_radius_mm=0.4,
        tools={3: 0.8},
        diameter_programming=True,
        feed_unit_mm_min=2.0,
        feed_table_mm_min=(10.0, 20.0),
        speed_unit_rpm=10.0,
        systems={2: {"z": -40.0}},
        semicolon="remark",
        encoding="gb18030",
    )
    limits = config.limits()
    assert (limits.max_batch_blocks, limits.max_batch_seconds, limits.position_tolerance_mm) == (4, 1.5, None)


def test_a_frame_always_fits_a_batch() -> None:
    low = -COUNTS_MOST - 1
    longest = Frame(g=99, m=99, x=low, z=low, r=low, f=255, s=255, t=255).to_text()
    assert len(longest) <= TEXT_BYTES_MOST
    assert NcFrameConfig(max_batch_blocks=1).limits().longest_block_bytes >= len(longest)


@pytest.mark.parametrize("counter", [True, False])
def test_only_a_machine_that_counts_can_be_asked_afterwards(counter: bool) -> None:
    delivery = NcFrameConfig(counter=counter).delivery()
    assert (delivery.depth, delivery.remembers, delivery.holds, delivery.locates) == (1, counter, True, False)


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("tools", {"256": 0.4}, "a tool number from 0 to 255"),
        ("tools", {"T1": 0.4}, "a tool number"),
        ("systems", {"G53": {"x": 1.0}}, "one of G54"),
        ("systems", {"G54": {"y": 1.0}}, "an axis of the lathe"),
    ],
)
def test_what_no_lathe_has(key: str, value: object, said: str) -> None:
    with pytest.raises(ValidationError, match=said):
        NcFrameConfig.model_validate({key: value})


@pytest.mark.parametrize(
    ("key", "value"),
    [("feed_table", [0.0]), ("feed_table", [1.0] * 257), ("feed_unit", 0), ("resolution", 0), ("check", "crc16")],
)
def test_bounds(key: str, value: object) -> None:
    with pytest.raises(ValidationError):
        NcFrameConfig.model_validate({key: value})
