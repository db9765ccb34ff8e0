"""The model: defaults, strictness, and that the example file and the core's own defaults say the same."""

import re
import tomllib
from pathlib import Path
from typing import Any

import pytest
from pydantic import BaseModel, ValidationError

from gcode.motion import Motion
from jobs.batch import BatchLimits
from protocol.elvinto.dialect import Dialect
from protocol.grbl.dialect import Dialect as GrblDialect
from server.config.elvinto import ElvintoConfig
from server.config.grbl import GrblConfig
from server.config.model import PROTOCOLS, Config, MachineConfig, ServerConfig
from server.config.motion import MotionConfig
from server.config.ncframe import NcFrameConfig
from server.config.reentry import ReentryConfig
from server.config.telemetry import MqttConfig, WebhookConfig

EXAMPLE = Path(__file__).parents[3] / "config.example.toml"


def missing_keys(model: BaseModel, data: dict[str, Any], where: str = "") -> list[str]:
    missing = []
    for name in type(model).model_fields:
        value = getattr(model, name)
        if name not in data:
            missing.append(f"{where}{name}")
        elif isinstance(value, BaseModel):
            missing += missing_keys(value, data[name], f"{where}{name}.")
        elif isinstance(value, tuple) and value and isinstance(value[0], BaseModel):
            missing += missing_keys(value[0], data[name][0], f"{where}{name}[0].")
    return missing


def test_example_is_the_defaults() -> None:
    config = Config.model_validate(tomllib.loads(EXAMPLE.read_text(encoding="utf-8")))
    assert config == Config(
        server=ServerConfig(), machine=(MachineConfig(name="router", port="/dev/ttyUSB0", protocol="elvinto"),)
    )


def test_example_has_every_key() -> None:
    data = tomllib.loads(EXAMPLE.read_text(encoding="utf-8"))
    data["machine"][0]["grbl"] = GrblConfig().model_dump()  # of another protocol: the next test
    data["machine"][0]["reentry"] = ReentryConfig().model_dump()  # likewise
    data["machine"][0]["ncframe"] = NcFrameConfig().model_dump()  # likewise
    missing = missing_keys(Config.model_validate(tomllib.loads(EXAMPLE.read_text(encoding="utf-8"))), data)
    commented = ["motion.travel", "motion.steps_per_mm", "toolchanger.start_in_estop"]
    of_broker = ["ca_file", "username", "password", "password_file"]
    wanted = [*(f"machine[0].{key}" for key in commented), *(f"mqtt.{key}" for key in of_broker), "webhook"]
    assert missing == wanted


def test_example_shows_a_webhook_and_the_access_to_a_broker_that_load_when_uncommented() -> None:
    text = EXAMPLE.read_text(encoding="utf-8")
    lines = text.split("# [[webhook]]")[1].split("\n\n")[0].splitlines()
    data = tomllib.loads("\n".join(line.removeprefix("# ").removeprefix("# ").removeprefix("#") for line in lines))
    assert set(data) == set(WebhookConfig.model_fields) - {"secret"}
    WebhookConfig.model_validate(data)
    broker = re.findall(r"^# ((?:ca_file|username|password_file) = .*)$", text, re.MULTILINE)
    assert MqttConfig.model_validate(tomllib.loads("\n".join(broker))).username == "millstream"


def test_example_shows_a_grbl_machine_that_loads_when_uncommented() -> None:
    example = EXAMPLE.read_text(encoding="utf-8").split('# Take the "#" away:')[1].split("# A lathe behind")[0]
    data = tomllib.loads("\n".join(line.removeprefix("#").strip() for line in example.splitlines()))
    config = Config.model_validate(data)
    assert config.machine == (MachineConfig(name="mill", protocol="grbl", port="/dev/ttyACM0"),)
    assert set(data["machine"][0]["grbl"]) == set(GrblConfig.model_fields)
    assert set(data["machine"][0]["reentry"]) == set(ReentryConfig.model_fields) - {"clearance"}
    (clearance,) = re.findall(r"^# # (clearance = .*)$", EXAMPLE.read_text(encoding="utf-8"), re.MULTILINE)
    assert ReentryConfig.model_validate(tomllib.loads(clearance)).clearance == 20.0
    assert GrblConfig().dialect() == GrblDialect()
    assert GrblConfig(firmware="grblhal").dialect() == GrblDialect(line_chars=255)


def test_example_shows_a_lathe_that_loads_when_uncommented() -> None:
    example = EXAMPLE.read_text(encoding="utf-8").split('# Take the "#" away:')[2]
    data = tomllib.loads("\n".join(line.removeprefix("#").strip() for line in example.splitlines()))
    config = Config.model_validate(data)
    assert config.machine == (MachineConfig(name="lathe", protocol="ncframe", port="/dev/ttyUSB2", baud=9600),)
    assert set(data["machine"][0]["ncframe"]) == set(NcFrameConfig.model_fields) - {"speed_unit", "tool_radius"}
    optional = re.findall(r"^# # ((?:speed_unit|tool_radius) = .*)$", EXAMPLE.read_text(encoding="utf-8"), re.MULTILINE)
    filled = NcFrameConfig.model_validate(tomllib.loads("\n".join(optional)))
    assert (filled.speed_unit, filled.tool_radius) == (10.0, 0.4)


def test_example_shows_travel_and_steps_in_lines_that_load_when_uncommented() -> None:
    text = EXAMPLE.read_text(encoding="utf-8")
    lines = re.findall(r"^# ((?:travel|steps_per_mm) = \{.*\})$", text, re.MULTILINE)
    assert len(lines) == 2
    motion = MotionConfig.model_validate(tomllib.loads("\n".join(lines)))
    assert motion.travel.x == (0.0, 600.0)
    assert motion.steps_per_mm.x == 100.0


