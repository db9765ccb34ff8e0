"""The tables of codes, settings and real-time bytes against the sheet (grbl II.2, II.8 to II.10)."""

import pytest

from protocol.grbl import codes, realtime
from protocol.grbl.settings import SETTINGS, described, known, of_grblhal
from protocol.setting import SettingDescription

GRBL_ERRORS = {*range(1, 18), *range(20, 39)}
GRBLHAL_ERRORS = {18, 19, *range(39, 59), *range(60, 67), 70, *range(71, 77), 77, 78, 79, *range(80, 93), 253}
GRBL_SETTINGS = {
    *range(7), 10, 11, 12, 13, *range(20, 28), 30, 31, 32, *range(100, 103), *range(110, 113), *range(120, 123),
    *range(130, 133),
}  # fmt: skip


def test_every_error_of_the_sheet_has_a_meaning_and_a_remedy() -> None:
    assert set(codes.ERRORS) == GRBL_ERRORS | GRBLHAL_ERRORS
    assert all(code.meaning and code.remedy for code in codes.ERRORS.values())


def test_every_alarm_of_the_sheet() -> None:
    assert set(codes.ALARMS) == set(range(1, 23))
    assert {n for n in range(1, 11) if codes.ALARMS[n].needs_reset} == {1, 2}
    assert {n for n in range(1, 11) if codes.ALARMS[n].position_lost} == {1, 3, 6, 7, 8, 9, 10}


def test_what_is_shown_of_a_code() -> None:
    assert codes.error(22) == "no feed rate was given; put an F word in or before the block"
    assert codes.error(199) == "error 199, which is not in our tables"
    assert codes.error(None, "Bad number") == "Bad number"
    assert "second switch" in codes.alarm(10).meaning
    assert codes.alarm(10, grblhal=True).meaning == "emergency stop"
    assert "99" in codes.alarm(99).meaning
    assert codes.alarm(99).position_lost
    assert "no number" in codes.alarm(None).meaning


def test_every_setting_of_grbl() -> None:
    assert {number for number, setting in SETTINGS.items() if not setting.grblhal} == GRBL_SETTINGS
    assert all(setting.name and setting.meaning for setting in SETTINGS.values())


@pytest.mark.parametrize(
    ("number", "value", "good"),
    [
        (0, "10", True),
        (0, "5.0", True),
        (0, "1", False),
        (0, "ten", False),
        (0, "1e3", False),
        (1, "255", True),
        (1, "25.5", False),
        (13, "1", True),
        (13, "2", False),
        (10, "511", True),
        (11, "-1", False),
        (58, "-5", True),
        (102, "250.000", True),
        (130, ".5", True),
    ],
)
def test_values_that_a_controller_would_refuse(number: int, value: str, good: bool) -> None:
    assert (SETTINGS[number].valid(value) is None) is good


@pytest.mark.parametrize(
    ("number", "value", "grbl", "grblhal"),
    [
        (0, "2", False, True),
        (5, "7", False, True),
        (22, "3", False, True),
        (32, "2", False, True),
        (10, "3", True, True),
    ],
)
def test_what_grbl_takes_otherwise_than_grblhal(number: int, value: str, grbl: bool, grblhal: bool) -> None:
    for hal, good in ((False, grbl), (True, grblhal)):
        setting = known(number, grblhal=hal)
        assert setting is not None
        assert (setting.valid(value) is None) is good


def test_a_grblhal_is_known_by_its_settings() -> None:
    assert not of_grblhal(GRBL_SETTINGS)
    assert of_grblhal({*GRBL_SETTINGS, 39})
    assert known(9999, grblhal=True) is None
    assert list(getattr(known(10, grblhal=False), "bits", ())) == ["machine position", "buffer state"]


@pytest.mark.parametrize(
    ("datatype", "form", "minimum", "maximum", "value", "wrong"),
    [
        (0, "", None, None, "2", "Thing goes from 0 to 1 s"),
        (1, "one,two", None, None, "256", "Thing goes from 0 to 255 s"),
        (3, "none, one ,two", None, None, "3", "Thing goes from 0 to 2 s"),
        (4, "axes", None, None, "-1", "Thing goes from 0 to 511 s"),
        (5, "##0", 2.0, 9.0, "10", "Thing goes from 2 to 9 s"),
        (5, "##0", None, None, "1.5", "Thing is a whole number"),
        (6, "#0.0", None, 9.0, "-5.5", None),
        (6, "#0.0", 0.0, None, "-5.5", "Thing goes from 0 to inf s"),
        (7, "", 1.0, 3.0, "my host", None),
        (None, "", None, None, "anything", None),
    ],
)
def test_a_setting_as_a_grblhal_describes_it(
    datatype: int | None, form: str, minimum: float | None, maximum: float | None, value: str, wrong: str | None
) -> None:
    said = SettingDescription(999, "Thing", "s", datatype, form, minimum, maximum, reboot=False)
    assert described(said).valid(value) == wrong
    assert described(said).choices == (("none", "one", "two") if datatype == 3 else ())
    assert described(said).bits[:2] == {1: ("one", "two"), 4: ("X", "Y")}.get(datatype or 0, ())


def test_a_bad_value_is_told_with_the_range() -> None:
    assert SETTINGS[13].valid("2") == "report inches goes from 0 to 1"
    assert SETTINGS[27].valid("-1") == "homing pull-off goes from 0 to inf mm"


def test_text_settings_take_anything() -> None:
    from dataclasses import replace

    assert replace(SETTINGS[0], kind="text").valid("my mill") is None


def test_every_real_time_byte_of_the_sheet() -> None:
    grbl = {byte[0] for byte, entry in realtime.REALTIME.items() if not entry.grblhal}
    assert grbl == {
        0x18, *b"?~!", 0x84, 0x85, 0x86, *range(0x90, 0x98), *range(0x99, 0x9F), 0xA0, 0xA1
    }  # fmt: skip
    for table in (realtime.OVERRIDES, realtime.COOLANTS, realtime.OPTIONS):
        assert set(table.values()) <= set(realtime.REALTIME)


def test_bytes_that_may_not_stand_in_a_line() -> None:
    assert [chr(byte) for byte in range(0x20, 0x7F) if realtime.acts_anywhere(byte)] == ["!", "?", "~"]
    assert all(realtime.acts_anywhere(byte) for byte in (*range(0x20), *range(0x7F, 0x100)))
    assert all(realtime.acts_anywhere(byte[0]) for byte in realtime.REALTIME)
    assert any(realtime.acts_anywhere(byte) for byte in "„".encode())  # II.1: it holds 0x9E, spindle stop
