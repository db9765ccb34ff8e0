"""What a Grbl tells of itself in JSON; hostile values make no view fail."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from protocol.events import FirmwareRead, OffsetsRead, ProbeReported
from protocol.grbl.settings import SETTINGS
from server.jsontext import dumps
from server.machine.grblviews import firmware_view, info_warnings, offsets_view, settings_view


def firmware(**changes: object) -> FirmwareRead:
    fields: dict[str, object] = {
        "token": 1,
        "flavour": "grbl",
        "version": "1.1h",
        "build": "20190830",
        "info": "",
        "options": "V",
        "planner_blocks": 15,
        "rx_bytes": 128,
        "axes": (),
        "facts": {},
    }
    return FirmwareRead(**(fields | changes))  # type: ignore[arg-type]


def test_a_usual_build_warns_of_nothing() -> None:
    assert firmware_view("router", firmware())["warnings"] == []


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"options": "VL"}, "not locked at power-up"),
        ({"options": "V*"}, "$RST=*"),
        ({"version": "0.9j"}, "0.9j"),
        ({"version": ""}, "unknown"),
        ({"rx_bytes": 64}, "64 bytes"),
    ],
)
def test_what_differs_from_the_usual_is_warned_of(changes: dict[str, object], words: str) -> None:
    (warning,) = firmware_view("router", firmware(**changes))["warnings"]
    assert words in warning


def test_letters_and_words_that_nobody_knows_are_shown() -> None:
    shown = firmware_view("router", firmware(options="V?", facts={"NEWOPT": "TC,NEW", "HLP": "$$ $#", "BOARD": "x"}))
    assert shown["options"] == [
        {"code": "V", "meaning": "spindle with variable speed"},
        {"code": "?", "meaning": None},
        {"code": "TC", "meaning": "tool change by hand (M6)"},
        {"code": "NEW", "meaning": None},
    ]
    assert (shown["help"], shown["facts"]) == (["$$", "$#"], {"BOARD": "x"})


def test_the_axes_that_grbl_does_not_name_are_three() -> None:
    assert firmware_view("router", firmware())["axes"] == ["x", "y", "z"]
    assert firmware_view("router", firmware(axes=("x", "y", "z", "a")))["axes"] == ["x", "y", "z", "a"]


def test_a_setting_in_no_table_has_number_and_value() -> None:
    (shown,) = settings_view("router", {9999: "auto"}, {})["settings"]
    assert [shown.pop(key) for key in ("number", "value", "bits", "choices")] == [9999, "auto", [], []]
    assert set(shown.values()) == {None}


def test_bits_of_a_value_that_is_no_number_are_not_known() -> None:
    (shown,) = settings_view("router", {2: "many"}, SETTINGS)["settings"]
    assert {bit["on"] for bit in shown["bits"]} == {None}


@given(st.dictionaries(st.integers(0, 400), st.text(max_size=12)))
def test_any_values_make_a_view(values: dict[int, str]) -> None:
    shown = settings_view("router", values, SETTINGS)
    assert [one["number"] for one in json.loads(dumps(shown))["settings"]] == sorted(values)


def test_offsets_and_the_last_probing() -> None:
    read = OffsetsRead(1, {"G54": {"z": 1.00004, "x": 2.0}}, ProbeReported({"x": 1.0}, succeeded=True))
    assert offsets_view("router", read) == {
        "machine": "router",
        "offsets": {"G54": {"x": 2.0, "z": 1.0}},
        "probe": {"position": {"x": 1.0}, "succeeded": True},
    }
    assert offsets_view("router", OffsetsRead(1, {}))["probe"] is None


def test_what_became_of_an_info_text() -> None:
    assert info_warnings("MILL", "MILL") == []
    assert "drops blanks" in info_warnings("my mill", "MYMILL")[0]
    assert "console" in info_warnings("MILL", "OTHER")[0]
