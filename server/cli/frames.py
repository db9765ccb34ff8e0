"""What `check` and `translate` do for a controller that takes binary frames: options, check, and frames as text or hex.

The one rule: the bytes are those of the protocol's own codec, made of the very text that a job hands to it.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import typer

from gcode.motion import Motion
from gcode.ncframe.check import ORIGIN
from gcode.ncframe.reader import FrameBlock, FrameReader, TranslationError
from gcode.ncframe.rules import FrameRules
from gcode.profile import Profile
from protocol.ncframe.codec import Frame
from server.cli.common import CliError, ExitCode, safe, say, say_json

LINES_AT_ONCE = 256

Resolution = Annotated[float | None, typer.Option("--resolution", help="NC frames: mm in a count; 0.001.")]
ToolRadius = Annotated[float | None, typer.Option("--tool-radius", help="NC frames: mm, of every tool, for G41, G42.")]
Compensation = Annotated[
    Literal["contour", "offset"] | None,
    typer.Option("--compensation", help="NC frames: G41 and G42 follow the contour, or add the radius to X and Z."),
]
Diameter = Annotated[bool, typer.Option("--diameter", help="NC frames: X is a diameter in the program.")]
FeedUnit = Annotated[float | None, typer.Option("--feed-unit", help="NC frames: mm/min in a count of F; 1.")]
SpeedUnit = Annotated[
    float | None, typer.Option("--speed-unit", help="NC frames: rpm in a count of S; without it S is a step number.")
]
Semicolon = Annotated[
    Literal["end", "remark"] | None,
    typer.Option("--semicolon", help="NC frames: ; ends a block (end), or begins a remark."),
]
Hex = Annotated[bool, typer.Option("--hex", help="NC frames: the bytes of each frame in place of its items.")]

FEATURE = "frames"


@dataclass(frozen=True, slots=True)
class FrameOptions:
    """The options as they were given; None or False: not at all."""

    resolution: float | None = None
    tool_radius: float | None = None
    compensation: Literal["contour", "offset"] | None = None
    diameter: bool = False
    feed_unit: float | None = None
    speed_unit: float | None = None
    semicolon: Literal["end", "remark"] | None = None
    as_hex: bool = False

    def rules(self, profile: Profile, *, block_delete: bool) -> FrameRules | None:
        """The rules for a profile of frames; None for any other. Raises CliError for options that do not fit."""
        if FEATURE not in profile.features:
            if self != FrameOptions():
                raise CliError(ExitCode.USAGE, f"{safe(profile.name)}: these options are for profiles of NC frames.")
            return None
        told: dict[str, Any] = {
            "resolution_mm": self.resolution,
            "tool_radius_mm": self.tool_radius,
            "compensation": self.compensation,
            "feed_unit_mm_min": self.feed_unit,
            "speed_unit_rpm": self.speed_unit,
            "semicolon": self.semicolon,
        }
        told = {name: value for name, value in told.items() if value is not None}
        try:
            return FrameRules(diameter_programming=self.diameter, block_delete=block_delete, **told)
        except ValueError as error:
            raise CliError(ExitCode.USAGE, safe(error)) from error


def print_frames(
    lines: Iterable[tuple[int, bytes]],
    profile: Profile,
    motion: Motion,
    rules: FrameRules,
    *,
    as_hex: bool,
    as_json: bool,
) -> None:
    """A frame a line, from the origin; with `as_json` an object a line. Raises CliError."""
    for block in _frames(FrameReader(lines, profile, motion, rules, ORIGIN)):
        frame = Frame.from_text(block.text).sendable.to_bytes().hex(" ").upper()
        if as_json:
            say_json(
                {
                    "line": block.line,
                    "frame": block.text,
                    "hex": frame,
                    "seconds": block.seconds,
                    "barrier": block.barrier is not None,
                }
            )
        else:
            say(frame if as_hex else block.text)


def _frames(reader: FrameReader) -> Iterator[FrameBlock]:
    while not reader.ended:
        try:
            yield from reader.more(LINES_AT_ONCE)[0]
        except TranslationError as error:
            raise CliError(ExitCode.FAILED, safe(error)) from error
