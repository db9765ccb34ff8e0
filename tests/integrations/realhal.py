"""LinuxCNC's HAL without real time, as a user who may do nothing else, for tests of the component.

LinuxCNC refuses to run as root, and its HAL belongs to one user of the computer at a time: as root the tests take the
user nobody, and a lock keeps two of them apart. The one rule: nothing of it outlives the test, and a HAL that somebody
else is using is left alone.
"""

import fcntl
import os
import shutil
import signal
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
import websockets

from tests.harness.process import until

PYTHON = "/usr/bin/python3"
"""LinuxCNC's `hal` module is for the Python of the system."""
REALTIME = "/usr/lib/linuxcnc/realtime"
NOBODY = 65534
WITHIN_S = 20.0
LOCK = Path(tempfile.gettempdir()) / f"millstream-hal-{os.getuid()}.lock"


def needed() -> None:
    """Skip where there is no LinuxCNC."""
    for program in ("halrun", "halcmd", "setpriv", PYTHON, REALTIME):
        if shutil.which(program) is None:
            pytest.skip(f"{program} is missing: this needs Debian's linuxcnc-uspace (and util-linux)")
    if subprocess.run([PYTHON, "-c", "import hal"], capture_output=True, timeout=30, check=False).returncode:
        pytest.skip(f"{PYTHON} has no module hal: this needs Debian's linuxcnc-uspace")


class Hal:
    """A `halrun` with its standard input as the console. `folder` is the home of its user."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._process: subprocess.Popen[str] | None = None
        self._as = ["setpriv", f"--reuid={NOBODY}", f"--regid={NOBODY}", "--clear-groups"] if os.getuid() == 0 else []
        self._environ = {"HOME": str(folder), "PATH": "/usr/bin:/bin", "PYTHONPATH": str(folder), "NO_PROXY": "*"}

    def run(self, *command: str) -> subprocess.CompletedProcess[str]:
        """A command as the user of the HAL."""
        return subprocess.run(
            [*self._as, *command], cwd=self.folder, env=self._environ, capture_output=True, text=True,
            timeout=WITHIN_S, check=False,
        )  # fmt: skip

    def file(self, name: str, text: str) -> None:
        """In the home, the user's own."""
        path = self.folder / name
        path.write_text(text, encoding="utf-8")
        if os.getuid() == 0:
            os.chown(path, NOBODY, NOBODY)

    def whole(self, *command: str, within_s: float) -> None:
        """Run something that loads a HAL of its own, to its end."""
        with (self.folder / "hal.log").open("a") as log:
            self._process = subprocess.Popen(
                [*self._as, *command], cwd=self.folder, env=self._environ,
                stdin=subprocess.DEVNULL, stdout=log, stderr=subprocess.STDOUT, start_new_session=True, text=True,
            )  # fmt: skip
        try:
            code = self._process.wait(within_s)
        finally:
            self.close()
        assert code == 0, self.log()

    def start(self, text: str) -> None:
        """Load a HAL file; returns when every line of it has been carried out."""
        (self.folder / "test.hal").write_text(f"{text}\nloadusr -w touch up\n", encoding="utf-8")
        with (self.folder / "hal.log").open("a") as log:
            self._process = subprocess.Popen(
                [*self._as, "halrun", "-I", "-f", "test.hal"], cwd=self.folder, env=self._environ,
                stdin=subprocess.PIPE, stdout=log, stderr=subprocess.STDOUT, text=True, start_new_session=True,
            )  # fmt: skip
        until((self.folder / "up").exists, within_s=WITHIN_S, why=self.log)

    def pin(self, name: str) -> str:
        """What is on a pin now, as halcmd prints it."""
        return self.run("halcmd", "getp", name).stdout.strip()

    def wait(self, **levels: str) -> None:
        """Until pins of the component (written with `_`) are so."""
        for name, value in levels.items():
            pin = f"iocontrol.0.{name.replace('_', '-')}"
            until(lambda pin=pin, value=value: self.pin(pin) == value, within_s=WITHIN_S, why=lambda: self.pins())  # type: ignore[misc]

    def pins(self) -> str:
        return self.run("halcmd", "show", "pin").stdout + self.log()

    def pid(self, script: str) -> int:
        """Of a program that this HAL has loaded."""
        assert self._process is not None
        listed = subprocess.run(
            ["ps", "-s", str(self._process.pid), "-o", "pid=,args="], capture_output=True, text=True, check=True
        ).stdout.splitlines()
        (found,) = [line for line in listed if script in line and "halcmd" not in line and "halrun" not in line]
        return int(found.split()[0])

    def log(self) -> str:
        return (self.folder / "hal.log").read_text(encoding="utf-8")

    def end(self) -> int:
        """As somebody at the console ends it: everything that was loaded goes, too."""
        assert self._process is not None
        assert self._process.stdin is not None
        self._process.stdin.close()
        try:
            return self._process.wait(WITHIN_S)
        finally:
            self.close()

    def close(self) -> None:
        """Whatever is left of it."""
        process, self._process = self._process, None
        if process is None:
            return
        if process.stdin is not None:
            process.stdin.close()
        for number in (signal.SIGTERM, signal.SIGKILL):
            try:
                os.killpg(process.pid, number)
                process.wait(2.0)
            except (ProcessLookupError, subprocess.TimeoutExpired):
                continue
        self.run("halrun", "-U")


@contextmanager
def hal() -> Iterator[Hal]:
    """A HAL that nobody else has, in a home with the component, the programs of the tests and `websockets` in it."""
    needed()
    with LOCK.open("a") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        folder = Path(tempfile.mkdtemp(prefix="millstream-hal-"))
        one = Hal(folder)
        try:
            if subprocess.run([REALTIME, "status"], capture_output=True, timeout=30, check=False).returncode == 0:
                pytest.skip("somebody's LinuxCNC is running on this computer: its HAL is left alone")
            root = Path(__file__).parents[2]
            for script in (
                root / "integrations/linuxcnc_hal/millstream_hal.py",
                Path(__file__).with_name("hal_changer.py"),
                Path(__file__).with_name("iocontrol_player.py"),
            ):
                Path(shutil.copy(script, folder)).chmod(0o755)
            if one.run(PYTHON, "-c", "import websockets").returncode:  # as `apt install python3-websockets` would
                shutil.copytree(Path(websockets.__file__).parent, folder / "websockets")
            folder.chmod(0o755)
            if os.getuid() == 0:
                os.chown(folder, NOBODY, NOBODY)
            yield one
        finally:
            one.close()
            shutil.rmtree(folder, ignore_errors=True)
