"""What people are told about tools and a changer that does not answer.

The one rule: a text says what is waited for, with the pin's name for whoever wires the changer.
"""

from typing import Final

from protocol.iocontrol.events import WaitingFor, What
from protocol.iocontrol.tooltable import ToolTable

_LATE: Final[dict[What, str]] = {
    "tool-prepared": "The changer has not prepared tool {tool} in time (tool-prepared).",
    "start-change-ack": "The changer does not let the change to tool {tool} begin (start-change-ack).",
    "tool-changed": "The changer has not put tool {tool} in in time (tool-changed).",
    "operator": "Tool {tool} is still waited for.",
    "emc-abort-ack": "The changer has not acknowledged the abort in time (emc-abort-ack).",
}
"""When a timeout has passed. Of the other waits people are told at once, or they have no timeout."""


def late(waiting: WaitingFor) -> str:
    assert waiting.what is not None
    return _LATE[waiting.what].format(tool=waiting.tool)


def wanted(number: int | None, table: ToolTable | None, tool: int | None) -> str:
    """What a person is to do for a manual change. `tool` is thought to be in the spindle."""
    if number == 0:
        return f"{'See that no tool is in' if tool == 0 else 'Take the tool out of'} the spindle, then confirm."
    entry = table.find(number) if table is not None and number is not None else None
    named = f" ({entry.comment})" if entry is not None and entry.comment else ""
    if number == tool:
        return f"See that tool {number}{named} is in the spindle, then confirm."
    return f"Put tool {number}{named} into the spindle, then confirm."


def at(line: int | None) -> str:
    """How a message about a line of the program begins."""
    return "" if line is None else f"line {line}: "
