"""What a particular ElVinto machine decided where the standard is silent or contradicts itself: data, no code.

Every field is a key of `[machine.elvinto]`; the defaults are the decisions marked [D] in docs/elvinto.md.
"""

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True, slots=True)
class Dialect:
    """Times in seconds, lengths in mm, sizes in bytes."""

    header_name: str = "CRC16"  # written; both CRC and CRC16 are read (§2 and §4 of the standard disagree)
    crc_radix: Literal[10, 16] = 10
    checksum_scope: Literal["message", "gcode"] = "message"
    require_header: bool = True  # False: a message without a check header is believed
    init_acknowledged: bool = True
    encoding: str = "utf-8"  # of file names inside Base64
    retry_interval_s: float = 0.3  # the standard: 200-400 ms
    max_retries: int = 10
    probe_after_s: float = 2.0  # silence beyond the estimated run time before the end of a batch is asked for
    position_tolerance_mm: float = 0.01
    max_message_bytes: int = 8192
    report_moves: bool = True  # W90 at the handshake: STATE while the machine moves
    poll_interval_s: float = 5.0  # W95 while idle, so that a dead link is noticed; 0: never
