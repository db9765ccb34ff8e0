"""The HAL component in a real HAL of LinuxCNC, with the HAL file of its README, and a real daemon: whole tool changes,
and what becomes of them when one side dies. Skipped where LinuxCNC is not installed.

One story, for a HAL, a daemon and a virtual mill take their second each to come up, and a computer has one HAL. The one
rule: what counts is what stands on the pins and what the changer saw, not what the daemon says of itself.
"""

import os
import re
import signal
from pathlib import Path
from typing import Any

import pytest

from tests.harness.process import MACHINE, Daemon, daemon, sim_process, until
from tests.integrations.realhal import Hal, hal

pytestmark = [pytest.mark.real, pytest.mark.slow]

README = Path(__file__).parents[2] / "integrations/linuxcnc_hal/README.md"
CHANGER = """
[machine.toolchanger]
kind = "external"
support_start_change = true
"""
TWO_TOOLS = "G90\nG1 X1 F6000\nT2 M6\nG1 X2\nT3 M6\nG1 X3\nM30\n"


def hal_file(url: str) -> str:
    """That of the README for this daemon, and the changer of these tests in the place of the reader's."""
    (text,) = re.findall(r"```\n(loadusr.*?)```", README.read_text(encoding="utf-8"), re.DOTALL)
    before, loading, rest = text.partition(
        "--url http://mill.local:8420 --machine router --token-file /etc/millstream/hal.token"
    )
    assert loading
    rest = rest.replace("watchdog.timeout-0 1.0", "watchdog.timeout-0 30")  # others use this computer, too
    assert "timeout-0 30" in rest
    return (
        f"loadusr -Wn changer ./hal_changer.py {{record}}\n{before}--url {url} --machine {MACHINE}{rest}"
        "net abort => changer.abort\nnet reason iocontrol.0.emc-reason => changer.reason\n"
    ).replace("{record}", "changer.txt")


def io(one: Daemon) -> Any:
    return one.get(f"/machines/{MACHINE}/io")


def freed(one: Daemon, way: str = "reset") -> None:
    """Out of the e-stop in which a daemon with an external changer starts; asked for again, as a person would, where
    this computer was too slow for the time that the chain has."""
    one.connected()
    until(lambda: io(one)["connected"], why=one.log)

    def is_free() -> bool:
        one.post(f"/machines/{MACHINE}/{way}")
        until(lambda: io(one)["estop"] != "resetting")
        return bool(io(one)["estop"] == "enabled")

    until(is_free, why=lambda: io(one))


class Story:
    """A HAL, a daemon, and what the changer has seen since the last look."""

    def __init__(self, hal: Hal, one: Daemon) -> None:
        self.hal = hal
        self.daemon = one
        self._looked = 0

    def seen(self) -> list[str]:
        lines = (self.hal.folder / "changer.txt").read_text(encoding="utf-8").splitlines()
        new, self._looked = lines[self._looked :], len(lines)
        return new

    def set(self, pin: str, value: str) -> None:
        """Of what nothing else drives."""
        assert self.hal.run("halcmd", "setp", pin, value).returncode == 0

    def waits_for(self, tool: int) -> int:
        """A job whose change of tools has begun, at a changer that does not answer; its number."""
        self.set("changer.jammed", "TRUE")
        job = self.daemon.job(f"G1 X1 F6000\nT{tool} M6\nG1 X3\nM30\n")
        self.hal.wait(tool_change="TRUE", tool_prep_number=str(tool))
        self.daemon.status(job, "waiting")
        return job


def whole_changes(story: Story) -> None:
    """Two tools, each in its turn."""
    freed(story.daemon)
    story.hal.wait(emc_abort="FALSE", emc_enable_in="TRUE", user_request_enable="FALSE")
    story.seen()
    story.daemon.status(story.daemon.job(TWO_TOOLS), "completed")
    story.hal.wait(tool_number="3", tool_change="FALSE", tool_prep_number="0")
    seen = story.seen()
    assert [line for line in seen if "^" in line and line.startswith("change")] == ["change^ 2", "change^ 3"]
    assert [line for line in seen if "^" in line and line.startswith("prepare")] == ["prepare^ 2", "prepare^ 3"]
    assert len(seen) == 8, seen


