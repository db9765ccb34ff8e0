"""The systemd unit and what goes with it: systemd finds no fault in it, and it runs what there is."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from server.api.clientaddress import FORWARDED_FOR, FORWARDED_PROTO
from server.cli import build
from server.config.file import load
from server.notify import PINGS_PER_TIMEOUT
from tests.harness.docs import ROOT, page

PACKAGING = ROOT / "packaging"
UNIT = PACKAGING / "millstream.service"


def settings() -> dict[str, list[str]]:
    """The keys of the unit with their values."""
    found: dict[str, list[str]] = {}
    for line in UNIT.read_text(encoding="utf-8").splitlines():
        key, separator, value = line.partition("=")
        if separator and not line.startswith("#"):
            found.setdefault(key, []).append(value)
    return found


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="no systemd here")
def test_systemd_finds_no_fault_in_it(tmp_path: Path) -> None:
    text = UNIT.read_text(encoding="utf-8").replace("/opt/millstream/bin/millstream", sys.executable)
    (tmp_path / "millstream.service").write_text(text.replace("User=millstream", "User=root"))
    said = subprocess.run(
        ["systemd-analyze", "verify", str(tmp_path / "millstream.service")],
        capture_output=True,
        text=True,
        timeout=30,
        check=False,
    )
    ours = [line for line in said.stderr.splitlines() if "millstream.service" in line]
    assert ours == []


def test_it_runs_a_command_that_there_is() -> None:
    ((program, command, option, path),) = (value.split() for value in settings()["ExecStart"])
    assert program.endswith("/bin/millstream")
    (serve,) = [one for one in build().registered_commands if one.callback and one.callback.__name__ == command]
    assert serve.callback is not None
    assert option == "--config"
    assert Path(path).parent == Path("/etc") / settings()["ConfigurationDirectory"][0]


def test_the_data_lies_where_systemd_keeps_it() -> None:
    environ = dict(pair.split("=", 1) for value in settings()["Environment"] for pair in value.split())
    config = load(None, environ)
    assert config.server.data_dir == Path("/var/lib") / settings()["StateDirectory"][0]


def test_it_is_told_of_the_start_and_of_hanging() -> None:
    found = settings()
    assert found["Type"] == ["notify"]
    assert int(found["WatchdogSec"][0]) / PINGS_PER_TIMEOUT >= 5
    assert found["RestartPreventExitStatus"] == ["2"], "a faulty configuration gets no better by itself"


def test_only_serial_ports_can_be_opened() -> None:
    found = settings()
    assert found["DevicePolicy"] == ["closed"]
    assert {"char-ttyUSB rw", "char-ttyACM rw"} <= set(found["DeviceAllow"])
    assert all(value.startswith(("char-tty", "char-188", "char-166", "char-204")) for value in found["DeviceAllow"])


def test_the_user_is_made_and_in_the_group_of_the_ports() -> None:
    found = settings()
    made = (PACKAGING / "millstream.sysusers").read_text(encoding="utf-8")
    assert f"u {found['User'][0]} - " in made
    assert f"m {found['User'][0]} {found['SupplementaryGroups'][0]}" in made


def test_every_file_of_packaging_is_told_of() -> None:
    text = page("operations.md")
    assert [path.name for path in PACKAGING.iterdir() if f"packaging/{path.name}" not in text] == []


@pytest.mark.parametrize("name", ["nginx.conf", "Caddyfile"])
def test_proxies_lead_to_the_daemon(name: str) -> None:
    text = (PACKAGING / name).read_text(encoding="utf-8")
    assert f"127.0.0.1:{load(None, {}).server.port}" in text
    assert text.count("{") == text.count("}")


def test_nginx_says_what_the_daemon_believes_of_a_trusted_proxy() -> None:
    text = (PACKAGING / "nginx.conf").read_text(encoding="utf-8")
    for header in (FORWARDED_FOR, FORWARDED_PROTO):
        assert re.search(rf"proxy_set_header {header} \$", text, re.IGNORECASE), header
    assert "proxy_add_x_forwarded_for" not in text, "what a client writes itself goes no further"


def test_the_unit_names_a_page_that_is_installed() -> None:
    (where,) = settings()["Documentation"]
    folder = Path(where.removeprefix("file://"))
    assert f"{folder.parent} docs/*.md" in page("operations.md")
    assert (ROOT / "docs" / folder.name).exists()


def test_nobody_but_the_daemon_reads_its_passwords() -> None:
    (mode,) = settings()["ConfigurationDirectoryMode"]
    assert mode == "0750"
    text = page("operations.md")
    assert "install -d -m 750 -g millstream /etc/millstream" in text
    assert "install -m 640 -g millstream config.example.toml" in text


def test_folders_that_a_small_debian_lacks_are_made() -> None:
    for folder in ("/etc/sysusers.d", "/etc/udev/rules.d"):
        (line,) = [line for line in page("operations.md").splitlines() if folder in line]
        assert "install -D " in line
