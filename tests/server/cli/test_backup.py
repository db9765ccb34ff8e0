"""backup and restore from the command line: what is refused, what is told, and a round trip beside a daemon."""

import json
from pathlib import Path

import pytest

from server.cli.settings import sole_daemon
from server.config.model import Config
from tests.server.cli.conftest import Outcome, Run
from tests.server.store.test_archive import Data


@pytest.fixture
def command(millstream: Run, tmp_path: Path) -> Run:
    Data(tmp_path / "data")

    def run(*argv: object, into: str = "data") -> Outcome:
        return millstream(*argv, environ={"MILLSTREAM_SERVER__DATA_DIR": str(tmp_path / into)})

    return run


def daemon(tmp_path: Path, folder: str = "data") -> Config:
    return Config.model_validate({"server": {"data_dir": str(tmp_path / folder)}})


def test_a_round_trip_while_the_daemon_runs(command: Run, tmp_path: Path) -> None:
    (tmp_path / "millstream.toml").write_text('[[machine]]\nname = "mill"\nport = "sim:"\n')
    with sole_daemon(daemon(tmp_path)):
        outcome = command("backup", "b.zip")
    assert (outcome.code, outcome.out.startswith("b.zip: 2 programs and the database")) == (0, True), outcome
    outcome = command("restore", "b.zip", into="other")
    assert outcome.code == 0, outcome.err
    assert "2 programs" in outcome.out
    assert command("history", "verify", into="other").code == 0


def test_a_file_that_is_there_is_not_replaced_unasked(command: Run, tmp_path: Path) -> None:
    (tmp_path / "b.zip").write_text("mine")
    outcome = command("backup", "b.zip")
    assert (outcome.code, (tmp_path / "b.zip").read_text()) == (1, "mine")
    assert "--force" in outcome.err
    told = json.loads(command("backup", "b.zip", "--force", "--json").out)
    assert told == {"file": "b.zip", "bytes": (tmp_path / "b.zip").stat().st_size, "programs": 2, "missing": []}


def test_a_folder_that_does_not_exist_is_told(command: Run) -> None:
    outcome = command("backup", "nowhere/b.zip")
    assert outcome.code == 1
    assert "No such file or directory" in outcome.err


def test_without_data_there_is_nothing_to_back_up(command: Run) -> None:
    outcome = command("backup", "b.zip", into="none")
    assert outcome.code == 1
    assert "there is no database" in outcome.err


def test_no_restore_under_a_daemon_that_runs(command: Run, tmp_path: Path) -> None:
    command("backup", "b.zip")
    with sole_daemon(daemon(tmp_path)):
        outcome = command("restore", "b.zip", "--force")
    assert outcome.code == 1
    assert "another millstream daemon works here" in outcome.err


def test_what_is_there_is_not_replaced_unasked(command: Run, tmp_path: Path) -> None:
    command("backup", "b.zip")
    outcome = command("restore", "b.zip")
    assert outcome.code == 1
    assert "is not empty (millstream.db" in outcome.err
    told = json.loads(command("restore", "b.zip", "--force", "--json").out)
    assert Path(told["aside"]).is_dir()
    assert told["programs"] == 2


def test_a_file_that_is_no_backup_is_told(command: Run, tmp_path: Path) -> None:
    (tmp_path / "letter.zip").write_text("this is a letter")
    outcome = command("restore", "letter.zip", into="other")
    assert outcome.code == 1
    assert outcome.err.startswith("letter.zip: it is damaged, or no ZIP archive")
    assert command("restore", "nothing.zip").code == 2
