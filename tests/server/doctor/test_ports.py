"""Ports that are absent, forbidden, held by others: on ptys, and on a /proc and a /dev/serial of our own."""

import os
import stat
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from server.doctor import ports as doctorports
from server.doctor.findings import Finding, Level
from server.doctor.ports import Roots, holders, kind_of, look, meddlers


@pytest.fixture
def pty() -> Iterator[str]:
    master, slave = os.openpty()
    yield os.ttyname(slave)
    os.close(master)
    os.close(slave)


@pytest.fixture
def roots(tmp_path: Path) -> Roots:
    for folder in ("proc", "by-id", "lock"):
        (tmp_path / folder).mkdir()
    return Roots(proc=tmp_path / "proc", by_id=tmp_path / "by-id", locks=(tmp_path / "lock",))


def process(roots: Roots, pid: int, name: str, *opened: str) -> None:
    """A process that has these files open."""
    folder = roots.proc / str(pid)
    (folder / "fd").mkdir(parents=True)
    (folder / "comm").write_text(name + "\n")
    for number, path in enumerate(opened):
        (folder / "fd" / str(number)).symlink_to(path)


def levels(found: list[Finding]) -> dict[str, Level]:
    return {finding.check: finding.level for finding in found}


def as_device(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ptys count as serial devices."""
    monkeypatch.setattr(doctorports, "PTY_MAJORS", range(0))


@pytest.mark.parametrize(
    ("port", "kind"),
    [("tcp://mill:23", "tcp"), ("sim:?speed_factor=20", "sim"), ("/dev/ttyNOTHERE", "none"), ("/dev/null", "device")],
)
def test_kinds(port: str, kind: str) -> None:
    assert kind_of(port) == kind


def test_a_pty_is_one_and_a_file_is_no_port(pty: str, tmp_path: Path) -> None:
    assert kind_of(pty) == "pty"
    (tmp_path / "file").write_text("")
    assert kind_of(str(tmp_path / "file")) == "none"
    (found,) = look(str(tmp_path / "file"))
    assert "no device" in found.message


def test_a_port_that_is_absent_names_what_is_there(roots: Roots, tmp_path: Path) -> None:
    (roots.by_id / "usb-1a86_USB_Serial-if00-port0").symlink_to("/dev/null")
    (found,) = look("/dev/ttyUSB77", roots)
    assert found.level is Level.ERROR
    assert "usb-1a86" in found.advice
    link = tmp_path / "gone"
    link.symlink_to("/dev/ttyUSB78")
    (found,) = look(str(link), roots)
    assert "leads to /dev/ttyUSB78, which is not there" in found.message


def test_who_holds_it(pty: str, roots: Roots, monkeypatch: pytest.MonkeyPatch) -> None:
    as_device(monkeypatch)
    process(roots, 40, "candle", "/dev/null", pty)
    process(roots, 41, "other", "/dev/null", "/nowhere")
    process(roots, os.getpid(), "ourselves", pty)
    found, complete = holders(pty, roots)
    assert ([(one.pid, one.name) for one in found], complete) == ([(40, "candle")], True)
    told = [finding for finding in look(pty, roots) if finding.check == "holder"]
    assert [(one.level, one.message) for one in told] == [(Level.ERROR, f"{pty} is held by candle (process 40).")]


def test_the_real_proc_shows_another_process_that_holds_it(pty: str) -> None:
    child = os.fork()
    if child == 0:  # it has inherited the pty, and waits for its end
        import signal

        signal.pause()
    try:
        found, _ = holders(pty, Roots())
        assert child in {one.pid for one in found}
    finally:
        os.kill(child, 9)
        os.waitpid(child, 0)


def test_nobody_holds_it_and_processes_that_cannot_be_seen(
    pty: str, roots: Roots, monkeypatch: pytest.MonkeyPatch
) -> None:
    as_device(monkeypatch)
    process(roots, 40, "candle", "/dev/null")
    assert levels(list(look(pty, roots)))["holder"] is Level.OK
    real = Path.iterdir

    def forbidden(path: Path) -> Any:
        if path.name == "fd":
            raise PermissionError
        return real(path)

    monkeypatch.setattr(Path, "iterdir", forbidden)
    assert levels(list(look(pty, roots)))["holder"] is Level.INFO


def test_a_lock_file_of_a_living_process_counts(pty: str, roots: Roots, monkeypatch: pytest.MonkeyPatch) -> None:
    as_device(monkeypatch)
    lock = roots.locks[0] / f"LCK..{Path(pty).name}"
    lock.write_text("        40\n")
    assert not [one for one in look(pty, roots) if one.level is Level.WARNING]
    process(roots, 40, "minicom")
    assert [one.message for one in look(pty, roots) if one.level is Level.WARNING] == [
        f"{lock} says that somebody uses {pty}."
    ]


def test_a_port_that_is_not_ours_says_which_group_to_join(
    pty: str, roots: Roots, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "access", lambda *_: False)
    monkeypatch.setattr(doctorports, "_user", lambda uid: f"user{uid}")
    monkeypatch.setattr(doctorports, "_group", lambda _gid: "dialout")
    monkeypatch.setattr(doctorports, "_is_member", lambda *_: False)
    Path(pty).chmod(0o660)
    (found,) = look(pty, roots)
    assert found.level is Level.ERROR
    assert "usermod -aG dialout" in found.advice
    monkeypatch.setattr(doctorports, "_is_member", lambda *_: True)
    (found,) = look(pty, roots)
    assert "sign in again" in found.advice
    Path(pty).chmod(stat.S_IRUSR | stat.S_IWUSR)
    (found,) = look(pty, roots)
    assert "udev" in found.advice


def test_a_name_that_stays_is_advised(pty: str, roots: Roots, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    as_device(monkeypatch)
    port = tmp_path / "ttyUSB0"
    port.symlink_to(pty)
    (roots.by_id / "usb-FTDI-if00").symlink_to(pty)
    found = {finding.check: finding for finding in look(str(port), roots)}
    assert found["name"].level is Level.WARNING
    assert found["name"].advice == f'port = "{roots.by_id}/usb-FTDI-if00"'
    assert "name" not in levels(list(look(str(roots.by_id / "usb-FTDI-if00"), roots)))


def test_services_that_meddle_with_ports_are_named(roots: Roots) -> None:
    process(roots, 50, "ModemManager")
    process(roots, 51, "sshd")
    (found,) = meddlers(roots)
    assert "ModemManager" in found.message
    assert found.level is Level.WARNING


def test_numbers_without_a_name_and_processes_that_end_meanwhile(pty: str, roots: Roots) -> None:
    assert doctorports._group(987654) == "987654"
    assert doctorports._user(987654) == "987654"
    assert not doctorports._is_member("root", "no-such-group")
    (roots.proc / "60").mkdir()
    (roots.proc / "61").mkdir()
    (roots.proc / "61" / "comm").write_text("gone\n")
    assert holders(pty, roots) == ([], True)
    assert list(meddlers(Roots(proc=roots.proc / "nowhere"))) == []
    assert doctorports._links(Roots(by_id=roots.by_id / "nowhere")) == []
