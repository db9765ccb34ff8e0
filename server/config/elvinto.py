"""`[machine.elvinto]` as a model: what machines decided where the standard is silent, and the bounds of a batch.

Keys are what users write; `dialect()` and `limits()` hand them on under the names of the core. The one rule: a batch
that these bounds allow fits a message.
"""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from jobs.batch import BatchLimits
from jobs.delivery import Delivery
from protocol.elvinto.dialect import Dialect
from server.config.section import Encoding, Section, refused

BASE64_GROWTH = 4 / 3
"""A block that cannot travel as plain text goes as Base64 (elvinto §1)."""
GCODE_FRAME_BYTES = len("GCODE,DATA<#;") + 3
"""What a message adds to the blocks of a batch, with the padding of Base64."""


class ElvintoConfig(Section):
    """`[machine.elvinto]`: what machines decided where the standard is silent, and the bounds of a batch."""

    header_name: Literal["CRC16", "CRC"] = "CRC16"
    crc_radix: Literal[10, 16] = 10
    checksum_scope: Literal["message", "gcode"] = "message"
    require_header: bool = True
    init_acknowledged: bool = True
    encoding: Encoding = "utf-8"
    report_moves: bool = True
    retry_interval: Annotated[float, Field(ge=0.05, le=10)] = 0.3
    max_retries: Annotated[int, Field(ge=1, le=1000)] = 10
    probe_after: Annotated[float, Field(ge=0.1, le=600)] = 2.0
    poll_interval: Annotated[float, Field(ge=0, le=3600)] = 5.0
    position_tolerance: Annotated[float, Field(gt=0, le=1)] = 0.01
    max_message_bytes: Annotated[int, Field(ge=128, le=1024**2)] = 8192
    max_batch_bytes: Annotated[int, Field(ge=16, le=65536)] = 512
    max_batch_blocks: Annotated[int, Field(ge=1, le=10_000)] = 32
    max_batch_seconds: Annotated[float, Field(ge=0.01, le=60)] = 1.0
    compact: bool = True
    convert_inches: bool = False

    @model_validator(mode="after")
    def _batch_fits_a_message(self) -> Self:
        largest = int((self.max_message_bytes - GCODE_FRAME_BYTES) / BASE64_GROWTH)
        if self.max_batch_bytes > largest:
            allowed = f"at most {largest}, what a message of max_message_bytes = {self.max_message_bytes} can hold"
            raise refused("max_batch_bytes", self.max_batch_bytes, allowed)
        return self

    @property
    def profile(self) -> str:
        """The G-code of these controllers, gcode/profiles/."""
        return "elvinto"

    def dialect(self) -> Dialect:
        """The part of these keys that the protocol engine obeys."""
        return Dialect(
            header_name=self.header_name,
            crc_radix=self.crc_radix,
            checksum_scope=self.checksum_scope,
            init_acknowledged=self.init_acknowledged,
            encoding=self.encoding,
            retry_interval_s=self.retry_interval,
            max_retries=self.max_retries,
            probe_after_s=self.probe_after,
            poll_interval_s=self.poll_interval,
            position_tolerance_mm=self.position_tolerance,
            max_message_bytes=self.max_message_bytes,
            report_moves=self.report_moves,
            require_header=self.require_header,
        )

    def delivery(self) -> Delivery:
        """One command at a time, which the machine remembers (elvinto §5)."""
        return Delivery()

    def limits(self) -> BatchLimits:
        """The bounds of a batch (elvinto §7)."""
        return BatchLimits(
            max_batch_bytes=self.max_batch_bytes,
            max_batch_blocks=self.max_batch_blocks,
            max_batch_seconds=self.max_batch_seconds,
            position_tolerance_mm=self.position_tolerance,
        )
