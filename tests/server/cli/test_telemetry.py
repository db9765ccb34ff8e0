"""mtconnect-devices: a document that an agent can be given as it is; and a daemon whose way out cannot be opened."""

import socket
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


def test_a_way_out_that_cannot_be_opened_ends_the_start(millstream: Run, tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        text = f'[server]\nport = 0\ndata_dir = "d"\n[mtconnect]\nenabled = true\nport = {port}\n'
        (tmp_path / "millstream.toml").write_text(text + '[[machine]]\nname = "mill"\nport = "sim:"\n')
        outcome = millstream("serve")
    assert outcome.code == 1
    assert f"mtconnect: 127.0.0.1:{port}: Address already in use" in outcome.err
    assert "Set mtconnect.host and mtconnect.port" in outcome.err
