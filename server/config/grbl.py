"""`[machine.grbl]` as a model: what a Grbl board cannot be asked for, and how jobs are streamed to it.

Keys are what users write; `dialect()` and `limits()` hand them on under the names of the core. The one rule: a default
is safe with every board, and whatever the controller says of itself goes before a key.
"""

from typing import Annotated, Literal

from pydantic import Field

from gcode.profile import load_profile
from jobs.batch import BatchLimits
from jobs.delivery import Delivery
from protocol.commands import OnError
from protocol.grbl.dialect import Dialect
from server.config.section import Encoding, Section

FLAVOURS = {"grbl-1.1": "grbl", "grblhal": "grblhal"}
"""What a controller says that it is (protocol.events.FirmwareRead)."""
MAX_BATCHES = 3
"""Rows of the journal that may be with the engine: between two reports that prove lines to be executed a fast
controller takes 160, and a row is proven when some thirty of the next one are acknowledged."""
LEAST_BLOCKS = 64
"""But so many blocks in any case: a line is known to be executed when those behind it have filled the planner (16) and
the segment buffer (12, protocol/grbl/errands.py); with less inside the machine would come to rest to prove it."""


class GrblConfig(Section):
    """`[machine.grbl]`. `firmware` chooses the G-code that is accepted, the line length with it."""

    firmware: Literal["grbl-1.1", "grblhal"] = "grbl-1.1"
    resets_on_open: bool = True
    banner_wait: Annotated[float, Field(ge=0.1, le=60)] = 3.0
    streaming: Literal["buffered", "line"] = "buffered"
    on_error: OnError = "hold"
    idle_poll: Annotated[float, Field(ge=0.1, le=5)] = 0.2
    busy_poll: Annotated[float, Field(ge=0.1, le=5)] = 0.1
    stream_poll: Annotated[float, Field(ge=0.1, le=5)] = 0.2
    report_timeout: Annotated[float, Field(ge=1, le=600)] = 5.0
    answer_timeout: Annotated[float, Field(ge=1, le=600)] = 10.0
    stop_timeout: Annotated[float, Field(ge=1, le=600)] = 15.0
    reset_wait: Annotated[float, Field(ge=0.5, le=60)] = 3.0
    encoding: Encoding = "utf-8"
    position_tolerance: Annotated[float, Field(gt=0, le=1)] = 0.01
    max_batch_bytes: Annotated[int, Field(ge=80, le=65536)] = 4096
    max_batch_blocks: Annotated[int, Field(ge=1, le=10_000)] = 128
    max_batch_seconds: Annotated[float, Field(ge=0.01, le=60)] = 2.0
    compact: bool = True
    convert_inches: bool = False

    @property
    def profile(self) -> str:
        """The G-code of this firmware, gcode/profiles/."""
        return self.firmware

    def contradicted_by(self, flavour: str) -> str | None:
        """What is to be said when the controller turns out to be of another kind."""
        if flavour == FLAVOURS[self.firmware]:
            return None
        other = next(firmware for firmware, known in FLAVOURS.items() if known == flavour)
        return f'The controller is a {flavour}; configured is firmware = "{self.firmware}": set firmware = "{other}".'

    def dialect(self) -> Dialect:
        """The part of these keys that the protocol engine obeys."""
        return Dialect(
            resets_on_open=self.resets_on_open,
            banner_wait_s=self.banner_wait,
            streaming=self.streaming,
            line_chars=load_profile(self.profile).max_block_bytes,
            idle_poll_s=self.idle_poll,
            busy_poll_s=self.busy_poll,
            stream_poll_s=self.stream_poll,
            report_timeout_s=self.report_timeout,
            answer_timeout_s=self.answer_timeout,
            stop_timeout_s=self.stop_timeout,
            reset_wait_s=self.reset_wait,
        )

    def delivery(self) -> Delivery:
        """As many as the engine takes; the controller cannot tell afterwards what it has executed, but it can hold."""
        return Delivery(depth=MAX_BATCHES, least_blocks=LEAST_BLOCKS, remembers=False, holds=True, forgets=True)

    def limits(self) -> BatchLimits:
        """The bounds of a batch: how finely a job's lines are told apart in the journal."""
        return BatchLimits(
            max_batch_bytes=self.max_batch_bytes,
            max_batch_blocks=self.max_batch_blocks,
            max_batch_seconds=self.max_batch_seconds,
            position_tolerance_mm=None,
            max_block_bytes=load_profile(self.profile).max_block_bytes,
        )
