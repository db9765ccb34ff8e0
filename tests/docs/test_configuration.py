"""docs/configuration.md against the model: every key, its default, what is allowed."""

import json
from typing import Any
from urllib.parse import urlencode

import pytest
from pydantic import BaseModel
from pydantic_core import PydanticUndefined

from server.config.audit import AuditConfig
from server.config.elvinto import ElvintoConfig
from server.config.file import describe
from server.config.grbl import GrblConfig
from server.config.history import HistoryConfig
from server.config.limits import LimitsConfig
from server.config.model import DEFAULT_DATA_DIR, MachineConfig, ServerConfig
from server.config.motion import MotionConfig
from server.config.ncframe import NcFrameConfig
from server.config.reentry import ReentryConfig
from server.config.telemetry import MdnsConfig, MqttConfig, MtconnectConfig, WebhookConfig
from server.config.toolchanger import ToolchangerConfig
from sim.faults import FaultRates
from sim.options import (
    GRBL_KEYS,
    KEYS,
    LATHE_KEYS,
    grbl_options_from_query,
    lathe_options_from_query,
    options_from_query,
)
from tests.harness.docs import page, rows, section

SECTIONS: list[tuple[str, type[BaseModel]]] = [
    ("## `[server]`", ServerConfig),
    ("## `[history]`", HistoryConfig),
    ("## `[audit]`", AuditConfig),
    ("## `[limits]`", LimitsConfig),
    ("## `[[machine]]`", MachineConfig),
    ("## `[machine.elvinto]`", ElvintoConfig),
    ("## `[machine.grbl]`", GrblConfig),
    ("## `[machine.ncframe]`", NcFrameConfig),
    ("## `[machine.reentry]`", ReentryConfig),
    ("## `[machine.toolchanger]`", ToolchangerConfig),
    ("## `[mtconnect]`", MtconnectConfig),
    ("## `[mqtt]`", MqttConfig),
    ("## `[[webhook]]`", WebhookConfig),
    ("## `[mdns]`", MdnsConfig),
]


def shown(name: str, default: Any) -> str:
    if name == "data_dir":
        return json.dumps(DEFAULT_DATA_DIR)
    if default is PydanticUndefined:
        return "*required*"
    return "*none*" if default is None else json.dumps(default)


def expected(model: type[BaseModel]) -> dict[str, tuple[str, str]]:
    return {
        name: (shown(name, field.default), describe(field))
        for name, field in model.model_fields.items()
        if not isinstance(field.default, BaseModel)
    }


@pytest.mark.parametrize(("heading", "model"), SECTIONS)
def test_every_key_with_default_and_what_is_allowed(heading: str, model: type[BaseModel]) -> None:
    table = rows(section(page("configuration.md"), heading), "key", "default", "allowed", "meaning")
    assert {row[0]: (row[1], row[2]) for row in table} == expected(model)
    assert all(row[3] for row in table)


def test_every_section_of_a_machine_has_its_own_table() -> None:
    sections = {name for name, field in MachineConfig.model_fields.items() if isinstance(field.default, BaseModel)}
    assert {f"## `[machine.{name}]`" for name in sections - {"motion"}} <= {heading for heading, _ in SECTIONS}


def test_every_key_of_the_virtual_machine_and_no_other() -> None:
    table = rows(section(page("configuration.md"), '## Virtual machines: `port = "sim:"`'), "key", "default", "meaning")
    assert {row[0] for row in table} == KEYS


def test_defaults_of_the_virtual_machine_are_read_as_they_are_written() -> None:
    table = rows(section(page("configuration.md"), '## Virtual machines: `port = "sim:"`'), "key", "default", "meaning")
    written = {row[0]: row[1] for row in table if row[0] != "sd" and row[1] != "none"}
    read, default = options_from_query(urlencode(written)), options_from_query("")
    assert (read.settings, read.seed, read.baud) == (default.settings, default.seed, default.baud)
    assert read.faults == FaultRates()


def test_every_key_of_the_virtual_grbl_controller_and_no_other() -> None:
    table = rows(section(page("configuration.md"), "## The virtual Grbl controller"), "key", "default", "meaning")
    assert {row[0] for row in table} == GRBL_KEYS
    written = {row[0]: row[1] for row in table if row[0] != "set_N"}
    read, default = grbl_options_from_query(urlencode(written)), grbl_options_from_query("")
    assert (read.settings, read.seed, read.baud) == (default.settings, default.seed, default.baud)
    assert read.faults == FaultRates()


def test_every_key_of_the_virtual_lathe_and_no_other() -> None:
    table = rows(section(page("configuration.md"), "## The virtual lathe"), "key", "default", "meaning")
    assert {row[0] for row in table} == LATHE_KEYS
    read, default = lathe_options_from_query(urlencode({row[0]: row[1] for row in table})), lathe_options_from_query("")
    assert (read.settings, read.seed, read.baud) == (default.settings, default.seed, default.baud)
    assert read.faults == FaultRates()


def test_the_keys_of_motion_and_their_tables_by_axis() -> None:
    text = section(page("configuration.md"), "## `[machine.motion]`")
    table = rows(text, "key", "default", "allowed", "meaning")
    fields = MotionConfig.model_fields
    by_axis = {name: type(field.default).model_fields for name, field in fields.items() if is_table(field.default)}
    assert {row[0]: {(row[1], row[2])} for row in table} == {
        name: {(shown(name, axis.default), describe(axis)) for axis in by_axis.get(name, {name: field}).values()}
        for name, field in fields.items()
    }
    assert [row[0] for row in table][: len(by_axis)] == list(by_axis)
    assert all(f"`{axis}`" in text for axes in by_axis.values() for axis in axes)


def is_table(default: object) -> bool:
    return isinstance(default, BaseModel)