def test_every_key_of_the_example_has_a_comment() -> None:
    text = EXAMPLE.read_text(encoding="utf-8")
    bare = [line for line in text.splitlines() if re.match(r"\w+ = [^{]", line) and "#" not in line]
    assert bare == ["baud = 115200"]


def test_defaults_of_the_dialect_are_those_of_the_engine() -> None:
    assert ElvintoConfig().dialect() == Dialect()


def test_dialect_carries_every_key_of_the_engine() -> None:
    changed = ElvintoConfig(
        header_name="CRC",
        crc_radix=16,
        checksum_scope="gcode",
        require_header=False,
        init_acknowledged=False,
        encoding="cp1251",
        report_moves=False,
        retry_interval=0.2,
        max_retries=3,
        probe_after=5.0,
        poll_interval=1.0,
        position_tolerance=0.1,
        max_message_bytes=4096,
    ).dialect()
    same = [name for name in Dialect.__slots__ if getattr(changed, name) == getattr(Dialect(), name)]
    assert same == []


def test_limits_are_those_of_the_planner() -> None:
    assert ElvintoConfig().limits() == BatchLimits()
    changed = ElvintoConfig(max_batch_bytes=100, max_batch_blocks=5, max_batch_seconds=0.5, position_tolerance=0.1)
    assert changed.limits() == BatchLimits(100, 5, 0.5, 0.1)


def test_motion_is_handed_on_and_an_axis_without_travel_is_left_out() -> None:
    tables = {"max_rate": {"x": 6000}, "acceleration": {"x": 400}, "travel": {"x": [0, 300]}}
    motion = MotionConfig.model_validate(tables).motion()
    assert (motion.rate_mm_min("x"), motion.acceleration_mm_s2("x"), motion.travel) == (6000, 400, {"x": (0, 300)})
    assert (motion.rate_mm_min("y"), motion.acceleration_mm_s2("y")) == (3000, 200)


def test_the_planner_of_a_machine_is_handed_on() -> None:
    assert MotionConfig().motion() == Motion(dict.fromkeys("xyzabc", 3000.0), dict.fromkeys("xyzabc", 200.0))
    tables = {"steps_per_mm": {"x": 80}, "junction_deviation": 0, "arc_tolerance": 0.01, "planner_blocks": 1}
    motion = MotionConfig.model_validate({**tables, "laser": True}).motion()
    assert (motion.steps_per_mm, motion.junction_deviation_mm, motion.arc_tolerance_mm) == ({"x": 80}, 0, 0.01)
    assert (motion.planner_blocks, motion.laser) == (1, True)


def test_data_dir_is_expanded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", "/home/mill")
    assert ServerConfig().data_dir == Path("/home/mill/.local/share/millstream")
    assert ServerConfig.model_validate({"data_dir": "~/x"}).data_dir == Path("/home/mill/x")


@pytest.mark.parametrize(
    "port",
    [
        "/dev/ttyUSB0",
        "/dev/serial/by-id/usb-FTDI_A1-if00-port0",
        "COM3",
        "tcp://mill.local:4000",
        "tcp://[::1]:4000",
        "sim:",
        "sim:?speed_factor=20",
    ],
)
def test_ports_that_are_taken(port: str) -> None:
    assert MachineConfig(name="m", port=port).port == port


@pytest.mark.parametrize(
    "port", ["", " /dev/ttyUSB0", "tcp://mill", "tcp://:4000", "tcp://mill:0", "tcp://mill:65536", "http://x", "sim:x"]
)
def test_ports_that_are_refused(port: str) -> None:
    with pytest.raises(ValidationError):
        MachineConfig(name="m", port=port)


@pytest.mark.parametrize("name", ["", "Router", "a b", "a/b", "a_b", "x" * 65, "мельница", "a\n"])
def test_names_that_are_refused(name: str) -> None:
    with pytest.raises(ValidationError):
        MachineConfig(name=name, port="sim:")


def test_two_machines_may_not_share_a_name() -> None:
    with pytest.raises(ValidationError, match="a name of its own"):
        Config(machine=(MachineConfig(name="a", port="sim:"), MachineConfig(name="a", port="sim:")))


def test_two_machines_may_not_share_a_port() -> None:
    with pytest.raises(ValidationError, match="a port of its own"):
        Config(machine=(MachineConfig(name="a", port="/dev/x"), MachineConfig(name="b", port="/dev/x")))


def test_virtual_machines_may_share_theirs() -> None:
    machines = (MachineConfig(name="a", port="sim:"), MachineConfig(name="b", port="sim:"))
    assert Config(machine=machines).machine == machines


def test_largest_batch_fits_a_message_even_as_base64() -> None:
    with pytest.raises(ValidationError, match="at most 84"):
        ElvintoConfig(max_message_bytes=128, max_batch_bytes=85)
    assert ElvintoConfig(max_message_bytes=128, max_batch_bytes=84).max_batch_bytes == 84


def test_every_protocol_has_its_section_in_the_model() -> None:
    assert set(PROTOCOLS.values()) <= set(MachineConfig.model_fields)


def test_machine_knows_its_profile() -> None:
    assert MachineConfig(name="m", port="sim:").profile == "elvinto"


def test_a_user_without_a_home_can_be_told_another_directory(monkeypatch: pytest.MonkeyPatch) -> None:
    def nobody(_path: Path) -> Path:
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.setattr(Path, "expanduser", nobody)
    assert ServerConfig().data_dir == Path("/nonexistent/.local/share/millstream")
    assert ServerConfig.model_validate({"data_dir": "~/here"}).data_dir == Path("/nonexistent/here")
