"""How a tool changer and its tools look in JSON, and how a tool table that people send becomes one.

Reads only. The one rule: a table that is shown, and sent back as it is, is the same table.
"""

from collections.abc import Callable, Sequence
from dataclasses import asdict
from typing import Any

from protocol.iocontrol import tooltable
from protocol.iocontrol.control import IoControl
from protocol.iocontrol.tooltable import Tool, ToolTable
from server.problems import ProblemError


def io_view(io: IoControl, at: Callable[[float], str]) -> dict[str, Any]:
    """The pins and what stands behind them; `at` makes a time for people of one of the loop."""
    waiting, drivable = io.waiting_for, io.drivable
    return {
        "kind": io.config.kind,
        "state": io.state.name.lower(),
        "estop": io.estop_state.name.lower(),
        "connected": io.connected,
        "tool": io.tool,
        "tool_certain": io.tool_certain,
        "prepared": io.prepared,
        "faulted": io.faulted,
        "parameters": {f"#{number}": value for number, value in io.parameters.items()},
        "waiting_for": waiting.what,
        "waiting_tool": waiting.tool,
        "overdue": waiting.overdue,
        "may_confirm": io.may_confirm,
        "may_fail": io.may_fail,
        "may_clear_fault": io.may_clear_fault,
        "refusal": io.start_refusal,
        "pins": [
            {
                "name": pin.name,
                "type": pin.type,
                "direction": pin.direction,
                "value": pin.value,
                "since": at(pin.since_at),
                "valid": pin.valid,
                "drivable": pin.name in drivable,
            }
            for pin in io.pins()
        ],
    }


def table_view(io: IoControl, warnings: Sequence[tooltable.TableWarning] = ()) -> dict[str, Any]:
    """The tool table; `tools` and `text` are null where there is none."""
    table = io.tool_table
    return {
        "tool": io.tool,
        "random": table is not None and table.random,
        "tools": None if table is None else [asdict(tool) for tool in table.tools],
        "text": None if table is None else tooltable.render(table),
        "warnings": [{"line": warning.line, "message": warning.message} for warning in warnings],
    }


def table_of(
    text: str | None, tools: Sequence[dict[str, Any]] | None, *, random: bool
) -> tuple[ToolTable | None, tuple[tooltable.TableWarning, ...]]:
    """A table of LinuxCNC's text, of which lines may be left out with a warning, or of tools, of which none may.
    Raises ProblemError."""
    if text is not None:
        return tooltable.parse(text, random=random)
    if tools is None:
        return (ToolTable(random=True) if random else None), ()
    table, warnings = tooltable.parse(tooltable.render(ToolTable(tuple(Tool(**tool) for tool in tools))), random=random)
    if warnings:
        raise ProblemError("invalid_request", f"Tool {warnings[0].line} of the list: {warnings[0].message}.")
    return table, ()
