"""LinuxCNC's `rs274` as an oracle: what it makes of a program, as motion in machine coordinates.

The interpreter prints canonical calls in the units and coordinates of the program; here they become the same plain
events that `events_of` makes of our Segments. Lengths in mm. The one rule: nothing of gcode/ is used to read them.
"""

import re
import shutil
import subprocess
from dataclasses import dataclass, field
from math import ceil, pi
from pathlib import Path

import pytest

from gcode.segments import CCW, CW, DWELL, FEED, PLANE_AXES, RAPID, Segments

AXES = "XYZABC"
_CALL = re.compile(r"\s*\d+ \S+\s+(\w+)\((.*)\)\s*$")
_PLANES = {"CANON_PLANE_XY": 17, "CANON_PLANE_XZ": 18, "CANON_PLANE_YZ": 19}
_SAME_MM = 1e-6


@dataclass(frozen=True)
class Event:
    """`kind` rapid, feed, arc or dwell. Arcs: centre in the plane's axes, `rotation` as LinuxCNC counts turns."""

    kind: str
    end: tuple[float, ...] = ()
    feed: float = 0.0
    centre: tuple[float, float] = (0.0, 0.0)
    rotation: int = 0
    dwell_s: float = 0.0


@dataclass
class _Canon:
    """Reads canonical calls. Offsets are kept in mm."""

    scale: float = 1.0
    system: list[float] = field(default_factory=lambda: [0.0] * 6)
    shift: list[float] = field(default_factory=lambda: [0.0] * 6)
    tool: list[float] = field(default_factory=lambda: [0.0] * 6)
    plane: int = 17
    feed: float = 0.0
    a_turn: bool = False
    speed: float = 0.0
    at: list[float] = field(default_factory=lambda: [0.0] * 6)
    events: list[Event] = field(default_factory=list)

    def machine(self, values: list[float]) -> tuple[float, ...]:
        scaled = self.scaled(values)
        return tuple(sum(parts) for parts in zip(scaled, self.system, self.shift, self.tool, strict=True))

    def scaled(self, values: list[float]) -> list[float]:
        return [value * (self.scale if row < 3 else 1.0) for row, value in enumerate(values)]

    def feed_mm_min(self) -> float:
        return self.feed * (self.speed if self.a_turn else 1.0)

    def call(self, name: str, text: str) -> None:
        numbers = [float(number) for number in re.findall(r"-?\d+\.?\d*", text)]
        match name:
            case "USE_LENGTH_UNITS":
                self.scale = 25.4 if text == "CANON_UNITS_INCHES" else 1.0
            case "SET_G5X_OFFSET":
                self.system = self.scaled(numbers[1:7])
            case "SET_G92_OFFSET":
                self.shift = self.scaled(numbers[:6])
            case "USE_TOOL_LENGTH_OFFSET":
                self.tool = self.scaled(numbers[:6])
            case "SELECT_PLANE":
                self.plane = _PLANES[text]
            case "SET_FEED_MODE":
                self.a_turn = numbers[1] == 1
            case "SET_FEED_RATE":
                self.feed = numbers[0] * self.scale
            case "SET_SPINDLE_SPEED":
                self.speed = numbers[-1]
            case "STRAIGHT_TRAVERSE" | "STRAIGHT_FEED":
                self.straight("rapid" if name == "STRAIGHT_TRAVERSE" else "feed", self.machine(numbers))
            case "ARC_FEED":
                self.arc(numbers)
            case "DWELL":
                self.events.append(Event("dwell", dwell_s=numbers[0]))

    def straight(self, kind: str, end: tuple[float, ...]) -> None:
        if max(abs(one - other) for one, other in zip(end, self.at, strict=True)) > 1e-4:
            self.events.append(Event(kind, end, self.feed_mm_min() if kind == "feed" else 0.0))
        self.at = list(end)

    def arc(self, numbers: list[float]) -> None:
        first, second, third = (AXES.index(axis) for axis in PLANE_AXES[self.plane])
        place = [0.0] * 6
        place[first], place[second], place[third], place[3:] = numbers[0], numbers[1], numbers[5], numbers[6:9]
        middle = [0.0] * 6
        middle[first], middle[second] = numbers[2], numbers[3]
        end, centre = self.machine(place), self.machine(middle)
        self.events.append(Event("arc", end, self.feed_mm_min(), (centre[first], centre[second]), int(numbers[4])))
        self.at = list(end)


def run_rs274(program: str, folder: Path) -> list[Event]:
    """What LinuxCNC makes of a program; the test is skipped, and says so, where it is not installed."""
    binary = shutil.which("rs274")
    if binary is None:
        pytest.skip("rs274 (package linuxcnc-uspace) is not installed: nothing was compared with LinuxCNC")
    source = folder / "program.ngc"
    source.write_text(program)
    (folder / "oracle.var").touch()
    # The tool table is a file in the home folder, which two runs at a time must not share.
    done = subprocess.run(
        [binary, "-g", "-v", "oracle.var", source.name],
        cwd=folder,
        env={"HOME": str(folder), "PATH": "/usr/bin:/bin"},
        capture_output=True,
        text=True,
        timeout=20,
        check=False,
    )
    errors = [line for line in done.stderr.splitlines() if line.strip() and line.strip() != "executing"]
    assert not errors, f"LinuxCNC refuses the program: {errors}\n{program}"
    assert "PROGRAM_END" in done.stdout, f"rs274 broke off with {done.returncode}: {done.stdout[-300:]}"
    canon = _Canon()
    for line in done.stdout.splitlines():
        if call := _CALL.match(line):
            canon.call(call[1], call[2])
    return canon.events


def events_of(segments: Segments) -> list[Event]:
    """Our motion as the same events."""
    found = []
    for n in range(len(segments)):
        end = tuple(float(value) for value in segments.end[:6, n])
        kind, feed = int(segments.kind[n]), float(segments.feed[n])
        if kind == DWELL:
            found.append(Event("dwell", dwell_s=float(segments.dwell_s[n])))
        elif kind in (CW, CCW):
            first, second, _ = (AXES.index(axis) for axis in PLANE_AXES[int(segments.plane[n])])
            centre = (
                float(segments.start[first, n] + segments.centre[0, n]),
                float(segments.start[second, n] + segments.centre[1, n]),
            )
            turns = ceil(abs(float(segments.sweep[n])) / (2 * pi) - _SAME_MM)
            found.append(Event("arc", end, feed, centre, turns if segments.sweep[n] > 0 else -turns))
        elif not abs(segments.way[:, n]).max() <= 1e-4:  # NaN: a move from somewhere
            assert kind in (RAPID, FEED)
            found.append(Event("rapid" if kind == RAPID else "feed", end, feed if kind == FEED else 0.0))
    return found