def a_late_answer(story: Story) -> None:
    """The request stands until the changer answers."""
    job = story.waits_for(5)
    assert story.hal.pin("iocontrol.0.tool-number") == "3"
    story.set("changer.jammed", "FALSE")
    story.daemon.status(job, "completed")
    story.hal.wait(tool_number="5", tool_change="FALSE")


def the_chain_opens(story: Story) -> None:
    """The latch of the plant opens: an external e-stop. Its return switches nothing on."""
    story.set("estop-latch.0.fault-in", "TRUE")
    story.hal.wait(emc_enable_in="FALSE", emc_reason="2", user_enable_out="TRUE")
    until(lambda: io(story.daemon)["estop"] == "external")
    story.set("estop-latch.0.fault-in", "FALSE")
    assert story.hal.pin("estop-latch.0.ok-out") == "FALSE"
    freed(story.daemon)
    story.hal.wait(emc_enable_in="TRUE", emc_reason="5", emc_abort="FALSE")


def somebody_presses_the_emergency_stop(story: Story) -> None:
    story.daemon.post(f"/machines/{MACHINE}/estop")
    story.hal.wait(user_enable_out="FALSE", emc_enable_in="FALSE", emc_reason="6")
    story.daemon.connected()
    freed(story.daemon)
    story.hal.wait(user_enable_out="TRUE", emc_enable_in="TRUE", emc_abort="FALSE")


def the_daemon_dies(story: Story) -> None:
    """In the middle of a change: no request stands, and the abort line is up, until there is a daemon again."""
    story.seen()
    job = story.waits_for(6)
    story.daemon.kill9()
    story.hal.wait(tool_change="FALSE", tool_prepare="FALSE", emc_abort="TRUE", emc_reason="1")
    story.daemon.start()
    freed(story.daemon, "unlock")  # it starts in an e-stop, and asks for the tool behind it
    story.hal.wait(tool_change="TRUE", tool_prep_number="6", emc_abort="FALSE")
    assert story.seen()[-2:] == ["prepare_", "change^ 6"]
    story.set("changer.jammed", "FALSE")
    story.daemon.status(job, "paused")  # nobody may know any more that the machine is about to move
    story.hal.wait(tool_number="6")
    story.daemon.post(f"/jobs/{job}/resume")
    story.daemon.status(job, "completed")


def the_component_dies(story: Story) -> None:
    """Nobody drives its pins any more: the watchdog opens the chain, and the daemon remembers a fault."""
    story.set("watchdog.timeout-0", "0.3")
    os.kill(story.hal.pid("millstream_hal.py"), signal.SIGKILL)
    until(lambda: not io(story.daemon)["connected"])
    assert io(story.daemon)["faulted"]
    assert io(story.daemon)["parameters"]["#5601"] == -1000
    until(lambda: story.hal.pin("estop-latch.0.ok-out") == "FALSE")


def test_tool_changes_in_a_real_hal(tmp_path: Path) -> None:
    with (
        hal() as one_hal,
        sim_process(tmp_path, "--speed", "50") as (port, _),
        daemon(tmp_path, port, machine=CHANGER) as one,
    ):
        url = one.url
        toml = tmp_path / "millstream.toml"  # the next daemon is where the component looks for it
        toml.write_text(toml.read_text().replace("port = 0", f"port = {url.rpartition(':')[2].strip('/')}"))
        one_hal.start(hal_file(url))
        story = Story(one_hal, one)
        for chapter in (
            whole_changes,
            a_late_answer,
            the_chain_opens,
            somebody_presses_the_emergency_stop,
            the_daemon_dies,
            the_component_dies,
        ):
            chapter(story)
        assert one_hal.end() == 0
