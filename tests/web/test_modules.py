"""The parts of the dashboard that need no page, each by a script of its own name beside this file. Needs node."""

import json
import shutil
import subprocess
from pathlib import Path

import pytest

HERE = Path(__file__).parent
WEB = HERE.parents[1] / "web"
NODE = shutil.which("node")
SCRIPTS = sorted(HERE.glob("test_*.mjs"))

pytestmark = [
    pytest.mark.real,
    pytest.mark.skipif(NODE is None, reason="node is not installed: the modules of web/ were NOT tested here"),
]


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """web/ as a browser takes it: node needs to be told that a .js is a module."""
    folder = tmp_path_factory.mktemp("web")
    shutil.copytree(WEB, folder / "web")
    (folder / "package.json").write_text(json.dumps({"type": "module"}))
    for script in SCRIPTS:
        shutil.copy(script, folder / script.name)
    return folder


def test_there_are_scripts() -> None:
    assert {script.stem for script in SCRIPTS} >= {"test_reduce", "test_reasons", "test_socket", "test_scroll"}


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda script: script.stem)
def test_module(served: Path, script: Path) -> None:
    assert NODE is not None
    done = subprocess.run([NODE, "--test", script.name], cwd=served, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "# pass 0" not in done.stdout, "nothing was tested"
