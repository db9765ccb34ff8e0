"""demo: finds a port, runs the sample to its end, leaves nothing behind."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from server.cli.common import CliError
from server.cli.demo import PORTS_TRIED, _free_listener
from server.cli.serve import bind


def test_a_taken_port_leads_to_the_next_one_and_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    with bind("127.0.0.1", 0) as taken:
        port = taken.getsockname()[1]
        with _free_listener(port) as found:
            number = found.getsockname()[1]
    assert port < number < port + PORTS_TRIED
    assert capsys.readouterr().err == f"Port {port} is taken by another program; this demo uses {number}.\n"


def test_a_free_port_is_taken_without_a_word(capsys: pytest.CaptureFixture[str]) -> None:
    with bind("127.0.0.1", 0) as known:
        port = known.getsockname()[1]
    with _free_listener(port) as found:
        assert found.getsockname()[1] == port
    assert capsys.readouterr().err == ""


def test_no_free_port_is_an_error() -> None:
    with bind("127.0.0.1", 65535), pytest.raises(CliError, match="all taken"):
        _free_listener(65535)


@pytest.mark.real
def test_the_sample_runs_to_its_end(tmp_path: Path) -> None:
    command = [sys.executable, "-c", "from server.cli import main; main()", "demo", "--once"]
    environ = {**os.environ, "TMPDIR": str(tmp_path), "NO_PROXY": "127.0.0.1"}
    options = ["--port", "0", "--speed", "1000"]
    done = subprocess.run([*command, *options], env=environ, cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stderr) == (0, "")
    assert re.search(r"^Dashboard: http://127\.0\.0\.1:\d+$", done.stdout, re.MULTILINE)
    assert "rose.nc: completed" in done.stdout
    assert list(tmp_path.iterdir()) == []
