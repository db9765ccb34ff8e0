"""A program as people have it, from curl to the last block: every block it has, as `translate` shows it, once.

Skipped, and said so, where the folder of real programs is missing.
"""

import json
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.harness.process import ENVIRON, MACHINE, MILLSTREAM, daemon, sim_process
from tests.harness.programs import FITTING_FILES, corpus_files

pytestmark = pytest.mark.real

FASTEST = ("--option", "instant=true")
"""Motion takes no time: what is left is the daemon and the wire."""
SMALL_BYTES = 100_000
"""The larger files of the corpus say nothing more here."""


def curl(*args: str) -> object:
    done = subprocess.run(
        ["curl", "--silent", "--show-error", "--fail-with-body", *args], env=ENVIRON, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return json.loads(done.stdout)


def translated(path: Path) -> list[str]:
    """What is to go over the wire, by the command that needs no daemon and no machine."""
    command = [*MILLSTREAM, "translate", str(path), "--profile", "elvinto"]
    done = subprocess.run(command, env=ENVIRON, capture_output=True, text=True, check=True)
    return done.stdout.splitlines()


def test_from_curl_to_the_last_block(tmp_path: Path) -> None:
    if shutil.which("curl") is None:
        pytest.skip("there is no curl on this computer: nothing of this test was run")
    fitting = [path for path in corpus_files() if path.name in FITTING_FILES and path.stat().st_size < SMALL_BYTES]
    assert fitting
    with sim_process(tmp_path, *FASTEST) as (port, recording), daemon(tmp_path, port) as one:
        one.connected()
        for path in fitting:
            before = len(recording.blocks())
            api = f"{one.url}/api/v1"
            program = curl("--data-binary", f"@{path}", f"{api}/programs?name={path.name}")
            assert isinstance(program, dict)
            order = json.dumps({"program": program["id"], "machine": MACHINE, "force": True})
            job = curl("--header", "Content-Type: application/json", "--data", order, f"{api}/jobs")
            assert isinstance(job, dict)
            view = one.status(job["id"], "completed", "failed", "interrupted")
            assert view["status"] == "completed", (path.name, view)
            assert recording.blocks()[before:] == translated(path), path.name
