"""mtconnect-devices: a document on standard output that an agent can be given as it is."""

from pathlib import Path
from xml.etree import ElementTree as ET

from tests.server.cli.conftest import Run


def test_the_machines_of_the_configuration(millstream: Run, tmp_path: Path) -> None:
    (tmp_path / "millstream.toml").write_text('[[machine]]\nname = "mill"\nport = "sim:"\n')
    outcome = millstream("mtconnect-devices")
    assert outcome.code == 0
    assert outcome.out.startswith('<?xml version="1.0" encoding="UTF-8"?>\n<MTConnectDevices xmlns=')
    device = ET.fromstring(outcome.out).find(".//{*}Device")
    assert device is not None
    assert device.get("name") == "mill"


def test_without_a_machine_there_is_nothing_to_describe(millstream: Run) -> None:
    outcome = millstream("mtconnect-devices")
    assert outcome.code == 2
    assert "No machine is configured" in outcome.err
