"""What a particular Grbl board is like where it cannot be asked: data, no code.

Every field is a key of `[machine.grbl]`; the defaults are decisions told in docs/grbl.md.
"""

from dataclasses import dataclass
from typing import Final, Literal

SAFE_RX_BYTES: Final = 127
"""Usable by every Grbl (grbl II.1): what counts until the controller has told its own number."""
LINE_CHARS: Final = 79
"""Grbl's line buffer less its end mark, after blanks and comments are out (II.1). grblHAL takes more."""


@dataclass(frozen=True, slots=True)
class Dialect:
    """Times in seconds."""

    resets_on_open: bool = True  # DTR resets an Uno; native USB and network boards say nothing when they are opened
    banner_wait_s: float = 3.0  # the boot loader takes 1-2 s
    streaming: Literal["buffered", "line"] = "buffered"
    line_chars: int = LINE_CHARS
    idle_poll_s: float = 0.2
    busy_poll_s: float = 0.1
    stream_poll_s: float = 0.2
    report_timeout_s: float = 5.0
    answer_timeout_s: float = 10.0  # a line without an answer although the machine stands idle
    stop_timeout_s: float = 15.0  # to come to a stand before the reset goes out all the same
    reset_wait_s: float = 3.0
