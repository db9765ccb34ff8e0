"""A command line that talks to a fake daemon."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from server.cli import run
from server.cli.daemon import Surroundings
from tests.harness.fakedaemon import FakeDaemon


@dataclass(frozen=True)
class Outcome:
    """What a command did."""

    code: int
    out: str
    err: str
    daemon: FakeDaemon = field(default_factory=FakeDaemon)


Run = Callable[..., Outcome]


@pytest.fixture
def millstream(capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Run:
    """`millstream("jobs", "--json", answers={...})`; in an empty folder, with nothing in the environment."""
    monkeypatch.chdir(tmp_path)
    for variable in ("MILLSTREAM_URL", "MILLSTREAM_CONFIG"):
        monkeypatch.delenv(variable, raising=False)
    monkeypatch.setenv("COLUMNS", "200")

    def command(
        *argv: object, answers: Mapping[str, Any] | None = None, environ: Mapping[str, str] | None = None
    ) -> Outcome:
        daemon = FakeDaemon(answers)
        code = run([str(word) for word in argv], Surroundings(environ=environ or {}, transport=daemon))
        said = capsys.readouterr()
        return Outcome(code, said.out, said.err, daemon)

    return command
