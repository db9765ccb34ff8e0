"""The profiles: what the standard's table says is what the file says."""

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
        "rotary_axes": [],
        "arc_planes": [],
        "max_block_bytes": 80,
        "letters": {"accepted": ["X"], "codes": ["G"], "barrier": [], "ignored": {}},
        "codes": {"G1": {"effect": "teleport"}},
    }
    with pytest.raises(ProfileError, match="teleport"):
        parse_profile(table)
    table["codes"] = {"G1": {"effect": "feed"}}
    assert parse_profile(table).codes["G1"].effect == "feed"
