"""What people can ask of a machine, as commands of its protocol: data, a record for each protocol.

Not when it may be asked (controller.py). The one rule: the controller asks for a verb that stands here, never for the
name of a protocol; a verb that is None does not exist there.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from protocol.commands import CycleStart, FeedHold, Home, Jog, JogCancel, RunBlock, SoftReset, Stop
from protocol.events import FirmwareRead
from server.machine.manual import Make, MakeRealtime

MakeJog = Callable[[Mapping[str, float], float], Make]

COMMON = (
    "connect",
    "home",
    "unlock",
    "reset",
    "estop",
    "pause",
    "resume",
    "stop",
    "jog",
    "commands",
    "tool_confirm",
    "io",
    "tools",
)


@dataclass(frozen=True, slots=True)
class Verbs:
    """`capabilities` as the API names them. `forbidden`: characters that no block may hold, for they end it or act at
    once; `system`: what a block may not begin with, for it is no G-code and has a route of its own. `hold`, `go_on`,
    `drop`, `reset`, `cancel_jog` go out on the realtime lane, before anything else.

    `refuses_at_once`: what it does not want to do, to home or to jog, it refuses before it begins. `home` None: it
    cannot. `jog` None: steps and blocks are worked out for it (framehand.py).
    """

    capabilities: tuple[str, ...]
    home: Make | None
    jog: MakeJog | None
    forbidden: frozenset[str]
    system: str | None = None
    hold: MakeRealtime | None = None
    go_on: MakeRealtime | None = None
    drop: MakeRealtime | None = None
    reset: MakeRealtime | None = None
    cancel_jog: MakeRealtime | None = None
    unlocks_only_in_alarm: bool = False
    homes_in_alarm: bool = False
    refuses_at_once: bool = False
    warnings: Mapping[str, str] = field(default_factory=dict)


def _elvinto_jog(axes: Mapping[str, float], feed: float) -> Make:
    # The machine itself remembers its mode and restores it (elvinto §6). STATE in the middle of a jog says G91,
    # so what it says is no base for the next one.
    words = " ".join(f"{axis.upper()}{number(way)}" for axis, way in sorted(axes.items()))
    return lambda token: RunBlock(token, ("W70", "G91", f"G1 {words} F{number(feed)}", "W71"))


def _grbl_jog(axes: Mapping[str, float], feed: float) -> Make:
    return lambda token: Jog(token, dict(axes), feed)


def number(value: float) -> str:
    """Without an exponent, which no controller reads."""
    return f"{value:.4f}".rstrip("0").rstrip(".")


def extras_of(firmware: FirmwareRead) -> tuple[str, ...]:
    """What a controller has besides, by its own word: grblHAL's SD card, or its file system on another memory."""
    built = set(firmware.facts.get("NEWOPT", "").split(","))
    return ("sd",) if firmware.flavour == "grblhal" and built & {"SD", "FS"} else ()


ELVINTO = Verbs(
    capabilities=(*COMMON, "sd"),
    home=lambda token: RunBlock(token, ("G28",)),
    jog=_elvinto_jog,
    forbidden=frozenset("|;\r\n"),
)
GRBL = Verbs(
    capabilities=(
        *COMMON,
        "jog_cancel",
        "firmware",
        "settings",
        "modal",
        "offsets",
        "startup_blocks",
        "check_mode",
        "sleep",
        "restore",
        "door",
        "overrides",
        "coolant",
        "spindle_stop",
    ),
    home=Home,
    jog=_grbl_jog,
    forbidden=frozenset("!?~\r\n"),
    system="$",
    hold=FeedHold,
    go_on=CycleStart,
    drop=Stop,
    reset=SoftReset,
    cancel_jog=JogCancel,
    unlocks_only_in_alarm=True,
    homes_in_alarm=True,
    refuses_at_once=True,
    warnings={"unlock": "The position may be lost: home the machine before the next job."},
)
NCFRAME = Verbs(
    capabilities=tuple(verb for verb in COMMON if verb != "home"),
    home=None,
    jog=None,
    forbidden=frozenset("\r\n"),
    hold=FeedHold,
    go_on=CycleStart,
    drop=Stop,
    unlocks_only_in_alarm=True,
    warnings={
        "unlock": "Where the machine stands is not known: say it with G92 X... Z... by hand before the next job."
    },
)
VERBS: Mapping[str, Verbs] = {"elvinto": ELVINTO, "grbl": GRBL, "ncframe": NCFRAME}
"""By the protocol of a machine."""
