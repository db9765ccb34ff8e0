"""docs/check.md names every code that a check can give."""

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "check.md").read_text(encoding="utf-8")

# Where findings, notes and faults are made: the code stands in quotes before its message.
_CODE = re.compile(
    r"""(?:found\.add\(\s*(?:"\w+"|level),[^"]*?|\.rows\([^"]*?"\w+",\s*|\.once\([^"]*?"\w+",[^"]*?|\.note\(\s*work,\s*"""
    r"""|Fault\([^"]*?|_fault\([^"]*?|_rest\(\s*|return\s+"(?:error|warning)",\s*)"([a-z][a-z0-9_]+)",""",
    re.VERBOSE | re.DOTALL,
)
FILES = [*(ROOT / "gcode" / "check").glob("*.py")] + [
    ROOT / "gcode" / name for name in ("words.py", "motions.py", "actions.py", "interpreter.py", "executor.py")
]


def codes() -> set[str]:
    return {code for path in FILES for code in _CODE.findall(path.read_text(encoding="utf-8"))}


def test_every_code_is_explained() -> None:
    known = codes()
    assert {"unknown_code", "rapid_into_material", "feed_missing", "link_too_slow", "bad_number"} <= known
    assert {code for code in known if f"`{code}`" not in PAGE} == set()


def test_every_code_of_the_translation_to_frames_is_explained() -> None:
    said = re.compile(r'(?:\.note\(\s*|found\.add\(\s*"error",[^"]*?)"([a-z][a-z0-9_]+)",')
    files = (ROOT / "gcode" / "ncframe").glob("*.py")
    known = {code for path in files for code in said.findall(path.read_text(encoding="utf-8"))}
    assert {"frame_range", "position_unknown", "block_behind_semicolon", "feed_missing", "arc_plane"} <= known
    assert {code for code in known if f"`{code}`" not in PAGE and not code.startswith("compensation_")} == set()


def test_every_reason_not_to_expand_a_program_is_explained() -> None:
    page = (ROOT / "docs" / "gcode-programs.md").read_text(encoding="utf-8")
    raised = re.compile(r'(?:error|RefusalError|ExpandError)\(\s*(?:[^"()]|\([^"()]*\))*"([a-z][a-z0-9_]+)",')
    files = (ROOT / "gcode" / "expand").glob("*.py")
    known = {code for path in files for code in raised.findall(path.read_text(encoding="utf-8"))}
    assert {"machine_parameter", "m98_target", "not_closed", "too_many_lines", "division_by_zero"} <= known
    assert {code for code in known if f"`{code}`" not in page} == set()
