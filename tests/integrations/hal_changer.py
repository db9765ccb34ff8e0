#!/usr/bin/env python3
"""A tool changer as a component of a real HAL, for the tests: it does what it is asked, and writes down what it saw.

It runs with the system's own Python beside the component under test, and has nothing of ours. While `jammed`
it changes no tool. The one rule: every change of a level that it sees is one line of its record.
"""

import contextlib
import sys
import time
from pathlib import Path

import hal  # type: ignore[import-not-found]  # LinuxCNC's, of the system's Python

LOOK_EVERY_S = 0.005
SEEN = ("prepare", "change", "abort")


def main() -> None:
    changer = hal.component("changer")
    for pin in (*SEEN, "jammed"):
        changer.newpin(pin, hal.HAL_BIT, hal.HAL_IN)
    for pin in ("number", "reason"):
        changer.newpin(pin, hal.HAL_S32, hal.HAL_IN)
    for pin in ("prepared", "changed"):
        changer.newpin(pin, hal.HAL_BIT, hal.HAL_OUT)
    changer.ready()
    before = dict.fromkeys(SEEN, False)
    with Path(sys.argv[1]).open("w", buffering=1, encoding="utf-8") as record:
        while True:
            time.sleep(LOOK_EVERY_S)
            levels = {pin: bool(changer[pin]) for pin in SEEN}
            for pin in SEEN:
                if levels[pin] != before[pin]:
                    number = changer["reason"] if pin == "abort" else changer["number"]
                    record.write(f"{pin}{'^' if levels[pin] else '_'} {number}\n" if levels[pin] else f"{pin}_\n")
            before = levels
            changer["prepared"] = levels["prepare"]
            changer["changed"] = levels["change"] and not changer["jammed"]


if __name__ == "__main__":
    with contextlib.suppress(KeyboardInterrupt):
        main()
