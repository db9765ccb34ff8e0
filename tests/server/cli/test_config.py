"""config show: as a table, as JSON, and what is wrong with a configuration."""

import json
from pathlib import Path

from tests.server.cli.conftest import Run


def test_every_value_with_its_source(millstream: Run, tmp_path: Path) -> None:
    (tmp_path / "millstream.toml").write_text('[server]\nport = 8421\n[[machine]]\nname = "mill"\nport = "sim:"\n')
    outcome = millstream("config", "show", environ={"MILLSTREAM_SERVER__LOG_LEVEL": "debug"})
    assert outcome.code == 0
    told = {line.split()[0]: line.split()[1:] for line in outcome.out.splitlines()}
    assert told["server.port"] == ["8421", "millstream.toml:2"]
    assert told["server.log_level"] == ['"debug"', "MILLSTREAM_SERVER__LOG_LEVEL"]
    assert told["server.queue_limit"] == ["1000", "default"]
    assert told["machine.mill.elvinto.compact"] == ["true", "default"]


def test_what_is_changed_alone(millstream: Run, tmp_path: Path) -> None:
    (tmp_path / "m.toml").write_text('[server]\nport = 8421\ndata_dir = "d"\n')
    told = json.loads(millstream("config", "show", "--changed", "--json", "--config", "m.toml").out)
    assert told["config"] == "m.toml"
    assert told["settings"] == [
        {"key": "server.port", "value": 8421, "source": "m.toml:2"},
        {"key": "server.data_dir", "value": "d", "source": "m.toml:3"},
    ]


def test_without_a_file(millstream: Run) -> None:
    outcome = millstream("config", "show")
    assert outcome.code == 0
    assert outcome.out.startswith("configuration: none, the defaults\n")


def test_a_faulty_one_is_wrong_usage(millstream: Run, tmp_path: Path) -> None:
    (tmp_path / "millstream.toml").write_text("[server]\nport = 70000\n")
    outcome = millstream("config", "show")
    assert outcome.code == 2
    assert "allowed is a whole number from 0 to 65535" in outcome.err
