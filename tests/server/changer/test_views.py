"""How a tool changer and its tools are shown, and how a table that people send becomes one."""

from dataclasses import asdict

import pytest

from protocol.iocontrol.config import IoConfig
from protocol.iocontrol.control import IoControl
from protocol.iocontrol.pins import PINS
from protocol.iocontrol.tooltable import Tool, ToolTable, parse
from server.api.iomodels import IoView, ToolsView
from server.changer.views import io_view, table_of, table_view
from server.problems import ProblemError

TEXT = "T1 P1 D+6.0 ;six mm\nT5 P12 Z+10.5\n"


def block(kind: str = "external", table: ToolTable | None = None, *, tool: int | None = 0) -> IoControl:
    return IoControl(IoConfig(kind=kind), table, 10.0, tool=tool)  # type: ignore[arg-type]


def at(since_at: float) -> str:
    return f"at {since_at:g}"


def test_a_block_has_all_that_the_contract_names_and_all_pins() -> None:
    view = io_view(block(), at)
    assert set(view) == set(IoView.model_fields)
    IoView.model_validate(view)
    assert [pin["name"] for pin in view["pins"]] == list(PINS)
    assert {pin["since"] for pin in view["pins"]} == {"at 10"}


def test_what_may_be_driven_and_what_counts() -> None:
    io = block()
    pins = {pin["name"]: pin for pin in io_view(io, at)["pins"]}
    assert {name for name, pin in pins.items() if pin["drivable"]} == {
        name for name, spec in PINS.items() if spec.direction == "in"
    }
    assert not pins["tool-changed"]["valid"], "the changer is not connected"
    io.connect({"tool-changed": True}, 20.0)
    pins = {pin["name"]: pin for pin in io_view(io, at)["pins"]}
    assert (pins["tool-changed"]["valid"], pins["tool-changed"]["since"]) == (True, "at 20")
    wired = {pin["name"] for pin in io_view(block("manual"), at)["pins"] if pin["drivable"]}
    assert "tool-changed" in wired
    assert "tool-prepared" not in wired, "it is a jumper"


def test_a_tool_that_nobody_knows_is_null_and_refuses_jobs() -> None:
    view = io_view(block("loopback", tool=None), at)
    assert (view["tool"], view["tool_certain"]) == (None, False)
    assert view["refusal"] == "it is not known which tool is in the spindle"


def test_version_1_shows_only_its_pins() -> None:
    io = IoControl(IoConfig(kind="external", protocol_version=1), None, 0.0)
    assert {pin["name"] for pin in io_view(io, at)["pins"]} == {name for name, spec in PINS.items() if spec.since == 1}


def test_a_table_that_is_shown_and_sent_back_is_the_same_table() -> None:
    table, _ = parse(TEXT)
    view = table_view(block(table=table))
    ToolsView.model_validate(view)
    assert table_of(view["text"], None, random=False) == (table, ())
    assert table_of(None, view["tools"], random=False)[0] == table
    assert view["tools"][1] == asdict(Tool(5, 12, z=10.5))


def test_without_a_table_there_is_none_to_show() -> None:
    view = table_view(block())
    assert (view["tools"], view["text"], view["random"]) == (None, None, False)
    assert table_of(None, None, random=False) == (None, ())
    assert table_of(None, None, random=True) == (ToolTable(random=True), ())


def test_lines_of_a_text_are_left_out_with_a_warning_and_tools_of_a_list_never() -> None:
    table, warnings = table_of("T1 P1\nT1 P2\nnonsense\n", None, random=False)
    assert table is not None
    assert (len(table.tools), [warning.line for warning in warnings]) == (1, [2, 3])
    twice = [asdict(Tool(1, 1)), asdict(Tool(1, 2))]
    with pytest.raises(ProblemError, match="Tool 2 of the list") as refused:
        table_of(None, twice, random=False)
    assert refused.value.code == "invalid_request"
