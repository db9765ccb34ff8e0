"""serve: what ends the start with a sentence, and a real daemon from its address to SIGTERM."""

import errno
import gc
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest

from server.cli.common import CliError
from server.cli.serve import TURN_S, address, bind, favour_the_stream
from server.cli.settings import sole_daemon
from server.config.model import Config, ServerConfig
from tests.server.cli.conftest import Run

MACHINE = '[[machine]]\nname = "mill"\nport = "sim:?speed_factor=20"\n'
MORE_THAN_BUFFERS = 64 * 1024 * 1024
"""Bytes; the system keeps a few millions for a peer that does not read."""


@pytest.fixture
def listener() -> Iterator[socket.socket]:
    with bind("127.0.0.1", 0) as bound:
        yield bound


@pytest.fixture
def own_settings() -> Iterator[None]:
    """What a test sets for the whole process is as it was, behind it."""
    interval_s = sys.getswitchinterval()
    yield
    sys.setswitchinterval(interval_s)
    gc.unfreeze()


@pytest.mark.usefixtures("own_settings")
def test_nothing_that_stays_is_looked_through_for_garbage_and_the_loop_gets_its_turn() -> None:
    favour_the_stream()
    assert gc.get_freeze_count() > 1000
    assert sys.getswitchinterval() == pytest.approx(TURN_S)


def test_without_a_machine_it_says_what_to_do(millstream: Run) -> None:
    outcome = millstream("serve")
    assert outcome.code == 2
    assert "config.example.toml" in outcome.err
    assert "millstream demo" in outcome.err


def test_a_faulty_configuration_is_wrong_usage(millstream: Run, tmp_path: Path) -> None:
    (tmp_path / "millstream.toml").write_text("[server]\nport = 70000\n", encoding="utf-8")
    outcome = millstream("serve")
    assert outcome.code == 2
    assert outcome.err == "millstream.toml: server.port = 70000: allowed is a whole number from 0 to 65535\n"


def test_a_missing_configuration_is_wrong_usage(millstream: Run) -> None:
    assert millstream("serve", "--config", "nowhere.toml").code == 2


def test_a_taken_port_is_told(millstream: Run, tmp_path: Path, listener: socket.socket) -> None:
    port = listener.getsockname()[1]
    (tmp_path / "millstream.toml").write_text(f'[server]\nport = {port}\ndata_dir = "d"\n{MACHINE}', encoding="utf-8")
    outcome = millstream("serve")
    assert outcome.code == 1
    assert outcome.err.startswith(f"127.0.0.1:{port}: Address already in use. ")


def test_without_a_token_it_does_not_listen_on_a_network(millstream: Run, tmp_path: Path) -> None:
    text = f'[server]\nhost = "0.0.0.0"\nport = 0\ndata_dir = "d"\n{MACHINE}'
    (tmp_path / "millstream.toml").write_text(text, encoding="utf-8")
    outcome = millstream("serve")
    assert outcome.code == 1
    assert "millstream token create" in outcome.err


def test_a_data_directory_has_one_daemon(millstream: Run, tmp_path: Path) -> None:
    text = f'[server]\nport = 0\ndata_dir = "{tmp_path}/d"\n{MACHINE}'
    (tmp_path / "millstream.toml").write_text(text, encoding="utf-8")
    with sole_daemon(Config(server=ServerConfig(data_dir=tmp_path / "d"))):
        outcome = millstream("serve")
    assert outcome.code == 1
    assert "another millstream daemon works here" in outcome.err


@pytest.mark.parametrize("left", [b"", None])
def test_programs_without_their_database_are_no_beginning(tmp_path: Path, left: bytes | None) -> None:
    config = Config(server=ServerConfig(data_dir=tmp_path))
    if left is not None:
        config.server.database_path.write_bytes(left)
    with sole_daemon(config):
        pass
    config.server.programs_dir.mkdir()
    (config.server.programs_dir / f"{'0' * 64}.nc").write_bytes(b"M30\n")
    with pytest.raises(CliError, match=r"the database is gone.*millstream restore FILE"), sole_daemon(config):
        pytest.fail("it would have begun anew")


def test_a_host_that_nobody_knows_is_told_as_such() -> None:
    with pytest.raises(CliError, match=r"no-such-host\.invalid: this name is not known. Set server\.host"):
        bind("no-such-host.invalid", 0)


def test_the_address_is_one_to_click_on(listener: socket.socket) -> None:
    assert address(listener) == f"http://127.0.0.1:{listener.getsockname()[1]}"
    with bind("0.0.0.0", 0) as everywhere:
        assert address(everywhere) == f"http://{socket.gethostname()}:{everywhere.getsockname()[1]}"


@pytest.mark.real
def test_no_answer_waits_for_the_client_to_have_taken_its_first_half() -> None:
    """Nagle's algorithm and a delayed acknowledgement together are 40 ms for each request of a kept connection."""

    with bind("127.0.0.1", 0) as listener, socket.create_connection(listener.getsockname()):
        served, _ = listener.accept()
        with served:
            assert served.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)


@pytest.mark.real
@pytest.mark.skipif(not hasattr(socket, "TCP_USER_TIMEOUT"), reason="only Linux gives up a peer that does not read")
def test_a_peer_that_reads_nothing_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("server.cli.serve.UNREAD_S", 1)
    with bind("127.0.0.1", 0) as listener, socket.create_connection(listener.getsockname()) as deaf:
        served, _ = listener.accept()
        with served:
            served.settimeout(20)
            with pytest.raises(OSError, match=os.strerror(errno.ETIMEDOUT)):
                served.sendall(bytes(MORE_THAN_BUFFERS))
            assert deaf.fileno() >= 0


@pytest.mark.real
def test_a_daemon_answers_and_ends_with_0_on_sigterm(tmp_path: Path) -> None:
    (tmp_path / "millstream.toml").write_text(f'[server]\nport = 0\ndata_dir = "d"\n{MACHINE}', encoding="utf-8")
    environ = {**os.environ, "NO_PROXY": "127.0.0.1", "PYTHONUNBUFFERED": "1", "WATCHDOG_USEC": "600000000"}
    command = [sys.executable, "-c", "from server.cli import main; main()", "serve"]
    environ["NOTIFY_SOCKET"] = str(tmp_path / "notify")
    with (
        socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as systemd,
        subprocess.Popen(command, cwd=tmp_path, env=environ, stdout=subprocess.PIPE, text=True) as daemon,
    ):
        systemd.bind(environ["NOTIFY_SOCKET"])
        systemd.settimeout(30)
        try:
            assert daemon.stdout is not None
            url = daemon.stdout.readline().removeprefix("millstream: ").strip()
            assert httpx.get(f"{url}/healthz").json()["status"] == "ok"
            assert [one["name"] for one in httpx.get(f"{url}/api/v1/machines").json()] == ["mill"]
            assert "server" not in httpx.get(f"{url}/healthz").headers
            daemon.send_signal(signal.SIGTERM)
            assert daemon.wait(timeout=30) == 0
            told = [systemd.recv(4096).decode() for _ in range(5)]
            assert told[0].startswith("STATUS="), "`systemctl status` has a sentence from the beginning"
            assert told[1] == "READY=1"
            assert told[2].startswith("STATUS=")
            assert told[3:] == ["WATCHDOG=1", "STOPPING=1"]
        finally:
            daemon.kill()
