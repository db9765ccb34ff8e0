"""The profiles: what the standard's table says is what the file says."""

from importlib import resources
from pathlib import Path

import pytest

from gcode.profile import ProfileError, load_profile, parse_profile, profile_names
from tests.harness.programs import elvinto

# elvinto §6, row by row.
EXIST = "G0 G1 G2 G3 G21 G40 G80 G81 G83 G81.99 G83.99 G90 G91 G92 G100 G101 G300 M3 M5 M6 M30 M99 M200 M201 M210"
OWN = "W70 W71 W72 W73 W90 W91 W93 W94 W95 W96 W97 W98"
IGNORED = "G17 G18 G19 G41 G42 G54 M1 M76 M77"
DIFFER = "G27 G28 G29 G75 G76 M4 M7 M8"
ABSENT = "G20 G4 G43 G49 G53 G55 G64 G94 M0 M2 M9"
BARRIERS = "M30 M99 M6 M0 M1 M2 G28 G29 G27 G92 M200 M210 " + OWN


def test_the_table_of_the_standard() -> None:
    codes = elvinto().codes
    for name in f"{EXIST} {OWN}".split():
        assert codes[name].status == "exists", name
    for name in IGNORED.split():
        assert codes[name].status == "ignored", name
    for name in DIFFER.split():
        assert codes[name].status == "differs", name
    for name in ABSENT.split():
        assert name not in codes or codes[name].status == "missing", name
    listed = set(f"{EXIST} {OWN} {IGNORED} {DIFFER} {ABSENT}".split())
    assert set(codes) <= listed


def test_barriers_of_the_standard() -> None:
    profile = elvinto()
    assert all(profile.codes[name].barrier for name in BARRIERS.split())
    assert {"T", "W"} <= profile.barrier_letters
    assert not any(profile.codes[name].barrier for name in ["G0", "G1", "G2", "G3", "G90", "G91", "M3", "M5", "M8"])


def test_every_remark_says_something() -> None:
    for code in elvinto().codes.values():
        assert code.status == "exists" or code.text, code.name


def test_shipped_profiles_load() -> None:
    assert "elvinto" in profile_names()
    for name in profile_names():
        assert load_profile(name).name == name


@pytest.mark.parametrize("name", ["grbl-9", "../profile", "", "elvinto.toml", "ELVINTO"])
def test_no_such_profile(name: str) -> None:
    with pytest.raises(ProfileError, match="elvinto"):
        load_profile(name)


def test_a_wrong_effect_is_refused() -> None:
    table = {
        "name": "x",
        "title": "X",
        "axes": ["x"],
        "arc_planes": [],
        "max_block_bytes": 80,
        "letters": {"accepted": ["X"], "codes": ["G"], "barrier": [], "ignored": {}},
        "codes": {"G1": {"effect": "teleport"}},
    }
    with pytest.raises(ProfileError, match="teleport"):
        parse_profile(table)
    table["codes"] = {"G1": {"effect": "feed"}}
    assert parse_profile(table).codes["G1"].effect == "feed"


# --- the other controllers ------------------------------------------------------------------------------------------

GRBL = (
    "G0 G1 G2 G3 G4 G10 G17 G18 G19 G20 G21 G28 G28.1 G30 G30.1 G38.2 G38.3 G38.4 G38.5 G40 G43.1 G49 G53 G54 G55 G56 "
    "G57 G58 G59 G61 G80 G90 G91 G91.1 G92 G92.1 G93 G94 M0 M1 M2 M3 M4 M5 M7 M8 M9 M30 M56"
)
"""grbl II.10."""

MORE_IN_GRBLHAL = (
    "G5 G5.1 G33 G43 G50 G51 G65 G73 G76 G81 G82 G83 G85 G86 G89 G95 G96 G97 G98 G99 G59.1 G59.2 G59.3 M6 M61"
)
MORE_IN_GRBLHAL += " M62 M63 M64 M65 M66 M67 M68 M70 M71 M72 M73 M99"


def test_the_five_profiles() -> None:
    assert profile_names() == ["elvinto", "grbl-1.1", "grblhal", "ncframe-lathe", "rs274ngc"]
    assert {name: load_profile(name).max_block_bytes for name in profile_names()} == {
        "elvinto": 512,
        "grbl-1.1": 79,
        "grblhal": 255,
        "ncframe-lathe": 255,
        "rs274ngc": 255,
    }


def test_codes_of_grbl() -> None:
    assert set(load_profile("grbl-1.1").codes) == set(GRBL.split())
    assert set(load_profile("grblhal").codes) >= set(f"{GRBL} {MORE_IN_GRBLHAL}".split())
    assert set(load_profile("rs274ngc").codes) >= set(GRBL.split()) - {"M56"}


def test_bytes_that_act_at_once() -> None:
    realtime = load_profile("grbl-1.1").realtime
    assert {0x18, *b"?!~", 0x84, 0xF0} <= realtime
    assert not realtime & set(b"GXYZ0123456789.-()% ")
    assert load_profile("elvinto").realtime == frozenset()


def test_every_letter_that_a_code_wants_is_accepted() -> None:
    for name in profile_names():
        profile = load_profile(name)
        assert {axis.upper() for axis in profile.axes} <= profile.letters
        assert not profile.letters & profile.code_letters
        assert set(profile.ranges) <= profile.letters | profile.code_letters
        assert all(code[0] in profile.code_letters for code in profile.codes)


def test_profiles_of_the_user_come_first(tmp_path: Path) -> None:
    source = (resources.files("gcode") / "profiles" / "grbl-1.1.toml").read_text(encoding="utf-8")
    (tmp_path / "mine.toml").write_text(source.replace('"Grbl 1.1"', '"My own"'), encoding="utf-8")
    (tmp_path / "elvinto.toml").write_text(source.replace('"Grbl 1.1"', '"Another"'), encoding="utf-8")
    assert load_profile("mine", tmp_path).title == "My own"
    assert load_profile("elvinto", tmp_path).title == "Another"
    assert load_profile("elvinto").title != "Another"
    assert load_profile("rs274ngc", tmp_path).name == "rs274ngc"
    assert "mine" in profile_names(tmp_path)
    with pytest.raises(ProfileError, match="mine"):
        load_profile("yours", tmp_path)


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ('"strict_words"', '"telepathy"'),
        ("[letters]", "[letter]"),
        ("plane = 17", 'plane = "G17"'),
        ("plane = 17", "speed_of_light = 17"),
        ('sets = "plane_xy"', 'sets = "sideways"'),
        ('sync = "always"', 'sync = "sometimes"'),
        ('effect = "rapid"', "effect = 7"),
        ("F = [0.0, 1000000000.0]", "F = [0.0]"),
        ('name = "grbl-1.1"', "\x00"),
    ],
)
def test_a_wrong_file_says_so(before: str, after: str, tmp_path: Path) -> None:
    source = (resources.files("gcode") / "profiles" / "grbl-1.1.toml").read_text(encoding="utf-8")
    assert before in source
    (tmp_path / "wrong.toml").write_text(source.replace(before, after), encoding="utf-8")
    with pytest.raises(ProfileError, match="wrong"):
        load_profile("wrong", tmp_path)
