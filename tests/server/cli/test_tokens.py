"""token create, list and revoke, on the database of a daemon that does not run."""

import json
from contextlib import closing
from pathlib import Path

import pytest
from sqlite_utils import Database

from server.access.audit import faults
from tests.server.cli.conftest import Outcome, Run


@pytest.fixture
def token(millstream: Run, tmp_path: Path) -> Run:
    environ = {"MILLSTREAM_SERVER__DATA_DIR": str(tmp_path / "data")}

    def command(*argv: object) -> Outcome:
        return millstream("token", *argv, environ=environ)

    return command


def test_the_secret_is_printed_once_alone_on_standard_output(token: Run) -> None:
    made = token("create", "--name", "screen", "--role", "operator")
    assert made.code == 0
    (secret,) = made.out.splitlines()
    assert secret.startswith("mill_")
    assert "only now" in made.err
    listed = token("list")
    assert "screen" in listed.out
    assert "operator" in listed.out
    assert secret not in listed.out


def test_the_first_token_needs_no_options(token: Run) -> None:
    made = json.loads(token("create", "--json").out)
    assert made["role"] == "admin"
    assert made["token"].startswith("mill_")


def test_an_unknown_role_is_wrong_usage(token: Run) -> None:
    outcome = token("create", "--role", "king")
    assert outcome.code == 2
    assert "viewer, operator, admin" in outcome.err


def test_revoke(token: Run) -> None:
    made = json.loads(token("create", "--json").out)
    assert token("revoke", made["id"]).code == 0
    (listed,) = json.loads(token("list", "--json").out)
    assert listed["revoked_at"] is not None


def test_revoke_of_nothing_is_1(token: Run) -> None:
    outcome = token("revoke", "00000000")
    assert outcome.code == 1
    assert "millstream token list" in outcome.err


def test_a_data_directory_that_cannot_be_is_told(millstream: Run, tmp_path: Path) -> None:
    (tmp_path / "data").write_text("a file", encoding="utf-8")
    outcome = millstream("token", "list", environ={"MILLSTREAM_SERVER__DATA_DIR": str(tmp_path / "data")})
    assert outcome.code == 1
    assert "the database cannot be used" in outcome.err


def test_a_database_that_is_none_is_told(millstream: Run, tmp_path: Path) -> None:
    (tmp_path / "millstream.db").write_bytes(b"this is no database, this is a letter\n" * 100)
    outcome = millstream("token", "list", environ={"MILLSTREAM_SERVER__DATA_DIR": str(tmp_path)})
    assert outcome.code == 1
    assert "the database cannot be used" in outcome.err


def test_a_token_that_ends_by_itself(token: Run) -> None:
    made = token("create", "--expires", "90d", "--json")
    assert json.loads(made.out)["expires_at"] > json.loads(made.out)["created_at"]
    assert json.loads(made.out)["expires_at"][:10] in token("list").out
    assert token("create", "--expires", "soon").code == 2


def test_what_is_done_with_tokens_here_stands_in_the_audit(token: Run, tmp_path: Path) -> None:
    made = json.loads(token("create", "--json").out)
    token("revoke", made["id"])
    with closing(Database(tmp_path / "data" / "millstream.db")) as db:
        rows = list(db.query("select via, method, route, target, name from audit order by id"))
        assert list(faults(db)) == []
    told = [("command line", "COMMAND", f"token {verb}", made["id"]) for verb in ("create", "revoke")]
    assert [tuple(row.values())[:4] for row in rows] == told
    assert all(row["name"] for row in rows)
