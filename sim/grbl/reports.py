"""What the controller tells about itself: status reports field by field (grbl II.5), `$$`, `$#`, `$I`, `$N`.

The one rule: a report is made in the moment it is printed; its counters of WCO and Ov are the only thing it changes.
"""

from typing import Final

from sim.grbl.core import BUSY, Core, State, Suspend
from sim.grbl.simsettings import AXES, Point

MPOS: Final = 1
BUFFERS: Final = 2
# grblHAL has more bits in $10; on 1.1 these fields cannot be turned off.
SPEEDS: Final = 8
PINS: Final = 16
WCO: Final = 32
OVERRIDES: Final = 64
ALARM_NUMBER: Final = 1024
RUN_DETAIL: Final = 2048
WCO_BUSY, WCO_IDLE = 30, 10
OVERRIDES_BUSY, OVERRIDES_IDLE = 20, 10
VERSION: Final = "1.1h.20190830"
INCH_MM: Final = 25.4

HELP: Final = "[HLP:$$ $# $G $I $N $x=val $Nx=line $J=line $SLP $C $X $H ~ ! ? ctrl-x]"


def point(core: Core, value: Point) -> str:
    """Three decimals of mm, four of inches."""
    scale, digits = (INCH_MM, 4) if core.memory.on(13) else (1.0, 3)
    return ",".join(f"{each / scale + 0.0:.{digits}f}" for each in _plain(value, scale, digits))


def _plain(value: Point, scale: float, digits: int) -> Point:
    """Without the minus of a zero."""
    x, y, z = (0.0 if round(each / scale, digits) == 0 else each for each in value)
    return x, y, z


def status(core: Core, *, full: bool = False) -> str:
    """`<Idle|MPos:0.000,0.000,0.000|FS:0,0>` with what is due."""
    mask = int(core.memory[10])
    hal = core.kind.hal
    shown = mask if hal else SPEEDS | PINS | WCO | OVERRIDES
    state = _state(core, shown | ALARM_NUMBER * (full and hal))
    position = core.position()
    if mask & MPOS:
        fields = [state, f"MPos:{point(core, position)}"]
    else:
        x, y, z = (p - o for p, o in zip(position, core.modal.offset, strict=True))
        fields = [state, f"WPos:{point(core, (x, y, z))}"]
    if mask & BUFFERS:
        fields.append(f"Bf:{core.planner.free},{core.ring.free}")
    if core.kind.line_numbers and core.planner.blocks and core.planner.blocks[0].line_number:
        fields.append(f"Ln:{core.planner.blocks[0].line_number}")
    if shown & SPEEDS:
        fields.append(_speeds(core))
    if shown & PINS and (letters := pins(core)):
        fields.append(f"Pn:{letters}")
    fields += _full(core) if full and hal else _due(core, shown)
    if core.file is not None:
        fields.append(f"SD:{core.file.percent:.1f},{core.file.name}")
    return f"<{'|'.join(fields)}>"


def _state(core: Core, shown: int) -> str:
    name = core.state.value
    if core.state is State.ALARM and shown & ALARM_NUMBER and core.last_alarm:
        return f"{name}:{core.last_alarm}"
    if core.state is State.RUN and shown & RUN_DETAIL and core.probing:
        return f"{name}:2"
    if core.state is State.HOLD:
        return f"{name}:{0 if core.suspend & Suspend.HELD else 1}"
    if core.state is State.DOOR:
        return f"{name}:{_door(core.suspend)}"
    return name


def _door(suspend: Suspend) -> int:
    if suspend & Suspend.RESTORING:
        return 3
    if suspend & Suspend.RETRACTED:
        return 1 if suspend & Suspend.DOOR_AJAR else 0
    return 2


def _speeds(core: Core) -> str:
    feed = core.stepper.speed_mm_s(core.now) * 60
    shown = f"{feed / INCH_MM:.1f}" if core.memory.on(13) else f"{feed:.0f}"
    return f"FS:{shown},{core.spindle_rpm:.0f}" if core.kind.variable_spindle else f"F:{shown}"


def pins(core: Core) -> str:
    """Letters of the inputs that are active: P X Y Z D R H S."""
    pressed = set(core.pressed)
    if not core.kind.door_pin:
        pressed.discard("D")
    if probe_closed(core):
        pressed.add("P")
    order = "XYZPDRHS" if core.kind.hal else "PXYZDRHS"
    return "".join(letter for letter in order if letter in pressed)


