"""Reading the file and the environment: every fault names its source, key, value and what is allowed."""

from collections.abc import Mapping
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from server.config.file import ConfigError, load, load_section
from server.config.model import Config
from server.config.motion import MotionConfig

MACHINE = '[[machine]]\nname = "mill-1"\nport = "/dev/ttyUSB0"\n'


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "millstream.toml"


def messages(file: Path, text: str, environ: Mapping[str, str] | None = None) -> list[str]:
    file.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError) as caught:
        load(file, environ or {})
    return str(caught.value).replace(str(file), "FILE").splitlines()


def test_no_file_is_the_defaults() -> None:
    assert load(None, {}) == Config()


def test_values_are_read(file: Path) -> None:
    file.write_text(
        '[server]\nport = 9000\nallowed_hosts = ["mill.local"]\n'
        + MACHINE
        + "resume_within = 0\n[machine.elvinto]\ncrc_radix = 16\n[machine.motion]\ntravel = { x = [0, 300] }\n",
        encoding="utf-8",
    )
    config = load(file, {})
    assert config.server.port == 9000
    assert config.server.allowed_hosts == ("mill.local",)
    assert config.machine[0].resume_within == 0
    assert config.machine[0].elvinto.crc_radix == 16
    assert config.machine[0].motion.travel.x == (0.0, 300.0)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "[server]\nport = 70000\n",
            "FILE: server.port = 70000: allowed is a whole number from 0 to 65535",
        ),
        (
            '[server]\nport = "8420"\n',
            'FILE: server.port = "8420": allowed is a whole number from 0 to 65535',
        ),
        (
            '[server]\nlog_level = "loud"\n',
            'FILE: server.log_level = "loud": allowed is "debug" or "info" or "warning" or "error"',
        ),
        (
            MACHINE + "[machine.elvinto]\ncrc_radix = 12\n",
            'FILE: machine[0].elvinto.crc_radix (machine "mill-1") = 12: allowed is 10 or 16',
        ),
        (
            MACHINE + "autoconnect = 1\n",
            'FILE: machine[0].autoconnect (machine "mill-1") = 1: allowed is true or false',
        ),
        (
            MACHINE + "resume_within = nan\n",
            'FILE: machine[0].resume_within (machine "mill-1") = nan: allowed is a number from 0 to 3600',
        ),
        (
            MACHINE + 'protocol = "smoke"\n',
            'FILE: machine[0].protocol (machine "mill-1") = "smoke": allowed is "elvinto" or "grbl" or "ncframe"',
        ),
        (
            MACHINE + "[machine.motion]\nmax_rate = { x = 0 }\n",
            'FILE: machine[0].motion.max_rate.x (machine "mill-1") = 0: allowed is a number above 0 up to 1000000',
        ),
        (
            MACHINE + "[machine.motion]\nsteps_per_mm = { z = 0 }\n",
            'FILE: machine[0].motion.steps_per_mm.z (machine "mill-1") = 0: allowed is a number above 0 up to 1000000',
        ),
        (
            MACHINE + "[machine.motion]\nplanner_blocks = 0\n",
            'FILE: machine[0].motion.planner_blocks (machine "mill-1") = 0: allowed is a whole number from 1 to 10000',
        ),
        (
            MACHINE + "[machine.motion]\ntravel = { x = [3, 1] }\n",
            'FILE: machine[0].motion.travel.x (machine "mill-1") = [3.0, 1.0]: '
            "allowed is [lowest, highest], the lower first",
        ),
        (
            MACHINE + "[machine.motion]\ntravel = { x = [1] }\n",
            'FILE: machine[0].motion.travel.x (machine "mill-1") = [1]: '
            "allowed is [lowest, highest] in mm (degrees), the lower first",
        ),
        (
            '[[machine]]\nname = "a"\n',
            'FILE: machine[0].port (machine "a") = (nothing): allowed is a device ("/dev/ttyUSB0"), '
            '"tcp://host:port" or "sim:" (also with a query, "sim:?speed_factor=20")',
        ),
        (
            MACHINE + '[[machine]]\nname = "mill-1"\nport = "sim:"\n',
            'FILE: machine[1].name (machine "mill-1") = "mill-1": '
            "allowed is a name of its own: machine[0] has this one",
        ),
        ('[machine]\nname = "a"\n', "FILE: machine = {'name': 'a'}: allowed is [[machine]] sections"),
        ("machine = [1]\n", "FILE: machine[0] = 1: allowed is a [[machine]] section"),
    ],
)
def test_a_fault_names_file_key_value_and_what_is_allowed(file: Path, text: str, message: str) -> None:
    assert messages(file, text) == [message]


def test_an_unknown_key_is_told_with_the_likely_one(file: Path) -> None:
    (message,) = messages(file, "[server]\nprot = 8420\n")
    assert message.startswith("FILE: server.prot = 8420: there is no such key (did you mean port?); allowed are host, ")


def test_an_unknown_section_is_a_fault(file: Path) -> None:
    (message,) = messages(file, "[sever]\nport = 8420\n")
    assert "(did you mean server?); allowed are server, " in message


def test_a_wrong_option_of_the_virtual_machine_is_told_in_its_words(file: Path) -> None:
    (message,) = messages(file, '[[machine]]\nname = "a"\nport = "sim:?sped_factor=2"\n')
    assert message.startswith('FILE: machine[0].port (machine "a") = "sim:?sped_factor=2": unknown key \'sped_factor\'')


