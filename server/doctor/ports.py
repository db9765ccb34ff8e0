"""What can be wrong with a machine's port before anybody has spoken: absent, forbidden, held by somebody else.

Not the talking (doctor/ask.py). The one rule: looking opens nothing. Opening a serial port raises DTR, which restarts
an Arduino; whether that may be is the caller's to say.
"""

import grp
import os
import pwd
import stat
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from server.doctor.findings import Finding, error, info, ok, warning

PTY_MAJORS = range(136, 144)
"""Of the slaves of pseudo-terminals, Linux's devices.txt."""
MEDDLERS = {
    "ModemManager": "sudo systemctl disable --now ModemManager (or a udev rule with ENV{ID_MM_DEVICE_IGNORE}=1)",
    "brltty": "sudo apt-get remove brltty (it takes CH340 and CP210x for Braille displays)",
}
"""Services that open serial ports which appear, and speak to them."""
LOCK_FOLDERS = (Path("/run/lock"), Path("/var/lock"))
"""Of the old lock files `LCK..ttyUSB0`, which minicom and others still write."""

Kind = Literal["device", "pty", "tcp", "sim", "none"]


@dataclass(frozen=True, slots=True)
class Roots:
    """Where the system shows its processes and its devices; tests hand in their own."""

    proc: Path = Path("/proc")
    by_id: Path = Path("/dev/serial/by-id")
    locks: tuple[Path, ...] = LOCK_FOLDERS


@dataclass(frozen=True, slots=True)
class Holder:
    """A process that has the port open."""

    pid: int
    name: str


def kind_of(port: str) -> Kind:
    """What a port is: `none` where there is no such device."""
    if port.startswith("tcp://"):
        return "tcp"
    if port.startswith("sim:"):
        return "sim"
    try:
        found = Path(port).stat()
    except OSError:
        return "none"
    if not stat.S_ISCHR(found.st_mode):
        return "none"
    return "pty" if os.major(found.st_rdev) in PTY_MAJORS else "device"


def look(port: str, roots: Roots | None = None) -> Iterator[Finding]:
    """What is found about a port. An error among it: it is no use to open it."""
    roots = roots or Roots()
    match kind_of(port):
        case "tcp" | "sim":
            return
        case "none":
            yield _absent(port, roots)
        case kind:
            yield _permission(port)
            if kind == "device":
                yield from _holders(port, roots)
                yield from _name(port, roots)


def meddlers(roots: Roots | None = None) -> Iterator[Finding]:
    """Services that take hold of ports which appear."""
    found = {name for name in _processes(roots or Roots()).values() if name in MEDDLERS}
    for name in sorted(found):
        yield warning("meddler", f"{name} is running: it opens serial ports and speaks to them.", MEDDLERS[name])


def holders(port: str, roots: Roots) -> tuple[list[Holder], bool]:
    """The processes that have a device open, and whether all processes could be looked into."""
    device = Path(port).stat().st_rdev
    names, found, complete = _processes(roots), [], True
    for pid, name in names.items():
        if pid == os.getpid():
            continue
        try:
            files = list((roots.proc / str(pid) / "fd").iterdir())
        except PermissionError:
            complete = False
            continue
        except OSError:
            continue  # it has ended
        if any(_is_device(file, device) for file in files):
            found.append(Holder(pid, name))
    return found, complete


def _is_device(file: Path, device: int) -> bool:
    try:
        seen = file.stat()
    except OSError:
        return False
    return stat.S_ISCHR(seen.st_mode) and seen.st_rdev == device


def _processes(roots: Roots) -> dict[int, str]:
    found = {}
    try:
        entries = list(roots.proc.iterdir())
    except OSError:
        return {}  # no Linux
    for entry in entries:
        if entry.name.isdecimal():
            try:
                found[int(entry.name)] = (entry / "comm").read_text(encoding="utf-8", errors="replace").strip()
            except OSError:
                continue
    return found


def _absent(port: str, roots: Roots) -> Finding:
    path = Path(port)
    if path.exists():
        return error("port", f"{port} is no device.", "Set `port` to a serial device: `millstream ports` lists them.")
    there = _links(roots)
    known = f"There is {', '.join(there)}." if there else "No serial device is plugged in."
    if path.is_symlink():
        return error("port", f"{port} leads to {path.readlink()}, which is not there.", known)
    return error("port", f"{port} is not there.", f"{known} Is the cable in, the controller on? `dmesg` says more.")


def _links(roots: Roots) -> list[str]:
    try:
        return sorted(str(link) for link in roots.by_id.iterdir())
    except OSError:
        return []


def _permission(port: str) -> Finding:
    if os.access(port, os.R_OK | os.W_OK):
        return ok("permission", f"{port} may be read and written.")
    found = Path(port).stat()
    group, user = _group(found.st_gid), _user(os.getuid())
    rights = f"{stat.filemode(found.st_mode)} {_user(found.st_uid)}:{group}"
    if not found.st_mode & stat.S_IRGRP:
        advice = f"Only its owner may use it: a udev rule can give it to a group (now {rights})."
    elif _is_member(user, group):
        advice = f"{user} has been put into {group}, but not in this session: sign in again, or restart the service."
    else:
        advice = f"sudo usermod -aG {group} {user}, then sign in again (a service: SupplementaryGroups={group})."
    return error("permission", f"{user} may not use {port} ({rights}).", advice)


def _group(gid: int) -> str:
    try:
        return grp.getgrgid(gid).gr_name
    except KeyError:
        return str(gid)


def _user(uid: int) -> str:
    try:
        return pwd.getpwuid(uid).pw_name
    except KeyError:
        return str(uid)


def _is_member(user: str, group: str) -> bool:
    try:
        return user in grp.getgrnam(group).gr_mem
    except KeyError:
        return False


def _holders(port: str, roots: Roots) -> Iterator[Finding]:
    found, complete = holders(port, roots)
    for one in found:
        listed = [{"pid": one.pid, "name": one.name}]
        yield error("holder", f"{port} is held by {one.name} (process {one.pid}).", "End that first.", holders=listed)
    lock = _lock_file(port, roots)
    if lock is not None:
        yield warning("holder", f"{lock} says that somebody uses {port}.", "Remove it where nobody does.")
    if not found and complete:
        yield ok("holder", f"nobody holds {port}.")
    elif not found:
        yield info("holder", f"nobody of this user holds {port}; others cannot be seen.", "As root all can be.")


def _lock_file(port: str, roots: Roots) -> Path | None:
    name = f"LCK..{Path(port).resolve().name}"
    for folder in roots.locks:
        try:
            pid = (folder / name).read_text(encoding="ascii", errors="replace").split()[0]
        except (OSError, IndexError):
            continue
        if pid.isdecimal() and (roots.proc / pid).exists():
            return folder / name
    return None


def _name(port: str, roots: Roots) -> Iterator[Finding]:
    """A name that may be another device's after the next start."""
    if not Path(port).name.startswith(("ttyUSB", "ttyACM")):
        return
    device = Path(port).resolve()
    for link in _links(roots):
        if Path(link).resolve() == device:
            yield warning("name", f"{port} may be another device after a restart.", f'port = "{link}"', port=link)
            return
