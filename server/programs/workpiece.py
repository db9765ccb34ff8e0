"""What planning needs to know of a machine: its profile, its motion, its bounds, what stands in the place of M6.

Made once from the configuration. Not a plan (plans.py, frameplans.py). The one rule: it is data that may go to any
thread or process, and knows neither the machine's state nor its job.
"""

from dataclasses import dataclass, replace

from gcode.check.link import BITS_A_BYTE
from gcode.motion import Motion
from gcode.ncframe.rules import FrameRules, profile_for
from gcode.profile import Profile, load_profile
from gcode.toolcodes import with_tool_codes, without_changer
from jobs.batch import BatchLimits
from jobs.toolblocks import ToolBlocks
from server.config.grbl import GrblConfig
from server.config.model import MachineConfig
from server.config.ncframe import NcFrameConfig
from server.config.reentry import ReentryConfig
from server.machine.verbs import VERBS

RATELESS = ("sim:", "tcp:")
"""Ports without a baud rate."""


@dataclass(frozen=True, slots=True)
class Workpiece:
    """What planning needs to know of a machine."""

    profile: Profile
    motion: Motion
    limits: BatchLimits
    compact: bool
    convert_inches: bool
    encoding: str
    baud: int | None = None
    """Of a serial port; a network has no rate to hold a program against."""
    frames: FrameRules | None = None
    """Of a machine that reads no G-code: how its programs are worked out (frameplans.py)."""
    turn_s: float = 0.0
    """What a frame and its answers take on the link, while the machine stands; 0 where its rate is not known."""
    reentry: ReentryConfig | None = None
    """Of a controller that says what it holds and forgets it at a reset: its jobs are taken up by a plan. None: others
    are told their modes again, and go on from where they stand."""
    tools: ToolBlocks | None = None
    """Of a controller that is not sent M6: what it is sent in its place."""

    @classmethod
    def of(cls, config: MachineConfig) -> "Workpiece":
        """From the configuration."""
        dialect = config.dialect
        profile, motion = load_profile(config.profile), config.motion.motion()
        frames = dialect.rules() if isinstance(dialect, NcFrameConfig) else None
        if frames is not None:
            # It stands still until the next frame has come, and what a line weighs as text says nothing of the wire.
            profile, motion = profile_for(profile, frames), replace(motion, planner_blocks=1)
        tools = _tool_blocks(config)
        if config.toolchanger.kind == "none":
            profile = without_changer(profile)
        elif tools is not None:
            profile = with_tool_codes(profile, moves=bool(tools.position))
        return cls(
            profile,
            motion,
            dialect.limits(),
            dialect.compact,
            dialect.convert_inches,
            dialect.encoding,
            None if frames is not None or config.port.startswith(RATELESS) else config.baud,
            frames,
            _turn_s(config),
            config.reentry if "modal" in VERBS[config.protocol].capabilities else None,
            tools,
        )


def _turn_s(config: MachineConfig) -> float:
    if not isinstance(config.dialect, NcFrameConfig) or config.port.startswith(RATELESS):
        return 0.0
    return config.dialect.turn_bytes * BITS_A_BYTE / config.baud


def _tool_blocks(config: MachineConfig) -> ToolBlocks | None:
    """What a Grbl is sent in the place of M6; None where it is sent M6 itself, or has no changer."""
    if not isinstance(config.dialect, GrblConfig) or not config.has_changer or config.toolchanger.kind == "none":
        return None
    return ToolBlocks(
        config.toolchanger.change_position,
        config.reentry.spindle_wait,
        config.motion.laser,
        knows_m61="M61" in load_profile(config.profile).codes,
    )
