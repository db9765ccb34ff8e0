#!/usr/bin/env python3
"""Plays rows of the changer's table to LinuxCNC's own I/O control, and writes down what its pins did.

LinuxCNC starts it as its display; it runs with the system's own Python and has nothing of ours: rows come in as JSON,
records go out as JSON. The number of the row is on a pin of its own, for HAL's `sampler`. Here are hands and a changer,
not the judgement. The one rule: what the pins did is said by the sampler, not by this program.
"""

import json
import sys
import time
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import hal  # type: ignore[import-not-found]  # LinuxCNC's, of the system's Python
import linuxcnc  # type: ignore[import-not-found]

WITHIN_S = 1.0
"""Longer than any handshake here; what has not come by then does not come."""
STAYS_S = 0.05
"""For the rows' "nothing comes of it": ten turns of the program."""
LOOK_EVERY_S = 0.002
SETTLED_S = 0.015
ANSWERS = {"emc-abort": "emc-abort-ack", "start-change": "start-change-ack",
           "tool-prepare": "tool-prepared", "tool-change": "tool-changed"}  # fmt: skip
FAULT = ("toolchanger-fault", "toolchanger-clear-fault")
INPUTS = (*ANSWERS.values(), *FAULT)

command = linuxcnc.command()
status = linuxcnc.stat()
errors = linuxcnc.error_channel()
plant = hal.component("plant")
later: list[str] = []


def level(pin: str) -> Any:
    return hal.get_value("siggen.0.sawtooth" if pin == "row-clock" else f"iocontrol.0.{pin}")


def drive(pins: dict[str, bool | int]) -> None:
    for pin, value in pins.items():
        plant[pin] = value


def wait(condition: Callable[[], bool], jumpers: dict[str, str]) -> bool:
    """Whether it came true."""
    end = time.monotonic() + WITHIN_S
    while not condition():
        follow(jumpers)
        if time.monotonic() > end:
            return False
        time.sleep(LOOK_EVERY_S)
    return True


def follow(jumpers: dict[str, str]) -> None:
    for pin, answer in jumpers.items():
        if bool(level(answer)) is not bool(level(pin)):
            drive({answer: level(pin)})


def sampled() -> None:
    """Until the sampler has seen what is on the pins now: its thread may be late on a busy computer."""
    for _ in range(2):
        before, end = level("row-clock"), time.monotonic() + WITHIN_S
        while level("row-clock") == before and time.monotonic() < end:
            time.sleep(LOOK_EVERY_S / 4)


def rest(jumpers: dict[str, str], seconds: float = SETTLED_S) -> None:
    """Until nothing has changed for a while."""
    until_s, before = time.monotonic() + seconds, None
    while time.monotonic() < until_s:
        follow(jumpers)
        now = [level(pin) for pin in (*ANSWERS, "tool-number", "user-enable-out")]
        if now != before:
            until_s, before = time.monotonic() + seconds, now
        time.sleep(LOOK_EVERY_S)


def ready(spindle: int | None) -> None:
    """On, with everything acknowledged, no fault latched, nothing on the prep pins, and this tool in the spindle
    (None: whichever is in)."""
    drive({**dict.fromkeys(INPUTS, False), "emc-enable-in": True, "toolchanger-reason": 0})
    for state in (linuxcnc.STATE_ESTOP, linuxcnc.STATE_ESTOP_RESET, linuxcnc.STATE_ON):
        command.state(state)
        drive({"toolchanger-clear-fault": state == linuxcnc.STATE_ESTOP})
        rest(ANSWERS)
    command.mode(linuxcnc.MODE_MDI)
    if spindle is not None:
        command.mdi(f"M61 Q{spindle}")
        wait(lambda: level("tool-number") == spindle, ANSWERS)
    rest(ANSWERS)


def said() -> list[str]:
    """What people were told since the last look."""
    found = []
    while (one := errors.poll()) is not None:
        found.append(one[1])
    return found


def give(what: dict[str, bool | int], jumpers: dict[str, str]) -> None:
    """The changer says something. Where the program has to take note of it, it gets the time."""
    if "emc-abort-ack" in what:
        rest(jumpers, 2 * SETTLED_S)  # the program has second thoughts about its reason
    sampled()
    drive(what)
    if "toolchanger-fault" in what:
        wait(lambda: level("toolchanger-fault-ack") == what["toolchanger-fault"], jumpers)
    if what.get("toolchanger-clear-fault"):
        wait(lambda: not level("toolchanger-faulted"), jumpers)


def act(step: list[Any], jumpers: dict[str, str]) -> bool:
    """One step of a row; whether it went as the row has it."""
    kind, what = step
    if kind in ("rises", "falls"):
        return wait(lambda: bool(level(what)) is (kind == "rises"), jumpers)
    sampled()
    if kind == "drive":
        give(what, jumpers)
    elif kind == "stays":
        rest(jumpers, STAYS_S)
    elif kind == "ends":
        if later:
            command.mdi(later.pop())
        rest(jumpers)
    elif kind == "job":
        now = what.removesuffix(" M9")
        later[:] = ["M9"] if what != now else []  # of coolant codes a block has one, and M8 is to be seen
        command.mdi(now)
        rest(jumpers)
    elif kind == "cancel":
        command.abort()
    elif kind == "estop":
        command.state(linuxcnc.STATE_ESTOP)
    elif kind == "reset":
        command.state(linuxcnc.STATE_ESTOP_RESET)
    else:
        raise ValueError(kind)
    return True


def play(number: int, row: dict[str, Any]) -> dict[str, Any]:
    ready(row["spindle"])
    said()
    jumpers = {} if row["starts"] else {"start-change": "start-change-ack"}
    sampled()
    plant["row"] = number
    sampled()
    missed = []
    for step, then in pairwise([*row["steps"], ("", "")]):
        if not act(step, jumpers):
            missed.append(step)
        if step[0] != "job" and then[0] == "drive" and any(then[1].values()):
            rest(jumpers)  # other steps wait for something themselves
    rest(jumpers)
    sampled()
    plant["row"] = 0
    return {"missed": missed, "told": said(), "parameters": parameters() if row["parameters"] else None}


def parameters() -> list[float]:
    """#5060, #5600, #5601, as a program has them."""
    drive(dict.fromkeys(INPUTS, False))
    rest(ANSWERS)
    command.mdi("(debug,#5060 #5600 #5601)")
    told: list[str] = []
    wait(lambda: bool(told.extend(said()) or told), ANSWERS)
    return [float(value) for value in told[-1].split()] if told else []


def main() -> None:
    rows = json.loads(Path("rows.json").read_text(encoding="utf-8"))
    for pin in ("emc-enable-in", *INPUTS):
        plant.newpin(pin, hal.HAL_BIT, hal.HAL_OUT)
    for pin in ("toolchanger-reason", "row"):
        plant.newpin(pin, hal.HAL_S32, hal.HAL_OUT)
    plant.ready()
    for pin in ("emc-enable-in", *INPUTS, "toolchanger-reason", "row"):
        hal.connect(f"plant.{pin}", pin)
    records = [play(number, row) for number, row in enumerate(rows, 1)]
    Path("records.json").write_text(json.dumps(records), encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
