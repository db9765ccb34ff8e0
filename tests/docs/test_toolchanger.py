"""docs/toolchanger.md against the pins, the settings and the reasons of a block, and what is written of it."""

import re
from dataclasses import fields
from pathlib import Path

from protocol.iocontrol.config import KIND_JUMPERS, AbortReason, IoConfig
from protocol.iocontrol.pins import PINS
from tests.harness.docs import page, rows


def test_every_pin_is_documented_as_it_is() -> None:
    documented = rows(page("toolchanger.md"), "pin", "type", "direction", "version", "meaning")
    assert documented == [[pin, spec.type, spec.direction, str(spec.since), spec.meaning] for pin, spec in PINS.items()]


def test_every_setting_is_documented_with_its_default() -> None:
    documented = {name: default for name, default, _ in rows(page("toolchanger.md"), "setting", "default", "meaning")}
    assert list(documented) == [entry.name for entry in fields(IoConfig)]
    for entry in fields(IoConfig):
        if entry.name not in ("jumpers", "start_in_estop"):
            value = entry.default
            shown = (
                str(value).lower()
                if isinstance(value, bool)
                else f"{value:g}"
                if isinstance(value, float)
                else str(value)
            )
            assert documented[entry.name] == shown


def test_every_kind_is_documented() -> None:
    header = ("kind", "who changes the tool", "what is wired from the start")
    assert [row[0] for row in rows(page("toolchanger.md"), *header)] == list(KIND_JUMPERS)


def test_every_reason_is_documented() -> None:
    text = page("toolchanger.md")
    listed = text[text.index("`emc-reason`: 1") :].split("\n\n", 1)[0].replace("\n", " ")
    numbers = [int(part.split(":")[-1].split()[0]) for part in listed.split("·")]
    assert numbers == [int(reason) for reason in AbortReason]


def test_everything_that_is_written_into_the_history_is_documented() -> None:
    changer = Path(__file__).parents[2] / "server" / "changer"
    code = "".join((changer / name).read_text(encoding="utf-8") for name in ("shell.py", "toolchanger.py"))
    documented = [kind for row in rows(page("toolchanger.md"), "type", "what") for kind in row[0].split()]
    assert sorted(documented) == sorted(set(re.findall(r'note\(\s*"(\w+)"', code)))
