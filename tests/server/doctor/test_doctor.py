"""The doctor as a whole: what it asks whom, what it leaves alone, and the configuration that it prints."""

import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from server.cli.settings import sole_daemon
from server.config.file import ConfigError, ConfigFault
from server.config.model import Config
from server.doctor import doctor as module
from server.doctor import system as doctorsystem
from server.doctor.doctor import Doctor, config_faults
from server.doctor.findings import Finding, Level
from server.doctor.ports import Roots
from sim.elvinto.settings import SimSettings
from sim.grbl.simsettings import SimSettings as GrblSettings
from sim.ncframe.settings import SimSettings as LatheSettings
from tests.server.doctor.test_ask import Script, SimLine

PORT = "tcp://mill:23"


class Lines:
    """Opens lines to one machine, and remembers how."""

    def __init__(self, line: Any) -> None:
        self.line = line
        self.opened: list[tuple[str, int, bool]] = []

    @contextmanager
    def __call__(self, port: str, baud: int, *, dtr: bool) -> Iterator[Any]:
        self.opened.append((port, baud, dtr))
        if isinstance(self.line, OSError):
            raise self.line
        yield self.line


@pytest.fixture(autouse=True)
def _quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctorsystem, "WATCHED_S", 0.0)


def patient(folder: Path, lines: Lines, **options: Any) -> Doctor:
    return Doctor(open_line=lines, roots=Roots(proc=folder, by_id=folder, locks=()), **options)


def config(folder: Path, **machine: Any) -> Config:
    machine = {"name": "mill", "port": PORT, **machine}
    return Config.model_validate({"server": {"data_dir": str(folder), "port": 0}, "machine": [machine]})


def controller(found: Iterator[Finding]) -> list[Finding]:
    return [finding for finding in found if finding.check == "controller"]


def test_a_machine_as_it_is_configured(tmp_path: Path) -> None:
    lines = Lines(SimLine(SimSettings()))
    (found,) = controller(patient(tmp_path, lines).examine(config(tmp_path, dtr=False)))
    assert (found.level, found.machine) == (Level.OK, "mill")
    assert lines.opened == [(PORT, 115200, False)]


def test_a_machine_in_another_dialect_than_it_is_configured(tmp_path: Path) -> None:
    lines = Lines(SimLine(SimSettings(crc_radix=16)))
    (found,) = controller(patient(tmp_path, lines).examine(config(tmp_path)))
    assert found.level is Level.ERROR
    assert found.advice == "Set crc_radix = 16 in [machine.elvinto]."


@pytest.mark.parametrize(
    ("settings", "machine", "level"),
    [
        (GrblSettings(flavour="grblHAL"), {"protocol": "grbl"}, Level.WARNING),
        (LatheSettings(counter=True), {"protocol": "ncframe", "ncframe": {"counter": False}}, Level.WARNING),
        (LatheSettings(counter=False), {"protocol": "ncframe"}, Level.ERROR),
        (SimSettings(), {"elvinto": {"require_header": False}}, Level.WARNING),
        (SimSettings(header_name="CRC"), {"elvinto": {"require_header": False}}, Level.ERROR),
    ],
)
def test_what_works_all_the_same_is_a_warning(
    tmp_path: Path, settings: Any, machine: dict[str, Any], level: Level
) -> None:
    found, *_ = controller(patient(tmp_path, Lines(SimLine(settings))).examine(config(tmp_path, **machine)))
    assert found.level is level
    assert found.advice.startswith("Set ")


def test_the_section_that_is_printed_is_one_that_the_daemon_takes(tmp_path: Path) -> None:
    for settings, protocol in (
        (SimSettings(header_name="CRC", checksum_scope="gcode"), "elvinto"),
        (GrblSettings(flavour="grblHAL"), "grbl"),
    ):
        (found, *_) = controller(patient(tmp_path, Lines(SimLine(settings))).examine_port(PORT, 115200, None))
        read = Config.model_validate(tomllib.loads(found.data["config"]))
        assert (read.machine[0].protocol, read.machine[0].port) == (protocol, PORT)
    assert read.machine[0].grbl.firmware == "grblhal"
    assert not read.machine[0].grbl.resets_on_open


