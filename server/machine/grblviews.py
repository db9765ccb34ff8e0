"""How what a Grbl tells of itself looks in JSON: settings, firmware, offsets, modal groups. Computes, asks nothing.

The one rule is that of views.py: what is unknown is null or absent, and numbers are in mm, mm/min, rpm.
"""

from collections.abc import Mapping
from typing import Any, Final

from protocol.events import FirmwareRead, ModalRead, OffsetsRead
from protocol.grbl import modal, options
from protocol.grbl.registers import kept_text
from protocol.grbl.reports import AXES
from protocol.grbl.settings import Setting
from server.machine.views import axes_view

OLD_RX_BYTES: Final = 127
"""What every Grbl 1.1 has at least (grbl II.1)."""
GRBL_AXES: Final = 3
"""Grbl 1.1 has X, Y and Z and does not say so."""

Json = dict[str, Any]


def settings_view(machine: str, values: Mapping[int, str], known: Mapping[int, Setting]) -> Json:
    """All settings, by number, with what is known of them."""
    settings = [_setting(number, values[number], known.get(number)) for number in sorted(values)]
    return {"machine": machine, "settings": settings}


def _setting(number: int, value: str, known: Setting | None) -> Json:
    """One of which nothing is known has its number and value alone."""
    if known is None:
        nothing = dict.fromkeys(("name", "unit", "min", "max", "meaning", "kind"))
        return {"number": number, "value": value, **nothing, "bits": [], "choices": []}
    return {
        "number": number,
        "value": value,
        "name": known.name,
        "unit": known.unit,
        "min": known.minimum,
        "max": known.maximum,
        "meaning": known.meaning or None,
        "kind": known.kind,
        "bits": _bits(known.bits, value),
        "choices": list(known.choices),
    }


def _bits(names: tuple[str, ...], value: str) -> list[Json]:
    """What a mask is made of; `on` is null where the value is no number."""
    number = int(value) if value.isdecimal() and len(value) < 10 else None
    return [
        {"bit": bit, "name": name, "on": None if number is None else bool(number >> bit & 1)}
        for bit, name in enumerate(names)
    ]


def firmware_view(machine: str, read: FirmwareRead) -> Json:
    """What the controller is."""
    facts = dict(read.facts)
    words = [word for word in facts.pop("NEWOPT", "").split(",") if word]
    return {
        "machine": machine,
        "flavour": read.flavour,
        "version": read.version,
        "build": read.build,
        "info": read.info,
        "options": [_option(letter, options.letter(letter)) for letter in read.options]
        + [_option(word, options.word(word)) for word in words],
        "planner_blocks": read.planner_blocks,
        "rx_bytes": read.rx_bytes,
        "axes": list(read.axes) or list(AXES[:GRBL_AXES]),
        "help": facts.pop("HLP", "").split(),
        "facts": facts,
        "warnings": _warnings(read),
    }


def _option(code: str, known: options.Option | None) -> Json:
    return {"code": code, "meaning": None if known is None else known.meaning}


def _warnings(read: FirmwareRead) -> list[str]:
    found = [known.meaning for letter in read.options if (known := options.letter(letter)) is not None and known.warns]
    if not read.version.startswith("1.1"):
        found.append(f"version {read.version or 'unknown'}: what is said here holds for 1.1")
    if read.rx_bytes is not None and read.rx_bytes < OLD_RX_BYTES:
        found.append(f"the receive buffer has {read.rx_bytes} bytes, fewer than the usual: long lines go alone")
    return found


def info_warnings(asked: str, stored: str) -> list[str]:
    """What became of a text that was written."""
    if asked == stored:
        return []
    why = "Grbl drops blanks and comments and knows no lower case" if kept_text(asked) == stored else "see the console"
    return [f"it is stored as {stored!r}: {why}"]


def modal_view(machine: str, read: ModalRead) -> Json:
    """Every modal group by name."""
    return {"machine": machine, "groups": modal.groups(read.words), "words": list(read.words)}


def offsets_view(machine: str, read: OffsetsRead) -> Json:
    """Offsets by name, and where the last probing ended."""
    probe = read.probe
    return {
        "machine": machine,
        "offsets": {name: axes_view(axes) for name, axes in read.offsets.items()},
        "probe": None if probe is None else {"position": axes_view(probe.position), "succeeded": probe.succeeded},
    }
