"""What may not happen while cutter radius compensation is on. The geometry is in compensation.py, the order of a block
in interpreter.py.

A corner is only known with the move behind it, so nothing may come between that moves the contour or changes the tool.
The one rule: the list is that of the reference, code by code (the test asks it).
"""

from gcode.cycles import CYCLES
from gcode.profile import Code

_PLANES = {"plane_xy": 17, "plane_zx": 18, "plane_yz": 19}

_REFUSED = {
    "length_table": "the tool offset cannot change",
    "length_direct": "the tool offset cannot change",
    "length_add": "the tool offset cannot change",
    "length_off": "the tool offset cannot change",
    "set_position": "the coordinates cannot be shifted",
    "local_shift": "the coordinates cannot be shifted",
    "go_home": "there is no way home",
    "go_second_home": "there is no way home",
    "store_home": "no home can be set",
    "store_second_home": "no home can be set",
    "machine_coordinates": "there are no moves in machine coordinates",
    "load_tool": "the tool cannot be changed",
    "tool_change": "the tool cannot be changed",
    "probe": "there is no probing",
    "thread": "there are no threads",
    "rigid_tap": "there are no threads",
    **{f"system_{number}": "the coordinate system cannot change" for number in range(1, 10)},
    **dict.fromkeys(CYCLES, "there are no canned cycles"),
}


def refusal(code: Code, plane: int) -> str | None:
    """Why a code cannot stand between G41 or G42 in this plane (17, 18, 19) and G40; None: it can.

    G10 is not judged here: whether it changes the system in use is for its words to say.
    """
    why = _REFUSED.get(code.effect)
    if code.sets in _PLANES and _PLANES[code.sets] != plane:
        why = "the plane cannot change"
    elif code.group == "path":
        why = "the path control cannot change"
    elif code.sets in ("compensation_left", "compensation_right"):
        why = "it is on already"
    return None if why is None else f"{code.name} while compensation is on: {why}"