def test_all_faults_are_told_at_once(file: Path) -> None:
    assert len(messages(file, '[server]\nport = -1\nhost = ""\n' + MACHINE + 'baud = "fast"\n')) == 3


def test_a_long_value_is_shortened(file: Path) -> None:
    (message,) = messages(file, f'[server]\nport = "{"9" * 5000}"\n')
    assert len(message) < 200


def test_a_file_that_is_not_toml_is_told_with_the_line(file: Path) -> None:
    (message,) = messages(file, "[server]\nport = \n")
    assert message.startswith("FILE: is not TOML: ")
    assert "line 2" in message


def test_a_file_that_is_not_text_is_told(file: Path) -> None:
    file.write_bytes(b"[server]\n\xff")
    with pytest.raises(ConfigError, match="is not UTF-8 text"):
        load(file, {})


def test_a_missing_file_is_told(file: Path) -> None:
    with pytest.raises(ConfigError, match="cannot be read: No such file"):
        load(file, {})


def test_a_section_alone(file: Path) -> None:
    file.write_text("acceleration = { y = 500 }\n", encoding="utf-8")
    assert load_section(MotionConfig, file).acceleration.y == 500


def test_a_fault_in_a_section_alone(file: Path) -> None:
    file.write_text("w = {}\n", encoding="utf-8")
    with pytest.raises(
        ConfigError,
        match=r"w = \{\}: there is no such key; allowed are max_rate, acceleration, travel, "
        "steps_per_mm, junction_deviation, arc_tolerance, planner_blocks, laser",
    ):
        load_section(MotionConfig, file)


# --- the environment ---


def test_variables_override_the_file(file: Path) -> None:
    file.write_text("[server]\nport = 9000\n" + MACHINE, encoding="utf-8")
    environ = {
        "MILLSTREAM_SERVER__PORT": "9100",
        "MILLSTREAM_SERVER__HOST": "0.0.0.0",
        "MILLSTREAM_SERVER__LOG_LEVEL": "debug",
        "MILLSTREAM_SERVER__ALLOWED_HOSTS": '["mill.local"]',
        "MILLSTREAM_MACHINE__MILL_1__PORT": "sim:",
        "MILLSTREAM_MACHINE__0__AUTOCONNECT": "false",
        "MILLSTREAM_MACHINE__MILL_1__MOTION__TRAVEL__X": "[0, 300]",
    }
    config = load(file, environ)
    assert (config.server.port, config.server.host, config.server.log_level) == (9100, "0.0.0.0", "debug")
    assert config.server.allowed_hosts == ("mill.local",)
    assert config.machine[0].port == "sim:"
    assert not config.machine[0].autoconnect
    assert config.machine[0].motion.travel.x == (0.0, 300.0)


def test_text_keys_take_text_that_looks_like_a_number() -> None:
    config = load(None, {"MILLSTREAM_MACHINE__0__NAME": "7", "MILLSTREAM_MACHINE__0__PORT": "sim:"})
    assert config.machine[0].name == "7"


def test_variables_without_a_section_are_not_the_configuration() -> None:
    assert load(None, {"MILLSTREAM_URL": "http://x", "MILLSTREAM_TOKEN": "t", "OTHER__KEY": "1"}) == Config()


@pytest.mark.parametrize(
    ("variable", "value", "message"),
    [
        ("SERVER__PORT", "many", 'server.port = "many": allowed is a whole number from 0 to 65535'),
        ("SERVER__PRT", "1", "server.prt = 1: there is no such key (did you mean port?); allowed are host"),
        ("SEVER__PORT", "1", "sever = {'port': 1}: there is no such key (did you mean server?)"),
        ("SERVER__PORT__X", "1", 'server.port.x = "1": not a section'),
        (
            "MACHINE__LATHE__PORT",
            "sim:",
            'machine = "sim:": no such machine; allowed is MILLSTREAM_MACHINE__MILL_1__KEY, MILLSTREAM_MACHINE__1__KEY',
        ),
        ("MACHINE__5__PORT", "sim:", 'machine = "sim:": no such machine'),
        ("MACHINE__MILL_1", "sim:", 'machine = "sim:": no such machine'),
        ("MACHINE__MILL_1__BAUD", "1", 'machine[0].baud (machine "mill-1") = 1: allowed is a whole number from 300'),
    ],
)
def test_a_fault_in_a_variable_names_the_variable(file: Path, variable: str, value: str, message: str) -> None:
    text = "[server]\nport = 8420\n" + MACHINE
    (told,) = messages(file, text, {f"MILLSTREAM_{variable}": value})
    assert told.startswith(f"MILLSTREAM_{variable}: {message}")


@given(st.text(max_size=40), st.sampled_from(["SERVER__PORT", "SERVER__HOST", "MACHINE__0__PORT", "MACHINE__0__X__Y"]))
def test_any_value_of_a_variable_is_taken_or_told(value: str, key: str) -> None:
    variable = f"MILLSTREAM_{key}"
    try:
        load(None, {variable: value})
    except ConfigError as error:
        assert variable in str(error) or "machine[0].name" in str(error)  # noqa: PT017
