"""How one I/O control block is set up, and the reason codes it gives to a changer.

Not the daemon's configuration file: the server reads that and makes an `IoConfig` of it.
The one rule: an `IoConfig` that exists is a sound one; everything else raises ValueError and names the key.
"""

import math
import re
from dataclasses import dataclass
from enum import IntEnum
from typing import Final, Literal

from protocol.iocontrol.pins import JUMPERS, Pin

Kind = Literal["manual", "external", "loopback", "none"]


class AbortReason(IntEnum):
    """`emc-reason` (seed §5). The first eight are LinuxCNC's own, 100 a user, 101 this protocol's."""

    TASK_EXEC_ERROR = 1
    AUX_ESTOP = 2
    MOTION_OR_IO_ERROR = 3
    STATE_OFF = 4
    ESTOP_RESET = 5
    ESTOP = 6
    NOT_ON = 7
    TASK_ABORT = 8
    USER = 100
    TOOLCHANGER_FAULT = 101


CONNECTION_LOST: Final = -1000
"""`toolchanger-reason` of a changer whose connection is gone: below what PLCs use, so that it is not one of theirs."""

KIND_JUMPERS: Final[dict[Kind, frozenset[Pin]]] = {
    "manual": frozenset(JUMPERS) - {Pin.TOOL_CHANGED},
    "external": frozenset(),
    "loopback": frozenset(JUMPERS),
    "none": frozenset(JUMPERS),
}
"""What each kind has wired from the start. A person only ever answers the question whether the tool is in."""

_TEMPLATE = re.compile(r"(?:[^%]|%%)*%d(?:[^%]|%%)*")


@dataclass(frozen=True, slots=True)
class IoConfig:
    """Timeouts in seconds; 0 waits for ever, and visibly (`IoControl.waiting_for`).

    `io_error` is shown for a fault with a reason below 0, its `%d` is the reason. `jumpers`: inputs of an external
    changer that follow their output because nothing drives them. `start_in_estop`: by default only with an external
    changer, for where a person is the changer nothing can move by itself. `always_ask`: a person is asked for a tool
    that is in the spindle, too.
    """

    kind: Kind = "none"
    protocol_version: Literal[1, 2] = 2
    support_start_change: bool = False
    prepare_timeout_s: float = 60.0
    change_timeout_s: float = 300.0
    ack_timeout_s: float = 5.0
    pulse_s: float = 0.02
    io_error: str = "toolchanger error %d"
    jumpers: frozenset[str] = frozenset()
    start_in_estop: bool | None = None
    always_ask: bool = False

    def __post_init__(self) -> None:
        if self.kind not in KIND_JUMPERS:
            raise ValueError(f"kind: {self.kind!r} is none of {', '.join(KIND_JUMPERS)}")
        if self.protocol_version not in (1, 2):
            raise ValueError(f"protocol_version: 1 or 2, not {self.protocol_version}")
        if self.support_start_change and self.protocol_version == 1:
            raise ValueError("support_start_change: protocol version 1 has no start-change pin")
        for name in ("prepare_timeout_s", "change_timeout_s", "ack_timeout_s", "pulse_s"):
            value = getattr(self, name)
            if not math.isfinite(value) or value < 0.0:
                raise ValueError(f"{name}: seconds, 0 or more, not {value}")
        if _TEMPLATE.fullmatch(self.io_error) is None:
            raise ValueError(f"io_error: a text with one %d in it, not {self.io_error!r}")
        if self.always_ask and self.kind != "manual":
            raise ValueError(f"always_ask: only a person is asked for a tool that is in the spindle, not {self.kind!r}")
        if unknown := sorted(self.jumpers - {pin.value for pin in JUMPERS}):
            raise ValueError(f"jumpers: {unknown[0]!r} is none of {', '.join(JUMPERS)}")

    @property
    def wired(self) -> frozenset[Pin]:
        """The inputs that follow an output, with those of the kind."""
        return KIND_JUMPERS[self.kind] | {Pin(name) for name in self.jumpers}

    @property
    def starts_in_estop(self) -> bool:
        return self.kind == "external" if self.start_in_estop is None else self.start_in_estop
