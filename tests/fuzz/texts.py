"""What people write, as any bytes: programs, configurations, tool tables.

The one rule: no exception but the parser's own error; and what was understood can be written down and read again.
"""

import tempfile
from functools import cache
from pathlib import Path

import numpy as np

from gcode.check import check_program, check_source
from gcode.columns import read_columns
from gcode.interpret import Reading
from gcode.lines import split_lines
from gcode.motion import Motion
from gcode.profile import Profile, load_profile, profile_names
from gcode.words import parse_block, parse_carefully
from protocol.iocontrol import tooltable
from server.config.file import ConfigError, load
from server.config.model import Config
from tests.fuzz.wire import pieces

FAULT_CHARS = 2000
MESSAGE_CHARS = 400
"""Of a finding: a file that is no program must not fill the screen."""
TRAVEL = Motion(travel={"x": (0.0, 100.0), "y": (0.0, 100.0), "z": (-50.0, 50.0)})


@cache
def profiles() -> tuple[Profile, ...]:
    return tuple(load_profile(name) for name in profile_names())


def words(data: bytes) -> None:
    """A line is read the same by the quick way, by the careful one, and by the way for thousands of lines at once."""
    lines = data.splitlines()
    for line in lines:
        text = line.decode("latin-1")
        assert parse_block(text) == parse_carefully(text)
    columns = read_columns(data)
    for row in range(min(columns.lines, 200)):
        block = columns.block(row)
        for fault in block.faults:
            assert len(fault.message) < MESSAGE_CHARS


def check(data: bytes) -> None:
    """The check says something about any file, the same however it comes."""
    for profile in (load_profile("elvinto"), load_profile("grbl-1.1")):
        report = check_source([data], profile, TRAVEL)
        assert report.to_json() == check_source(pieces(data), profile, TRAVEL).to_json()
        assert report.seconds >= 0
        for found in (*report.errors, *report.warnings, *report.infos):
            assert 0 <= found.line <= max(report.lines, 1), "an empty file has a first line for people"
            assert found.code
            assert len(found.message) < MESSAGE_CHARS
    assert check_program(split_lines([data]), profile, TRAVEL).lines == report.lines


def motion(data: bytes) -> None:
    """No way of the interpreter's goes to infinity: a coordinate is a number, or not certain (NaN)."""
    for profile in profiles():
        reading = Reading(profile)
        for segments in (reading.read(read_columns(data)), reading.finish()):
            for name in ("start", "end"):
                values = getattr(segments, name, None)
                assert values is None or not np.isinf(values).any()


def config(data: bytes) -> None:
    """A configuration, or an error that names its source for each fault."""
    with tempfile.NamedTemporaryFile(suffix=".toml") as file:
        file.write(data)
        file.flush()
        loaded = _loaded(Path(file.name))
    if isinstance(loaded, ConfigError):
        assert str(loaded)
        assert all(len(str(fault)) < FAULT_CHARS for fault in loaded.faults)
        return
    assert Config.model_validate(loaded.model_dump(exclude_unset=True)) == loaded


def _loaded(path: Path) -> Config | ConfigError:
    try:
        return load(path, {})
    except ConfigError as error:
        return error


def tools(data: bytes) -> None:
    """A tool table is read from any text; what was read comes back from what is written."""
    text = data.decode("utf-8", "replace")
    for random in (False, True):
        table, warnings = tooltable.parse(text, random=random)
        assert len(table.tools) <= tooltable.TOOLS_MAX
        assert len(warnings) <= tooltable.WARNINGS_MAX + 1
        again, left_out = tooltable.parse(tooltable.render(table), random=random)
        assert again == table
        assert left_out == ()
