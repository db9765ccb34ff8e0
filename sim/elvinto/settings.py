"""What kind of ElVinto machine is simulated: its dialect, its habits where the standard leaves a choice, its mechanics.

The one rule: every field has a default, and the defaults together are the machine of the documents.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from sim.motion import AXES


def _travel() -> dict[str, tuple[float, float]]:
    return {"X": (0.0, 800.0), "Y": (0.0, 600.0), "Z": (-150.0, 60.0)}


@dataclass(frozen=True, slots=True)
class SimSettings:
    """`boot_s`, `state_interval_s`, `alarm_repeat_s` are of the outer clock; `speed_factor` is for motion only."""

    repeat: Literal["silent", "reack"] = "silent"
    """Answer to an ID that was accepted before: none, or the same acknowledgements again (elvinto §8)."""
    header_name: str = "CRC16"
    """The only name of a check header that this machine knows: a wrong dialect must not go unnoticed."""
    crc_radix: int = 10
    checksum_scope: Literal["message", "gcode"] = "message"
    init_acknowledged: bool = True
    encoding: str = "utf-8"
    max_message_bytes: int = 8192
    receive_buffer_bytes: int = 8192
    """The smaller of the two bounds a message; a longer one is lost up to its `;`."""

    speed_factor: float = 1.0
    instant: bool = False
    """Blocks take no time at all."""
    boot_s: float = 0.5
    state_interval_s: float = 0.2
    idle_reports: int = 1
    """STATE idle so many times, `state_interval_s` apart, after motion has ended and nothing follows (W90)."""
    alarm_repeat_s: float = 1.0
    """STATE is said again so often while an alarm stands; 0: once only."""
    estop_while_running: bool = True
    """W98 is obeyed while another command is executing."""
    init_in_alarm: bool = False
    """INIT, READY and the queries W95 to W97 are answered in alarm too; else nothing but RESETALERT."""
    literal_state: bool = False
    """STATE with the blanks and without the comma, as the standard prints it."""
    tool_change: Literal["report", "wait"] = "report"
    """M06 ends with TOOL after the lift, or lasts until `confirm_tool`."""

    acceleration: float = 500.0
    rapid_mm_min: float = 6000.0
    default_feed_mm_min: float = 500.0
    """Feed as long as no F was given."""
    travel: Mapping[str, tuple[float, float]] = field(default_factory=_travel)
    """The working field per axis, from the limit switches; an axis that is not named has no end."""
    safe_z: float = 30.0
    """safetyZ: the height for G28 and M06."""
    start_position: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Where the carriage stands at power-on, from the limit switches; the machine does not know it until G28."""

    sd_files: Mapping[str, bytes] | None = field(default_factory=dict[str, bytes])
    """None: no card in the reader."""
    sd_fs: Literal["FAT", "NO"] = "FAT"
    dir_end: Literal["DIR_END", "END_BEGIN"] = "DIR_END"
    """Standard §4 and §5 call the end of the listing differently."""

    executed_limit: int = 0
    """Keep at least the last so many executed blocks in memory; 0: all."""

    def __post_init__(self) -> None:
        """Raises ValueError for a value no machine can have."""
        for name in ("speed_factor", "acceleration", "rapid_mm_min", "default_feed_mm_min", "state_interval_s"):
            if not getattr(self, name) > 0:
                raise ValueError(f"{name} must be more than 0, not {getattr(self, name)}")
        for name in ("boot_s", "alarm_repeat_s", "idle_reports", "executed_limit"):
            if getattr(self, name) < 0:
                raise ValueError(f"{name} must not be negative, not {getattr(self, name)}")
        for name in ("max_message_bytes", "receive_buffer_bytes"):
            if getattr(self, name) < 64:
                raise ValueError(f"{name} must be at least 64, not {getattr(self, name)}: no check header fits")
        if self.crc_radix not in (10, 16):
            raise ValueError(f"crc_radix must be 10 or 16, not {self.crc_radix}")
        for axis, (low, high) in self.travel.items():
            if len(axis) != 1 or axis not in AXES or not low <= high:
                raise ValueError(f"travel of {axis!r} must be (low, high) of an axis of {AXES}, not ({low}, {high})")
