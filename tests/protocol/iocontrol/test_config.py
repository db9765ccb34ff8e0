"""The configuration of a block: what is refused names its key."""

import pytest

from protocol.iocontrol.config import CONNECTION_LOST, KIND_JUMPERS, AbortReason, IoConfig
from protocol.iocontrol.pins import JUMPERS, PINS, S32_MAX, S32_MIN, Pin, checked_input, pins_of


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ({"kind": "automatic"}, "kind"),
        ({"protocol_version": 3}, "protocol_version"),
        ({"protocol_version": 1, "support_start_change": True}, "support_start_change"),
        ({"prepare_timeout_s": -1.0}, "prepare_timeout_s"),
        ({"change_timeout_s": float("nan")}, "change_timeout_s"),
        ({"ack_timeout_s": float("inf")}, "ack_timeout_s"),
        ({"pulse_s": -0.1}, "pulse_s"),
        ({"io_error": "no number"}, "io_error"),
        ({"io_error": "%d and %d"}, "io_error"),
        ({"io_error": "%d %s"}, "io_error"),
        ({"io_error": "100% %d"}, "io_error"),
        ({"jumpers": frozenset({"tool-number"})}, "jumpers"),
        ({"kind": "external", "always_ask": True}, "always_ask"),
    ],
)
def test_what_is_refused_names_its_key(values: dict[str, object], text: str) -> None:
    with pytest.raises(ValueError, match=f"^{text}: "):
        IoConfig(**values)  # type: ignore[arg-type]


def test_the_template_takes_one_number_and_percent_signs() -> None:
    assert IoConfig(io_error="%%d 50%% %d").io_error % -3 == "%d 50% -3"
    assert IoConfig().io_error % -3 == "toolchanger error -3"


def test_what_is_wired() -> None:
    assert IoConfig(kind="external").wired == frozenset()
    assert IoConfig(kind="external", jumpers=frozenset({"emc-abort-ack"})).wired == {Pin.EMC_ABORT_ACK}
    assert frozenset(JUMPERS) - IoConfig(kind="manual").wired == {Pin.TOOL_CHANGED}
    assert IoConfig(kind="loopback").wired == frozenset(JUMPERS)
    assert set(KIND_JUMPERS) == {"manual", "external", "loopback", "none"}


def test_the_reasons_are_those_of_the_source() -> None:
    assert [int(reason) for reason in AbortReason] == [1, 2, 3, 4, 5, 6, 7, 8, 100, 101]


def test_the_pins_are_those_of_the_source() -> None:
    assert set(PINS) == set(Pin)
    assert len(pins_of(2)) == 24
    assert {pin for pin, spec in PINS.items() if spec.direction == "in"} == {
        "emc-enable-in",
        "tool-prepared",
        "tool-changed",
        "emc-abort-ack",
        "start-change-ack",
        "toolchanger-fault",
        "toolchanger-reason",
        "toolchanger-clear-fault",
    }
    assert {pin for pin, spec in PINS.items() if spec.type == "s32"} == {
        "tool-prep-number",
        "tool-prep-pocket",
        "tool-prep-index",
        "tool-number",
        "emc-reason",
        "toolchanger-reason",
        "state",
    }
    assert all(PINS[i].direction == "in" and PINS[o].direction == "out" for i, o in JUMPERS.items())
    assert S32_MIN < CONNECTION_LOST < S32_MAX


def test_a_value_is_taken_as_it_is() -> None:
    assert checked_input("toolchanger-reason", -(2**31), version=2) == (Pin.TOOLCHANGER_REASON, -(2**31))
    assert checked_input("tool-changed", False, version=1) == (Pin.TOOL_CHANGED, False)
