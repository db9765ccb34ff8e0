"""The messages of standard §5 as they are printed."""

import pytest

from sim.elvinto.settings import SimSettings
from sim.elvinto.voice import Voice, number
from tests.harness.elvinto_peer import unframe


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0"),
        (-0.00001, "0"),
        (10.5, "10.5"),
        (-3.25, "-3.25"),
        (100.0, "100"),
        (1 / 3, "0.3333"),
        (1e9, "1000000000"),
    ],
)
def test_numbers(value: float, text: str) -> None:
    assert number(value) == text


def test_messages_go_out_in_order_and_once() -> None:
    voice = Voice(SimSettings())
    voice.received(17)
    voice.ended(17, None)
    voice.ended(18, 3)
    assert unframe(voice.take()) == ["RECEIVED,ID<#17;", "OK,ID<#17;", "ERROR,ID<#18,NUM<#3;"]
    assert voice.take() == b""
    voice.about()
    voice.clear()
    assert voice.take() == b""


def test_state_with_an_alarm() -> None:
    voice = Voice(SimSettings())
    voice.state("cnscalarm", (1, 2, 3, 0, 0, 0), feed=0, speed=0, alarm=(100, None), absolute=False)
    assert unframe(voice.take()) == [
        "STATE,TYPE<#cnscalarm,MX<#1,MY<#2,MZ<#3,MA<#0,MB<#0,MC<#0,FEED<#0,SPEED<#0,ALARMNUM<#100,AXISNUM<#0,ISABS<#N;"
    ]


def test_switches() -> None:
    voice = Voice(SimSettings())
    voice.switches("XZ")
    assert unframe(voice.take()) == ["SWITCHES,START<#XZ,END<#;"]
