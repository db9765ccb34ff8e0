"""doctor: what it prints, its exit codes, and a configuration that is itself the fault."""

import json
import tomllib
from functools import partial
from pathlib import Path

import pytest

from server.doctor import system as doctorsystem
from server.doctor.doctor import Doctor
from sim.elvinto.settings import SimSettings
from tests.server.cli.conftest import Run
from tests.server.doctor.test_ask import SimLine
from tests.server.doctor.test_doctor import Lines


@pytest.fixture(autouse=True)
def _quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctorsystem, "WATCHED_S", 0.0)


def written(folder: Path, machine: str) -> dict[str, str]:
    text = f'[server]\nport = 0\n[[machine]]\nname = "mill"\n{machine}\n'
    (folder / "millstream.toml").write_text(text, encoding="utf-8")
    return {"MILLSTREAM_SERVER__DATA_DIR": str(folder / "data")}


def test_all_is_well(millstream: Run, tmp_path: Path) -> None:
    outcome = millstream("doctor", environ=written(tmp_path, 'port = "sim:"'))
    assert outcome.code == 0, outcome.out
    assert outcome.out.startswith("ok      versions: millstream ")
    assert "0 errors" in outcome.out


def test_what_is_wrong_is_told_with_advice(millstream: Run, tmp_path: Path) -> None:
    outcome = millstream("doctor", environ=written(tmp_path, 'port = "/dev/ttyNOTHERE"'))
    assert outcome.code == 1
    assert "ERROR   port: mill: /dev/ttyNOTHERE is not there." in outcome.out
    assert "`dmesg` says more" in outcome.out
    assert outcome.out.rstrip().splitlines()[-1].startswith("1 error, ")


def test_json_has_every_finding(millstream: Run, tmp_path: Path) -> None:
    outcome = millstream("doctor", "--json", environ=written(tmp_path, 'port = "/dev/ttyNOTHERE"'))
    told = json.loads(outcome.out)
    assert (outcome.code, told["ok"]) == (1, False)
    (finding,) = [one for one in told["findings"] if one["level"] == "error"]
    assert set(finding) == {"check", "level", "machine", "message", "advice", "data"}
    assert (finding["check"], finding["machine"]) == ("port", "mill")


def test_a_faulty_configuration_is_a_finding_and_the_rest_is_looked_at(millstream: Run, tmp_path: Path) -> None:
    outcome = millstream("doctor", environ=written(tmp_path, 'port = "sim:"\nbaud = 12\nspeed = 3'))
    assert outcome.code == 1
    assert 'ERROR   config: millstream.toml: machine[0].baud (machine "mill") = 12' in outcome.out
    assert "there is no such key" in outcome.out
    assert "disk:" in outcome.out


def test_a_port_alone(millstream: Run) -> None:
    outcome = millstream("doctor", "--port", "/dev/ttyNOTHERE")
    assert outcome.code == 1
    assert "versions" not in outcome.out


def test_what_was_found_is_printed_as_configuration_and_what_was_sent(
    millstream: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    lines = Lines(SimLine(SimSettings(crc_radix=16)))
    monkeypatch.setattr("server.cli.doctor.Doctor", partial(Doctor, open_line=lines))
    outcome = millstream("doctor", "--port", "tcp://mill:23", "--protocol", "elvinto")
    assert outcome.code == 0
    assert 'sent: "CRC16,VALUE<#864,' in outcome.out
    printed = "\n".join(line.partition("| ")[2] for line in outcome.out.splitlines() if line.startswith("        |"))
    assert tomllib.loads(printed) == {
        "machine": [{"name": "machine-1", "protocol": "elvinto", "port": "tcp://mill:23", "elvinto": {"crc_radix": 16}}]
    }


def test_wrong_usage(millstream: Run) -> None:
    assert millstream("doctor", "--config", "nowhere.toml").code == 2
    assert millstream("doctor", "--protocol", "grbl").code == 2
    outcome = millstream("doctor", "--port", "/dev/null", "--protocol", "marlin")
    assert outcome.code == 2
    assert "elvinto, grbl, ncframe" in outcome.err