def probe_closed(core: Core) -> bool:
    touching = core.kind.probe_z is not None and core.true_position()[2] <= core.kind.probe_z + 1e-9
    return touching or "P" in core.pressed


def _due(core: Core, shown: int) -> list[str]:
    """WCO and Ov by their counters, never both in one report."""
    busy = core.state in BUSY
    fields: list[str] = []
    if core.wco_in > 0:
        core.wco_in -= 1
    elif shown & WCO:
        core.wco_in = (WCO_BUSY if busy else WCO_IDLE) - 1
        core.overrides_in = max(core.overrides_in, 1)
        fields.append(f"WCO:{point(core, core.modal.offset)}")
        if core.kind.hal:
            fields.append(f"WCS:{core.modal.system}")
    if core.overrides_in > 0:
        core.overrides_in -= 1
    elif shown & OVERRIDES:
        core.overrides_in = (OVERRIDES_BUSY if busy else OVERRIDES_IDLE) - 1
        fields.append(_overrides(core))
        if letters := accessories(core):
            fields.append(f"A:{letters}")
        elif core.kind.hal:
            fields.append("A:")
    return fields


def _overrides(core: Core) -> str:
    return f"Ov:{core.planner.feed_override},{core.planner.rapid_override},{core.spindle_override}"


def accessories(core: Core) -> str:
    letters = {"M3": "S", "M4": "C"}.get(core.spindle, "")
    letters += "F" * core.flood + "M" * core.mist
    if core.kind.hal and core.state is State.TOOL:
        letters += "T"
    return letters


def _full(core: Core) -> list[str]:
    """0x87 of grblHAL: all fields, also the empty ones."""
    modal = core.modal
    return [
        f"WCO:{point(core, modal.offset)}",
        f"WCS:{modal.system}",
        _overrides(core),
        f"A:{accessories(core)}",
        "Sc:",
        f"MPG:{int(core.mpg)}",
        f"H:{int(core.homed)}{',7' * core.homed}",
        f"T:{modal.tool_in_spindle}",
        "P:0",
        f"TLR:{int(core.probe_found and core.kind.hal)}",
        "FW:grblHAL",
    ]


def banner(core: Core) -> str:
    if core.kind.hal:
        return "GrblHAL 1.1f ['$' or '$HELP' for help]"
    return "Grbl 1.1h ['$' for help]"


def parser_state(core: Core) -> str:
    words = core.modal.words(hal=core.kind.hal, inches=core.memory.on(13), mist_built=core.kind.mist)
    return f"[GC:{words}]"


def settings(core: Core) -> list[str]:
    return [f"${number}={core.memory.show(number)}" for number in core.memory.table]


def probe(core: Core) -> str:
    return f"[PRB:{point(core, core.probe_position)}:{int(core.probe_found)}]"


def parameters(core: Core) -> list[str]:
    """`$#`"""
    coords = core.memory.coords
    lines = [f"[{name}:{point(core, coords[name])}]" for name in (*core.memory.systems, "G28", "G30")]
    lines.append(f"[G92:{point(core, core.modal.g92)}]")
    length = (0.0, 0.0, core.modal.tool_length)
    lines.append(f"[TLO:{point(core, length) if core.kind.hal else point(core, length).rpartition(',')[2]}]")
    lines.append(probe(core))
    return lines


def build(core: Core) -> list[str]:
    """`$I`"""
    kind, info = core.kind, core.memory.build_info
    blocks, rx_bytes = kind.usable_blocks, kind.reported_rx_bytes
    letters = "V" * kind.variable_spindle + "N" * kind.line_numbers + "M" * kind.mist
    letters += "H" * kind.single_axis_homing + "+" * kind.door_pin + "L" * (not kind.homing_lock)
    if not kind.hal:
        return [f"[VER:{VERSION}:{info}]", f"[OPT:{letters},{blocks},{rx_bytes}]"]
    return [
        f"[VER:1.1f.20260817:{info}]",
        f"[OPT:VNML+,{blocks},{rx_bytes},{len(AXES)},0]",
        "[AXS:3:XYZ]",
        f"[NEWOPT:ENUMS,RT+{',TC' * kind.tool_change},SED{',SD' * (kind.card is not None)}]",
        "[FIRMWARE:grblHAL]",
        "[SIGNALS:D]",
        "[NVS STORAGE:*EEPROM]",
        "[DRIVER:Simulator]",
        "[DRIVER VERSION:260817]",
    ]


def startup(core: Core) -> list[str]:
    return [f"$N{number}={text}" for number, text in enumerate(core.memory.startup)]
