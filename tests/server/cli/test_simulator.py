"""sim elvinto, sim grbl, sim ncframe: what is handed to the virtual machine."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from server.cli import simulator
from tests.server.cli.conftest import Run


@pytest.fixture
def handed(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    seen: dict[str, Any] = {}

    async def run(settings: Any, **rest: Any) -> None:
        seen.update(settings=settings, **rest)
        rest["ready"]("/dev/pts/7")

    monkeypatch.setattr(simulator, "run", run)
    return seen


def test_the_address_is_printed(millstream: Run, handed: dict[str, Any]) -> None:
    outcome = millstream("sim", "elvinto")
    assert outcome.code == 0
    assert outcome.out == "virtual ElVinto mill: /dev/pts/7\n"
    assert handed["faults"] is None


def test_options_reach_the_machine(millstream: Run, handed: dict[str, Any]) -> None:
    options = ["--speed", 20, "--repeat", "reack", "--loss", 0.01, "--seed", 7, "--baud", 9600, "-o", "boot_s=2"]
    assert millstream("sim", "elvinto", "--tcp", "127.0.0.1:0", *options).code == 0
    settings = handed["settings"]
    assert (settings.speed_factor, settings.repeat, settings.boot_s) == (20.0, "reack", 2.0)
    assert handed["faults"].loss == 0.01
    assert (handed["seed"], handed["baud"], handed["tcp"], handed["pty"]) == (7, 9600, "127.0.0.1:0", None)


def test_grbl_has_its_own_options(millstream: Run, handed: dict[str, Any]) -> None:
    outcome = millstream("sim", "grbl", "--flavour", "grblHAL", "--speed", 5, "--flip", 0.1, "-o", "set_110=8000")
    assert (outcome.code, outcome.out) == (0, "virtual Grbl controller: /dev/pts/7\n")
    settings = handed["settings"]
    assert (settings.flavour, settings.speed_factor, settings.dollar) == ("grblHAL", 5.0, {110: 8000.0})
    assert handed["faults"].flip == 0.1


@pytest.mark.parametrize(
    "options",
    [["--pty", "p", "--tcp", "a:1"], ["-o", "crc_radix=16"], ["--flavour", "0.9"], ["-o", "set_x=1"]],
)
def test_wrong_options_of_grbl_are_wrong_usage(millstream: Run, handed: dict[str, Any], options: list[object]) -> None:
    assert millstream("sim", "grbl", *options).code == 2
    assert handed == {}


def test_the_lathe_has_its_own_options(millstream: Run, handed: dict[str, Any]) -> None:
    outcome = millstream("sim", "ncframe", "--check", "xor", "--no-counter", "--speed", 5, "-o", "framing=gap")
    assert (outcome.code, outcome.out) == (0, "virtual lathe behind NC frames: /dev/pts/7\n")
    settings = handed["settings"]
    assert (settings.check, settings.counter, settings.speed_factor, settings.framing) == ("xor", False, 5.0, "gap")


@pytest.mark.parametrize("options", [["--pty", "p", "--tcp", "a:1"], ["--check", "crc16"], ["-o", "repeat=reack"]])
def test_wrong_options_of_the_lathe_are_wrong_usage(
    millstream: Run, handed: dict[str, Any], options: list[object]
) -> None:
    assert millstream("sim", "ncframe", *options).code == 2
    assert handed == {}


@pytest.mark.parametrize(
    "options",
    [["--pty", "p", "--tcp", "a:1"], ["-o", "nonsense"], ["-o", "sped=1"], ["--repeat", "loud"], ["--loss", 2]],
)
def test_wrong_options_are_wrong_usage(millstream: Run, handed: dict[str, Any], options: list[object]) -> None:
    assert millstream("sim", "elvinto", *options).code == 2
    assert handed == {}


def test_a_port_that_cannot_be_had_is_1(millstream: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    async def run(*_: Any, **__: Any) -> None:
        raise OSError("address already in use")

    monkeypatch.setattr(simulator, "run", run)
    outcome = millstream("sim", "elvinto", "--tcp", "127.0.0.1:1")
    assert (outcome.code, outcome.err) == (1, "address already in use\n")


@pytest.mark.real
def test_a_mill_on_a_pty_takes_its_link_along_when_it_is_terminated(tmp_path: Path) -> None:
    command = [
        sys.executable,
        "-c",
        "from server.cli import main; main()",
        "sim",
        "elvinto",
        "--pty",
        tmp_path / "mill",
    ]
    environ = {**os.environ, "PYTHONUNBUFFERED": "1"}
    with subprocess.Popen(command, env=environ, stdout=subprocess.PIPE, text=True) as mill:
        try:
            assert mill.stdout is not None
            assert mill.stdout.readline() == f"virtual ElVinto mill: {tmp_path}/mill\n"
            assert (tmp_path / "mill").is_symlink()
            mill.terminate()
            assert mill.wait(timeout=30) == 0
        finally:
            mill.kill()
    assert list(tmp_path.iterdir()) == []
