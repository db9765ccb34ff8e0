"""What a particular machine behind NC frames is like, where the source leaves it open: data, no code.

Every field is a key of `[machine.ncframe]`; the defaults are the decisions marked [D] in docs/ncframe.md.
"""

from dataclasses import dataclass

from protocol.ncframe.codec import BYTE_MOST, Check


@dataclass(frozen=True, slots=True)
class Dialect:
    """Times in seconds, lengths in mm. Raises ValueError for what no machine is like."""

    check: Check = "crc8"
    counter: bool = True  # ENQ is answered with the number of executed frames
    ack_timeout_s: float = 2.0  # silence beyond the estimated run time of a frame
    enq_timeout_s: float = 0.5  # until an unanswered ENQ is asked again; later ones wait longer
    enq_tries: int = 10
    gap_s: float = 0.1  # no byte for so long: what was said is complete, what is left of a bad frame is dropped
    max_naks: int = 10  # of one frame, before it counts as refused
    poll_interval_s: float = 5.0  # ENQ while idle, so that a dead link is noticed; 0: never
    resolution_mm: float = 0.001  # of a count of X, Z and R
    diameter: bool = False  # positions are told as X diameters; the frames carry radii
    feed_unit_mm_min: float = 1.0  # of a count of F
    feed_table: tuple[float, ...] = ()  # mm/min by F, instead of the unit
    rapid_mm_min: float = 3000.0
    auxiliary_s: float = 10.0  # more time for a frame with M or T: a spindle speeds up, a turret turns

    def __post_init__(self) -> None:
        for name in ("ack_timeout_s", "enq_timeout_s", "gap_s", "resolution_mm", "feed_unit_mm_min", "rapid_mm_min"):
            if not getattr(self, name) > 0:
                raise ValueError(f"{name} must be more than 0, not {getattr(self, name)}")
        for name in ("enq_tries", "max_naks"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} must be at least 1, not {getattr(self, name)}")
        for name in ("poll_interval_s", "auxiliary_s"):
            if getattr(self, name) < 0:
                raise ValueError(f"{name} must not be negative, not {getattr(self, name)}")
        if len(self.feed_table) > BYTE_MOST + 1 or any(not feed > 0 for feed in self.feed_table):
            raise ValueError(f"feed_table must be at most {BYTE_MOST + 1} feeds, each more than 0 mm/min")
