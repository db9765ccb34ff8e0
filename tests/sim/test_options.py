"""`sim:?...` as settings."""

import dataclasses
from pathlib import Path

import pytest

from sim.elvinto.settings import SimSettings
from sim.faults import FaultRates
from sim.grbl.simsettings import SimSettings as GrblSettings
from sim.ncframe.settings import SimSettings as LatheSettings
from sim.options import (
    EXECUTED_LIMIT,
    GRBL_KEYS,
    KEYS,
    LATHE_KEYS,
    READERS,
    grbl_options_from_query,
    lathe_options_from_query,
    options_from_query,
    settings_from_query,
)


@pytest.mark.parametrize("query", ["", "sim:", "sim:?", "?"])
def test_nothing_said_is_the_machine_of_the_documents(query: str) -> None:
    assert settings_from_query(query) == dataclasses.replace(SimSettings(), executed_limit=EXECUTED_LIMIT)


def test_every_kind_of_key() -> None:
    options = options_from_query(
        "sim:?speed_factor=20&repeat=reack&instant=true&crc_radix=16&executed_limit=0&travel_x=-5:12.5"
        "&loss=0.01&noise_bytes=3&seed=7&baud=115200&sd=none"
    )
    settings = options.settings
    assert (settings.speed_factor, settings.repeat, settings.instant, settings.crc_radix) == (20.0, "reack", True, 16)
    assert settings.executed_limit == 0
    assert settings.travel["X"] == (-5.0, 12.5)
    assert settings.travel["Y"] == SimSettings().travel["Y"]
    assert settings.sd_files is None
    assert options.faults == FaultRates(loss=0.01, noise_bytes=3)
    assert (options.seed, options.baud) == (7, 115200)


def test_no_faults_said_is_no_faults() -> None:
    assert options_from_query("seed=1").faults is None


def test_a_folder_as_the_card(tmp_path: Path) -> None:
    (tmp_path / "part.nc").write_bytes(b"G0X1\n")
    (tmp_path / "folder").mkdir()
    assert settings_from_query(f"sd={tmp_path}").sd_files == {"part.nc": b"G0X1\n"}
    with pytest.raises(OSError, match="nowhere"):
        settings_from_query(f"sd={tmp_path}/nowhere")


@pytest.mark.parametrize(
    ("query", "said"),
    [
        ("speed=2", "speed_factor"),
        ("speed_factor=fast", "speed_factor must be a number"),
        ("crc_radix=1.5", "without a fraction"),
        ("repeat=loud", "silent, reack"),
        ("instant=maybe", "true or false"),
        ("travel_x=5", "LOW:HIGH"),
        ("speed_factor=0", "more than 0"),
        ("loss=2", "chance"),
        ("nonsense", "bad query field"),
        ("sd_files=x", "unknown key"),
    ],
)
def test_wrong_queries_say_what_is_allowed(query: str, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        options_from_query(query)


def test_the_keys_are_the_fields() -> None:
    plain = {field.name for field in dataclasses.fields(SimSettings)} - {"travel", "start_position", "sd_files"}
    assert plain < KEYS
    assert {"travel_x", "travel_c", "loss", "seed", "baud", "sd"} < KEYS


# Grbl.


def test_nothing_said_is_an_uno() -> None:
    assert grbl_options_from_query("sim:").settings == GrblSettings(executed_limit=EXECUTED_LIMIT)


def test_every_kind_of_key_of_grbl() -> None:
    options = grbl_options_from_query(
        "sim:?flavour=grblHAL&rx_bytes=64&travel_z=90&start_x=-1.5&start_z=-2&probe_z=-60&set_110=8000&set_22=1&baud=115200"
    )
    settings = options.settings
    assert (settings.flavour, settings.rx_bytes, settings.probe_z) == ("grblHAL", 64, -60.0)
    assert settings.travel == {"X": 200.0, "Y": 200.0, "Z": 90.0}
    assert settings.start_position == (-1.5, -50.0, -2.0)
    assert settings.dollar == {110: 8000.0, 22: 1.0}
    assert options.baud == 115200
    assert grbl_options_from_query("probe_z=none").settings.probe_z is None


def test_the_card_of_a_grblhal_is_a_folder(tmp_path: Path) -> None:
    (tmp_path / "a.nc").write_bytes(b"G1X1 (\xc4)\n")
    assert grbl_options_from_query(f"flavour=grblHAL&sd={tmp_path}").settings.card == {"a.nc": "G1X1 (\xc4)\n"}
    assert grbl_options_from_query("sd=none").settings.card is None
    with pytest.raises(OSError, match="nothing"):
        grbl_options_from_query(f"sd={tmp_path / 'nothing'}")


@pytest.mark.parametrize(
    ("query", "said"),
    [
        ("flavour=0.9", "1.1h, grblHAL"),
        ("repeat=reack", "unknown key 'repeat'.*set_N"),
        ("set_x=1", "set_110"),
        ("set_999=1", "no setting"),
        ("set_110=fast", "must be a number"),
        ("travel_x=0", "more than 0"),
        ("rx_bytes=3", "at least 16"),
        ("planner_blocks=1", "at least 2"),
        ("speed_factor=0", "more than 0"),
        ("line_s=-1", "not be negative"),
        ("start_w=1", "unknown key"),
    ],
)
def test_wrong_queries_of_grbl_say_what_is_allowed(query: str, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        grbl_options_from_query(query)


def test_the_keys_of_grbl_are_the_fields() -> None:
    special = {"travel", "start_position", "probe_z", "dollar", "card"}
    plain = {field.name for field in dataclasses.fields(GrblSettings)} - special
    assert plain < GRBL_KEYS
    assert {"travel_x", "start_z", "probe_z", "set_N", "loss", "seed", "baud"} < GRBL_KEYS


# NC frames.


def test_nothing_said_is_the_lathe_of_the_documents() -> None:
    assert READERS["ncframe"]("sim:").settings == LatheSettings(executed_limit=EXECUTED_LIMIT)


def test_every_kind_of_key_of_the_lathe() -> None:
    options = lathe_options_from_query("sim:?check=xor&counter=false&framing=gap&start_count=7&gap_s=0.01&loss=0.1")
    settings = options.settings
    assert (settings.check, settings.counter, settings.framing, settings.start_count) == ("xor", False, "gap", 7)
    assert options.faults == FaultRates(loss=0.1)


@pytest.mark.parametrize(
    ("query", "said"),
    [
        ("check=crc16", "none, xor, crc8"),
        ("counter=maybe", "true or false"),
        ("framing=none", "length, gap"),
        ("start_count=1.5", "without a fraction"),
        ("repeat=reack", "unknown key"),
        ("rx_bytes=3", "at least 16"),
    ],
)
def test_wrong_queries_of_the_lathe_say_what_is_allowed(query: str, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        lathe_options_from_query(query)


def test_the_keys_of_the_lathe_are_the_fields() -> None:
    assert {field.name for field in dataclasses.fields(LatheSettings)} < LATHE_KEYS
    assert {"loss", "seed", "baud"} < LATHE_KEYS
