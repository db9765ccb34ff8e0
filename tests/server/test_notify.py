"""What systemd hears: over a socket of ours in its place, by a path and by an abstract name."""

import asyncio
import os
import socket
import sys
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import pytest

from server.notify import MOST_STATUS_CHARS, STATUS_EVERY_S, Notifier, keep_telling
from server.problems import ProblemError
from tests.harness.simloop import run_simulated


class Manager:
    """The other end of NOTIFY_SOCKET."""

    def __init__(self, address: str) -> None:
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.socket.bind(address)
        self.socket.setblocking(False)

    def heard(self) -> list[str]:
        """What has come since the last look."""
        messages = []
        while True:
            try:
                messages.append(self.socket.recv(4096).decode())
            except BlockingIOError:
                return messages


@contextmanager
def manager(address: str) -> Iterator[Manager]:
    one = Manager(address)
    with closing(one.socket):
        yield one


@contextmanager
def notifier(**environ: str) -> Iterator[Notifier]:
    with closing(Notifier(environ)) as one:
        yield one


class FakeDb:
    """A database that answers, refuses or hangs."""

    def __init__(self) -> None:
        self.trouble: str | None = None
        self.hangs = False

    async def run(self, _fn: object) -> None:
        if self.hangs:
            await asyncio.Event().wait()
        if self.trouble is not None:
            raise ProblemError("disk_full", self.trouble)


def test_a_life_over_a_path(tmp_path: Path) -> None:
    path = str(tmp_path / "notify")
    with manager(path) as systemd, notifier(NOTIFY_SOCKET=path) as one:
        assert one
        one.ready()
        one.status("2 of 3\nmachines\tconnected" + "x" * 500)
        one.alive()
        one.stopping()
        ready, status, alive, stopping = systemd.heard()
        assert (ready, alive, stopping) == ("READY=1", "WATCHDOG=1", "STOPPING=1")
        assert status.startswith("STATUS=2 of 3 machines connected")
        assert len(status) == len("STATUS=") + MOST_STATUS_CHARS


@pytest.mark.skipif(sys.platform != "linux", reason="abstract names are Linux's")
def test_an_abstract_name() -> None:
    name = f"millstream-test-{os.getpid()}"
    with manager("\0" + name) as systemd, notifier(NOTIFY_SOCKET="@" + name) as one:
        one.ready()
        assert systemd.heard() == ["READY=1"]


@pytest.mark.parametrize("name", [None, "", "relative/name", "vsock:2:1234"])
def test_without_a_manager_nothing_happens(name: str | None) -> None:
    with notifier(**({} if name is None else {"NOTIFY_SOCKET": name})) as one:
        assert not one
        one.ready()
        one.status("ignored")


def test_a_manager_that_went_away_or_does_not_read_stops_nothing(tmp_path: Path) -> None:
    path = str(tmp_path / "notify")
    with notifier(NOTIFY_SOCKET=path) as one:
        one.ready()
        with manager(path) as systemd:
            for _ in range(5000):
                one.alive()
            assert 0 < len(systemd.heard()) < 5000


@pytest.mark.parametrize(
    ("environ", "seconds"),
    [
        ({}, None),
        ({"WATCHDOG_USEC": "30000000"}, 30.0),
        ({"WATCHDOG_USEC": "30000000", "WATCHDOG_PID": str(os.getpid())}, 30.0),
        ({"WATCHDOG_USEC": "30000000", "WATCHDOG_PID": "1"}, None),
        ({"WATCHDOG_USEC": "0"}, None),
        ({"WATCHDOG_USEC": "soon"}, None),
    ],
)
def test_the_watchdog_of_the_manager(environ: dict[str, str], seconds: float | None) -> None:
    with notifier(**environ) as one:
        assert one.watchdog_s == seconds


def test_the_watchdog_hears_from_a_daemon_that_lives_and_from_no_other(tmp_path: Path) -> None:
    path, db = str(tmp_path / "notify"), FakeDb()
    with manager(path) as systemd, notifier(NOTIFY_SOCKET=path, WATCHDOG_USEC="30000000") as one:

        async def main() -> None:
            telling = asyncio.create_task(keep_telling(one, db, lambda: "all is well"))  # type: ignore[arg-type]
            await asyncio.sleep(29)
            assert systemd.heard() == ["STATUS=all is well", *["WATCHDOG=1"] * 3]
            db.trouble = "database or disk is full"
            await asyncio.sleep(20)
            said = systemd.heard()
            assert said[0] == "STATUS=The database cannot be written: database or disk is full"
            assert said[1:] == ["WATCHDOG=1"] * 2, "a full disk is not cured by a new start"
            db.hangs = True
            await asyncio.sleep(600)
            assert systemd.heard() == []
            telling.cancel()

        run_simulated(main())


def test_without_a_watchdog_the_sentence_is_renewed_where_it_has_changed(tmp_path: Path) -> None:
    path, sentence = str(tmp_path / "notify"), "one"
    with manager(path) as systemd, notifier(NOTIFY_SOCKET=path) as notifying:

        async def main() -> None:
            nonlocal sentence
            telling = asyncio.create_task(keep_telling(notifying, FakeDb(), lambda: sentence))  # type: ignore[arg-type]
            await asyncio.sleep(3 * STATUS_EVERY_S)
            sentence = "two"
            await asyncio.sleep(3 * STATUS_EVERY_S)
            assert systemd.heard() == ["STATUS=one", "STATUS=two"]
            telling.cancel()

        run_simulated(main())
