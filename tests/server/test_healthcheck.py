"""The check that Docker runs: the address from file and variables, and what counts as alive."""

import json
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path

import pytest

from server import healthcheck
from server.healthcheck import address, alive


@pytest.mark.parametrize(
    ("text", "environ", "url"),
    [
        (None, {}, "http://127.0.0.1:8420/healthz"),
        ("[server]\nport = 9000\n", {}, "http://127.0.0.1:9000/healthz"),
        ('[server]\nhost = "0.0.0.0"\n', {"MILLSTREAM_SERVER__PORT": "9001"}, "http://127.0.0.1:9001/healthz"),
        ('[server]\nhost = "10.0.0.5"\n', {}, "http://10.0.0.5:8420/healthz"),
        ('[server]\nhost = "10.0.0.5"\n', {"MILLSTREAM_SERVER__HOST": "::"}, "http://[::1]:8420/healthz"),
    ],
)
def test_the_address(tmp_path: Path, text: str | None, environ: dict[str, str], url: str) -> None:
    if text is not None:
        (tmp_path / "millstream.toml").write_text(text)
    assert address(environ, tmp_path) == url


def test_a_configuration_elsewhere(tmp_path: Path) -> None:
    (tmp_path / "m.toml").write_text("[server]\nport = 7\n")
    assert address({"MILLSTREAM_CONFIG": str(tmp_path / "m.toml")}, Path("/nowhere")).endswith(":7/healthz")


class Answering(BaseHTTPRequestHandler):
    """A daemon's answer."""

    status, body = 200, b"{}"

    def do_GET(self) -> None:
        self.send_response(self.status)
        self.end_headers()
        self.wfile.write(self.body)

    def log_message(self, *_: object) -> None:
        pass


@pytest.fixture
def url(monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    monkeypatch.setenv("http_proxy", "http://127.0.0.1:1")
    with HTTPServer(("127.0.0.1", 0), Answering) as server:
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
        thread.start()
        yield f"http://127.0.0.1:{server.server_port}/healthz"
        server.shutdown()
        thread.join()


@pytest.mark.parametrize(
    ("status", "body", "wrong"),
    [
        (200, {"status": "ok", "version": "1"}, None),
        (200, {"status": "starting"}, "status 'starting'"),
        (500, {"status": "ok"}, "500"),
        (200, ["ok"], "not millstream"),
    ],
)
def test_what_counts_as_alive(
    url: str, monkeypatch: pytest.MonkeyPatch, status: int, body: object, wrong: str | None
) -> None:
    monkeypatch.setattr(Answering, "status", status)
    monkeypatch.setattr(Answering, "body", json.dumps(body).encode())
    found = alive(url)
    assert found is None if wrong is None else wrong in str(found)


def test_nobody_there_is_1_with_a_reason(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MILLSTREAM_SERVER__PORT", "1")
    assert healthcheck.main() == 1
    assert "http://127.0.0.1:1/healthz" in capsys.readouterr().err
    (tmp_path / "millstream.toml").write_text("no toml")
    assert healthcheck.main() == 1