def test_nobody_answers(tmp_path: Path) -> None:
    (found,) = controller(patient(tmp_path, Lines(Script({}, b"\xffhm"))).examine(config(tmp_path, protocol="grbl")))
    assert found.level is Level.ERROR
    assert "Nobody answered" in found.message
    assert found.data["sent"] == ["3f", "3f"]
    assert found.data["heard"] == "\\xffhm"


def test_a_port_that_does_not_open(tmp_path: Path) -> None:
    (found,) = controller(patient(tmp_path, Lines(OSError("no route"))).examine(config(tmp_path)))
    assert found.level is Level.ERROR
    assert "no route" in found.message


@pytest.fixture
def device(monkeypatch: pytest.MonkeyPatch) -> str:
    """A port that counts as a serial device on which nothing is wrong."""
    monkeypatch.setattr(module, "kind_of", lambda _port: "device")
    monkeypatch.setattr(module, "look", lambda _port, _roots: iter(()))
    return "/dev/ttyUSB0"


def test_no_serial_port_is_opened_unasked(tmp_path: Path, device: str) -> None:
    lines = Lines(SimLine(GrblSettings()))
    grbl = {"port": device, "protocol": "grbl"}
    (found,) = controller(patient(tmp_path, lines).examine(config(tmp_path, **grbl)))
    assert (found.level, lines.opened) == (Level.INFO, [])
    assert "--allow-reset" in found.advice
    (found,) = controller(patient(tmp_path, lines).examine_port(device, 115200, None))
    assert (found.level, lines.opened) == (Level.INFO, [])
    (found,) = controller(patient(tmp_path, lines, allow_reset=True).examine(config(tmp_path, **grbl)))
    assert found.level in (Level.OK, Level.ERROR)
    assert lines.opened == [(device, 115200, True)]


def test_a_board_that_is_known_not_to_restart_is_asked(tmp_path: Path, device: str) -> None:
    lines = Lines(SimLine(GrblSettings()))
    grbl = {"port": device, "protocol": "grbl", "grbl": {"resets_on_open": False}}
    (found,) = controller(patient(tmp_path, lines).examine(config(tmp_path, **grbl)))
    assert (found.level, len(lines.opened)) == (Level.OK, 1)


def test_a_machine_of_a_daemon_that_runs_is_left_alone(tmp_path: Path) -> None:
    lines = Lines(SimLine(SimSettings()))
    with sole_daemon(config(tmp_path)):
        (found,) = controller(patient(tmp_path, lines).examine(config(tmp_path)))
    assert (found.level, lines.opened) == (Level.INFO, [])


def test_a_port_with_an_error_is_not_opened(tmp_path: Path) -> None:
    lines = Lines(SimLine(SimSettings()))
    found = list(patient(tmp_path, lines).examine(config(tmp_path, port="/dev/ttyNOTHERE")))
    assert lines.opened == []
    assert any(one.check == "port" and one.level is Level.ERROR and one.machine == "mill" for one in found)


def test_a_virtual_machine_needs_no_port(tmp_path: Path) -> None:
    found = list(patient(tmp_path, Lines(None)).examine(config(tmp_path, port="sim:")))
    assert not [one for one in found if one.level is Level.ERROR]


def test_faults_of_the_configuration_are_findings() -> None:
    fault = ConfigFault("millstream.toml", "server.port", "70000", "allowed is a number")
    (found,) = config_faults(ConfigError("x", [fault]))
    assert (found.level, found.advice) == (Level.ERROR, "allowed is a number")
    (found,) = config_faults(ConfigError("millstream.toml: is not TOML"))
    assert found.message == "millstream.toml: is not TOML"
