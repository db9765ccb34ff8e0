"""What a careless client can send to a real daemon: each a clear problem, nothing half-kept, and the daemon goes on.

The uploads are bytes on a socket and files on a disk; the disk is made small by a limit of the process.
"""

import resource
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any
from urllib.parse import urlsplit

import httpx
import pytest

from tests.harness.process import MACHINE, Daemon, daemon, until

pytestmark = pytest.mark.real

LARGEST = 1024 * 1024
DISK = LARGEST // 2
"""No file may become larger then: writing behind it fails, as on a full disk."""
SIM = "sim:?speed_factor=20"
LINE = b"G1 X1.000 Y2.000 F1000\n"


@pytest.fixture(scope="module")
def one(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    """One daemon for all: whatever is done to it, it must serve the next test."""
    with daemon(tmp_path_factory.mktemp("daemon"), SIM, server=f"max_upload_bytes = {LARGEST}") as running:
        yield running.connected()


@contextmanager
def small_disk(one: Daemon) -> Iterator[None]:
    """The disk of the daemon is full soon."""
    before = resource.prlimit(one.pid, resource.RLIMIT_FSIZE)
    resource.prlimit(one.pid, resource.RLIMIT_FSIZE, (DISK, before[1]))
    try:
        yield
    finally:
        resource.prlimit(one.pid, resource.RLIMIT_FSIZE, before)


def kept(one: Daemon) -> list[str]:
    """The files of programs on the disk."""
    return sorted(path.name for path in (one.folder / "data" / "programs").iterdir())


def upload(one: Daemon, content: Any, **headers: str) -> httpx.Response:
    return one.http.post("/api/v1/programs?name=part.nc", content=content, headers=headers)


def pieces(count: int, piece: bytes = LINE * 1000) -> Iterator[bytes]:
    """A body whose length nobody knows before its end."""
    for _ in range(count):
        yield piece


def test_uploads_that_are_none_leave_nothing_behind(one: Daemon) -> None:
    before = kept(one), one.get("/programs")
    for answer, status, code in (
        (upload(one, b"MZ\x90\x00\x03" * 1000), 422, "not_a_program"),
        (upload(one, b"G1 X1\n" + b"X" * DISK), 422, "not_a_program"),
        (upload(one, b""), 422, "empty_program"),
        (upload(one, pieces(LARGEST // len(LINE) // 1000 + 1)), 413, "too_large"),
    ):
        assert (answer.status_code, answer.json()["code"]) == (status, code)
        assert answer.headers["content-type"] == "application/problem+json"
        assert answer.json()["detail"]
    assert (kept(one), one.get("/programs")) == before


def test_ten_gigabytes_are_refused_before_they_are_sent(one: Daemon) -> None:
    parts = urlsplit(one.url)
    with socket.create_connection((parts.hostname, parts.port), timeout=30) as raw:
        head = "POST /api/v1/programs?name=big.nc HTTP/1.1\r\nHost: {}\r\nContent-Length: 10000000000\r\n\r\n"
        raw.sendall(head.format(parts.netloc).encode())
        assert raw.recv(12) == b"HTTP/1.1 413"


@pytest.mark.skipif(not hasattr(resource, "prlimit"), reason="a disk can be made small on Linux only")
def test_a_full_disk_keeps_nothing_and_the_next_program_is_taken(one: Daemon) -> None:
    before = kept(one)
    with small_disk(one):
        answer = upload(one, LINE * (DISK // len(LINE) + 1))
    assert (answer.status_code, answer.json()["code"]) == (507, "disk_full")
    assert kept(one) == before
    assert upload(one, LINE * 10).status_code == 201
    assert len(kept(one)) == len(before) + 2, "the program and its index"


def test_an_upload_that_breaks_off_leaves_nothing(one: Daemon) -> None:
    before = kept(one)
    parts = urlsplit(one.url)
    with socket.create_connection((parts.hostname, parts.port)) as raw:
        head = f"POST /api/v1/programs?name=half.nc HTTP/1.1\r\nHost: {parts.netloc}\r\nContent-Length: 1000000\r\n\r\n"
        raw.sendall(head.encode() + LINE * 100)
        until(lambda: len(kept(one)) > len(before), why=one.log)
    until(lambda: kept(one) == before, why=one.log)


@pytest.mark.parametrize(
    ("body", "status", "code"),
    [
        (b'{"program": ', 400, "malformed_json"),
        (b"[" * 100_000, 400, "malformed_json"),
        (b"\xff\xfe", 400, "malformed_json"),
        (b"[]", 422, "invalid_request"),
        (b"null", 422, "invalid_request"),
        (b'{"program": "no", "machine": "mill", "colour": "red"}', 422, "invalid_request"),
        (b'{"program": 7, "machine": ["mill"]}', 422, "invalid_request"),
        (b'{"program": "no", "machine": "mill", "start_line": 1e400}', 422, "invalid_request"),
        (b'{"program": "no", "machine": "mill"}', 404, "unknown_program"),
        (b'{"program": "../../../etc/passwd", "machine": "mill"}', 404, "unknown_program"),
        (b'{"program": "no", "machine": "lathe"}', 404, "unknown_machine"),
    ],
)
def test_jobs_that_are_none(one: Daemon, body: bytes, status: int, code: str) -> None:
    answer = one.http.post("/api/v1/jobs", content=body, headers={"content-type": "application/json"})
    assert (answer.status_code, answer.json()["code"]) == (status, code), answer.text
    assert answer.headers["content-type"] == "application/problem+json"


def test_what_is_not_possible_now_is_told_with_the_reason(one: Daemon) -> None:
    machine = f"/api/v1/machines/{MACHINE}"
    for action in ("pause", "resume", "stop", "tool/confirm"):
        assert_conflict(one.http.post(f"{machine}/{action}"), "wrong_state")
    assert_conflict(one.http.patch(f"{machine}/overrides", json={"feed": 110}), "not_supported")
    job = one.job(b"G90\n" + b"\n".join(b"G1 X%d Y%d F1000" % (i % 100, i % 7) for i in range(1, 1000)))
    program = one.get(f"/jobs/{job}")["program"]
    one.status(job, "running")
    assert_conflict(one.http.post(f"{machine}/commands", json={"blocks": ["G0 X0"]}), "job_active")
    assert_conflict(one.http.post(f"{machine}/jog", json={"x": 1, "feed": 500}), "job_active")
    assert_conflict(one.http.post(f"{machine}/disconnect"), "job_active")
    assert_conflict(one.http.post(f"/api/v1/jobs/{job}/resume"), "wrong_state")
    assert_conflict(one.http.post(f"/api/v1/jobs/{job}/recover", json={"action": "continue"}), "wrong_state")
    assert_conflict(one.http.delete(f"/api/v1/programs/{program}"), "program_in_use")
    one.post(f"/jobs/{job}/cancel")
    one.status(job, "cancelled")
    for action in ("pause", "resume", "cancel"):
        assert_conflict(one.http.post(f"/api/v1/jobs/{job}/{action}"), "wrong_state")


def assert_conflict(answer: httpx.Response, code: str) -> None:
    assert (answer.status_code, answer.json()["code"]) == (409, code), answer.text
    assert len(answer.json()["detail"]) > 10
