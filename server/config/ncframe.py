"""`[machine.ncframe]` as a model: what a lathe behind NC frames is like, where the source leaves it open.

Keys are what users write (docs/ncframe.md); `dialect()`, `rules()` and `limits()` hand them on under the names of the
core. The one rule: what both the translation and the engine have to know (a count, the feeds, the diameter) is one key.
"""

from collections.abc import Mapping
from typing import Annotated, Literal, Self

from pydantic import BeforeValidator, Field, model_validator

from gcode.motion import Motion
from gcode.ncframe.items import BYTE
from gcode.ncframe.rules import FrameRules
from jobs.batch import BatchLimits
from jobs.delivery import Delivery
from protocol.ncframe.dialect import Dialect
from server.config.section import Allowed, Encoding, Section, as_tuple, refused

LATHE_AXES = ("x", "z")
MAX_RADIUS_MM = 1000
TEXT_BYTES_MOST = 80
"""Of one frame as the text of a block: G99 M99 X-8388608 Z-8388608 R-8388608 F255 S255 T255 and nothing longer."""

Radius = Annotated[float, Field(ge=-MAX_RADIUS_MM, le=MAX_RADIUS_MM)]
Feeds = Annotated[
    tuple[Annotated[float, Field(gt=0, le=1_000_000)], ...],
    Field(max_length=BYTE[1] + 1),
    BeforeValidator(as_tuple),
    Allowed("up to 256 feeds in mm/min, that of F0 first"),
]
Tools = Annotated[
    Mapping[str, Radius],
    Allowed("a table of tool radii by number, in mm, e.g. { 1 = 0.4, 2 = 0.8 }"),
]
Systems = Annotated[
    Mapping[str, Mapping[str, float]],
    Allowed("a table of zeros by coordinate system, in mm, e.g. { G55 = { x = 0.0, z = -40.0 } }"),
]


class NcFrameConfig(Section):
    """`[machine.ncframe]`: the link, the machine, and the bounds of a batch."""

    check: Literal["crc8", "xor", "none"] = "crc8"
    counter: bool = True
    ack_timeout: Annotated[float, Field(ge=0.1, le=600)] = 2.0
    enq_timeout: Annotated[float, Field(ge=0.05, le=60)] = 0.5
    enq_tries: Annotated[int, Field(ge=1, le=1000)] = 10
    gap: Annotated[float, Field(ge=0.005, le=10)] = 0.1
    max_naks: Annotated[int, Field(ge=1, le=1000)] = 10
    poll_interval: Annotated[float, Field(ge=0, le=3600)] = 5.0
    auxiliary_time: Annotated[float, Field(ge=0, le=600)] = 10.0
    resolution: Annotated[float, Field(ge=0.00001, le=1000)] = 0.001
    feed_unit: Annotated[float, Field(gt=0, le=100_000)] = 1.0
    feed_table: Feeds = ()
    speed_unit: Annotated[float | None, Field(gt=0, le=100_000)] = None
    diameter_programming: bool = False
    compensation: Literal["contour", "offset"] = "contour"
    tool_radius: Annotated[float | None, Field(ge=-MAX_RADIUS_MM, le=MAX_RADIUS_MM)] = None
    tools: Tools = {}  # noqa: RUF012 - pydantic copies it
    systems: Systems = {}  # noqa: RUF012
    semicolon: Literal["end", "remark"] = "end"
    encoding: Encoding = "utf-8"
    max_batch_blocks: Annotated[int, Field(ge=1, le=1000)] = 16
    max_batch_seconds: Annotated[float, Field(ge=0.01, le=60)] = 2.0

    @model_validator(mode="after")
    def _numbers_of_tools_and_systems(self) -> Self:
        for name in self.tools:
            if not (name.isascii() and name.isdecimal() and int(name) <= BYTE[1]):
                raise refused(f"tools.{name}", name, f"a tool number from 0 to {BYTE[1]}")
        for name, zero in self.systems.items():
            if name not in _SYSTEM_NUMBERS:
                raise refused(f"systems.{name}", name, f"one of {', '.join(_SYSTEM_NUMBERS)}")
            for axis in zero:
                if axis not in LATHE_AXES:
                    raise refused(f"systems.{name}.{axis}", axis, 'an axis of the lathe, "x" or "z"')
        return self

    @property
    def profile(self) -> str:
        """The G-code that is translated, gcode/profiles/."""
        return "ncframe-lathe"

    @property
    def compact(self) -> bool:
        """Always: a frame has what has changed and nothing else."""
        return True

    @property
    def convert_inches(self) -> bool:
        """Never asked for: G20 is worked out like everything else."""
        return False

    @property
    def position_tolerance(self) -> float:
        """mm: positions are counts that were sent, so two of them are the same or differ by a count."""
        return self.resolution

    def rules(self) -> FrameRules:
        """The part of these keys that the translation obeys."""
        return FrameRules(
            resolution_mm=self.resolution,
            compensation=self.compensation,
            tool_radius_mm=self.tool_radius,
            tools={int(name): radius for name, radius in self.tools.items()},
            diameter_programming=self.diameter_programming,
            feed_unit_mm_min=self.feed_unit,
            feed_table_mm_min=self.feed_table,
            speed_unit_rpm=self.speed_unit,
            systems={_SYSTEM_NUMBERS[name]: dict(zero) for name, zero in self.systems.items()},
            semicolon=self.semicolon,
            encoding=self.encoding,
        )

    def dialect(self, motion: Motion) -> Dialect:
        """The part that the protocol engine obeys. The slower axis bounds how long a rapid may take."""
        return Dialect(
            check=self.check,
            counter=self.counter,
            ack_timeout_s=self.ack_timeout,
            enq_timeout_s=self.enq_timeout,
            enq_tries=self.enq_tries,
            gap_s=self.gap,
            max_naks=self.max_naks,
            poll_interval_s=self.poll_interval,
            resolution_mm=self.resolution,
            diameter=self.diameter_programming,
            feed_unit_mm_min=self.feed_unit,
            feed_table=self.feed_table,
            rapid_mm_min=min(motion.rate_mm_min(axis) for axis in LATHE_AXES),
            auxiliary_s=self.auxiliary_time,
        )

    def delivery(self) -> Delivery:
        """One batch at a time; it holds and stops behind each frame. What was executed only the count tells."""
        return Delivery(remembers=self.counter, holds=True, locates=False)

    @property
    def turn_bytes(self) -> int:
        """What goes over the link for a usual frame before the next one can go: head, X, Z and the check, the answer,
        and where every frame is counted the question with its answer."""
        return 7 + (self.check != "none") + 1 + (6 if self.counter else 0)

    def limits(self) -> BatchLimits:
        """The bounds of a batch. A pause does not wait for its end; it is a row of the journal."""
        return BatchLimits(
            max_batch_bytes=TEXT_BYTES_MOST * self.max_batch_blocks,
            max_batch_blocks=self.max_batch_blocks,
            max_batch_seconds=self.max_batch_seconds,
            position_tolerance_mm=None,
        )


_SYSTEM_NUMBERS = {"G54": 1, "G55": 2, "G56": 3, "G57": 4, "G58": 5, "G59": 6}
