"""LinuxCNC's own I/O control (milltask and iov2, without real time) under the rows of the changer's table.

A whole LinuxCNC, without a display, in a folder of its own; `iocontrol_player` is in the display's place, and the
pins are read by HAL's `sampler` once a millisecond. The one rule: nothing of it outlives `played`.
"""

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from tests.harness.changerrows import Row
from tests.integrations.realhal import Hal

WITHIN_S = 60.0
BITS = (
    "user-enable-out", "user-request-enable", "tool-prepare", "tool-change", "start-change", "emc-abort",
    "toolchanger-fault-ack", "toolchanger-faulted", "coolant-flood",
)  # fmt: skip
NUMBERS = ("tool-prep-number", "tool-prep-pocket", "tool-prep-index", "tool-number", "emc-reason")
INPUTS = (
    "emc-enable-in", "tool-prepared", "tool-changed", "start-change-ack", "emc-abort-ack", "toolchanger-fault",
)  # fmt: skip
PINS = (*INPUTS, *BITS, *NUMBERS)
"""With the number of the row all that a sampler takes; of what is seen at once the inputs were first. Left out: mist,
which is as flood, and the two below."""
NOT_SEEN = ("toolchanger-reason", "toolchanger-clear-fault")
"""What the changer says of its fault, which the row has anyway."""

REASONS = {"emc-reason=8": "emc-reason=100", "emc-reason=10": "emc-reason=1"}
"""The program's numbers for an abort by a user's command and for an error of the interpreter; ours are the page's."""

FALLS = ("tool-prepared_", "tool-changed_", "start-change-ack_", "emc-abort-ack_")

TOGETHER_SAMPLES = 3
"""The program works every five; what it sets in one turn may fall between two samples."""

INI = """
[EMC]
VERSION = 1.1
MACHINE = rows
[DISPLAY]
DISPLAY = ./iocontrol_player.py
[RS274NGC]
PARAMETER_FILE = rows.var
[EMCMOT]
EMCMOT = motmod
SERVO_PERIOD = 1000000
[TASK]
TASK = milltask
CYCLE_TIME = 0.002
[HAL]
HALFILE = rows.hal
[TRAJ]
COORDINATES = X Y Z
LINEAR_UNITS = mm
ANGULAR_UNITS = degree
DEFAULT_LINEAR_VELOCITY = 100
MAX_LINEAR_VELOCITY = 100
NO_FORCE_HOMING = 1
[EMCIO]
EMCIO = iov2 -support-start-change
PROTOCOL_VERSION = 2
CYCLE_TIME = 0.005
TOOL_TABLE = rows.tbl
[KINS]
KINEMATICS = trivkins
JOINTS = 3
"""
AXIS = """[AXIS_{axis}]
MIN_LIMIT = -100
MAX_LIMIT = 100
MAX_VELOCITY = 100
MAX_ACCELERATION = 1000
[JOINT_{joint}]
TYPE = LINEAR
MIN_LIMIT = -100
MAX_LIMIT = 100
MAX_VELOCITY = 100
MAX_ACCELERATION = 1000
"""
TABLE = "".join(f"T{number} P{number} D6\n" for number in range(1, 6))


def hal_text() -> str:
    kinds = "b" * len((*INPUTS, *BITS)) + "s" * len((*NUMBERS, "row"))
    return "\n".join([
        "loadrt trivkins",
        "loadrt motmod servo_period_nsec=1000000 num_joints=3",
        "loadrt siggen",
        f"loadrt sampler depth=16384 cfg={kinds}",
        *(f"addf {part} servo-thread" for part in
          ("motion-command-handler", "motion-controller", "sampler.0", "siggen.0.update")),
        *(f"net place-{joint} joint.{joint}.motor-pos-cmd => joint.{joint}.motor-pos-fb" for joint in range(3)),
        *(f"net {pin} iocontrol.0.{pin} => sampler.0.pin.{column}" for column, pin in enumerate(PINS)),
        *(f"net {pin} iocontrol.0.{pin}" for pin in NOT_SEEN),
        f"net row sampler.0.pin.{len(PINS)}",
        "loadusr halsampler -t samples.txt",
    ]) + "\n"  # fmt: skip


@dataclass(frozen=True, slots=True)
class Played:
    """What came of a row. `sequence`: steps as in the table; `missed`: steps that waited in vain; `told`: to people;
    `parameters`: #5060, #5600, #5601, where the row has any."""

    sequence: list[set[str]]
    missed: list[Any]
    told: list[str]
    parameters: list[float] | None


def played(hal: Hal, rows: Sequence[Row], *, random: bool = False) -> dict[str, Played]:
    """By the rows' names. `random`: at a changer that puts tools where there is room, with the table of the row."""
    table = rows[0].table if random else TABLE
    files = {
        "rows.ini": INI.replace("[KINS]", f"RANDOM_TOOLCHANGER = {int(random)}\n[KINS]")
        + "".join(AXIS.format(axis=axis, joint=joint) for joint, axis in enumerate("XYZ")),
        "rows.hal": hal_text(),
        "rows.tbl": table or "",
        "rows.var": "",
        "rows.json": json.dumps([
            {"steps": row.steps, "spindle": None if random else row.spindle, "parameters": any(row.parameters),
             "starts": _starts(row)} for row in rows
        ]),
    }  # fmt: skip
    for name, text in files.items():
        hal.file(name, text)
    hal.whole("linuxcnc", "-r", "rows.ini", within_s=WITHIN_S)
    records = json.loads((hal.folder / "records.json").read_text(encoding="utf-8"))
    with (hal.folder / "samples.txt").open(encoding="utf-8") as samples:
        found = sequences(samples)
    return {
        row.name: Played(compared(found.get(number, []), starts=_starts(row)), **record)
        for number, (row, record) in enumerate(zip(rows, records, strict=True), 1)
    }


def _starts(row: Row) -> bool:
    return bool(row.settings.get("support_start_change"))


def sequences(samples: Iterable[str]) -> dict[int, list[list[str]]]:
    """Row by row the steps of the pins, in the table's notation."""
    found: dict[int, list[list[str]]] = {}
    before: list[str] = []
    row, side, at = 0, "", 0
    for line in samples:
        sample, *values, number = line.split()
        if int(number) != row:
            row, side = int(number), ""
        elif row:
            for pin, old, new in zip(PINS, before, values, strict=True):
                if old == new:
                    continue
                of = "in" if pin in INPUTS else "out"
                steps = found.setdefault(row, [])
                if of != side or int(sample) - at > TOGETHER_SAMPLES:
                    steps.append([])
                side, at = of, int(sample)
                steps[-1].append(f"{pin}={new}" if pin in NUMBERS else f"{pin}{'^' if new == '1' else '_'}")
        before = values
    return found


def expected(row: Row, sequence: str) -> list[set[str]]:
    """A sequence in the table's notation as far as it is seen here."""
    return compared([step.split(", ") for step in sequence.split(" | ")], starts=_starts(row))


def compared(sequence: Iterable[Iterable[str]], *, starts: bool) -> list[set[str]]:
    """The steps with our reasons, without what is not sampled, and without the fall of answers, which comes when the
    changer likes."""
    unseen = NOT_SEEN if starts else (*NOT_SEEN, "start-change")
    steps = [
        {REASONS.get(one, one) for one in step if not one.startswith(unseen) and one not in FALLS} for step in sequence
    ]
    return [step for step in steps if step]
