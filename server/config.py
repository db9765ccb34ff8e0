"""The configuration as a model: every key, its type, its bounds, its default. Not its reading (configfile.py).

Keys are what users write (api.md): times in seconds and lengths in mm without a suffix, as in the standard; the
methods `dialect()`, `limits()` and `motion()` hand them on under the names of the core. The one rule: nothing is
guessed. A key that is not here, a value of another type and a value out of bounds are errors, and `Allowed` says
in words what would have been right.
"""

import codecs
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, model_validator
from pydantic_core import PydanticCustomError

from gcode.motion import (
    DEFAULT_ACCELERATION_MM_S2,
    DEFAULT_ARC_TOLERANCE_MM,
    DEFAULT_JUNCTION_DEVIATION_MM,
    DEFAULT_PLANNER_BLOCKS,
    DEFAULT_RATE_MM_MIN,
    Motion,
)
from jobs.batch import BatchLimits
from protocol.elvinto.dialect import Dialect

DEFAULT_DATA_DIR = "~/.local/share/millstream"

GIB_BYTES = 1024**3
BASE64_GROWTH = 4 / 3
"""A block that cannot travel as plain text goes as Base64 (elvinto §1)."""
GCODE_FRAME_BYTES = len("GCODE,DATA<#;") + 3
"""What a message adds to the blocks of a batch, with the padding of Base64."""


@dataclass(frozen=True, slots=True)
class Allowed:
    """What may stand in a field, in words, where type and bounds do not say it."""

    text: str


def refused(key: str, value: object, allowed: str) -> PydanticCustomError:
    """An error of a check over several keys: `key` is relative to the section in which the check stands."""
    return PydanticCustomError("refused", "{allowed}", {"key": key, "value": value, "allowed": allowed})


class Section(BaseModel):
    """A TOML table. Strict: `"8420"` is not a port, `1` is not `true`, and no unknown keys."""

    model_config = ConfigDict(frozen=True, strict=True, extra="forbid", allow_inf_nan=False)


def _known_encoding(value: str) -> str:
    try:
        codecs.lookup(value)
    except LookupError as error:
        raise ValueError from error
    return value


def _check_simulator(value: str) -> None:
    from sim.options import options_from_query

    if not re.fullmatch(r"sim:(\?.*)?", value):
        raise ValueError
    try:
        options_from_query(value)
    except (ValueError, OSError) as error:
        raise PydanticCustomError("unusable", "{advice}", {"advice": str(error)}) from error


def _usable_port(value: str) -> str:
    """`tcp://` with a host and a port number, `sim:` with a query that the simulator takes, else a device."""
    if value == "" or value != value.strip():
        raise ValueError
    if value.startswith("sim:"):
        _check_simulator(value)
    elif value.startswith("tcp://"):
        _, _, number = value.removeprefix("tcp://").rpartition(":")
        if not re.fullmatch(r"tcp://(\[[0-9A-Fa-f:.]+\]|[^:/\s]+):[0-9]{1,5}", value) or not 0 < int(number) < 65536:
            raise ValueError
    elif "://" in value:
        raise ValueError
    return value


def _as_path(value: object) -> object:
    return Path(value).expanduser() if isinstance(value, str | Path) and value != "" else value


def _as_tuple(value: object) -> object:
    return tuple(value) if isinstance(value, list) else value


DirectoryPath = Annotated[Path, BeforeValidator(_as_path), Allowed("the path of a directory")]
Names = Annotated[tuple[str, ...], BeforeValidator(_as_tuple), Allowed('a list of host names, e.g. ["mill.local"]')]
MachineName = Annotated[
    str,
    Field(pattern=r"^[a-z0-9-]{1,64}$"),
    Allowed("a name of 1 to 64 lower-case letters, digits and '-'"),
]
PortName = Annotated[
    str,
    AfterValidator(_usable_port),
    Allowed('a device ("/dev/ttyUSB0"), "tcp://host:port" or "sim:" (also with a query, "sim:?speed_factor=20")'),
]
Encoding = Annotated[
    str,
    AfterValidator(_known_encoding),
    Allowed('the name of a character encoding, e.g. "utf-8" or "cp1251"'),
]
Travel = Annotated[
    tuple[float, float],
    BeforeValidator(_as_tuple),
    Allowed("[lowest, highest] in mm (degrees), the lower first"),
]


class ServerConfig(Section):
    """`[server]`: where the daemon listens and where it keeps its things."""

    host: Annotated[str, Field(min_length=1), Allowed("a host name or address to listen on")] = "127.0.0.1"
    port: Annotated[int, Field(ge=0, le=65535)] = 8420
    data_dir: Annotated[DirectoryPath, Field(validate_default=True)] = Path(DEFAULT_DATA_DIR)
    max_upload_bytes: Annotated[int, Field(ge=1024, le=1024 * GIB_BYTES)] = 16 * GIB_BYTES
    allowed_hosts: Names = ()
    log_level: Literal["debug", "info", "warning", "error"] = "info"
    queue_limit: Annotated[int, Field(ge=1, le=100_000)] = 1000

    @property
    def database_path(self) -> Path:
        """The daemon's one database."""
        return self.data_dir / "millstream.db"

    @property
    def programs_dir(self) -> Path:
        """Where programs are kept, by content hash."""
        return self.data_dir / "programs"


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

    def limits(self) -> BatchLimits:
        """The bounds of a batch (elvinto §7)."""
        return BatchLimits(
            max_batch_bytes=self.max_batch_bytes,
            max_batch_blocks=self.max_batch_blocks,
            max_batch_seconds=self.max_batch_seconds,
            position_tolerance_mm=self.position_tolerance,
        )


Rate = Annotated[float, Field(gt=0, le=1_000_000)]

Steps = Annotated[float | None, Field(gt=0, le=1_000_000)]


class RateConfig(Section):
    """`max_rate` by axis, mm/min (degrees/min)."""

    x: Rate = DEFAULT_RATE_MM_MIN
    y: Rate = DEFAULT_RATE_MM_MIN
    z: Rate = DEFAULT_RATE_MM_MIN
    a: Rate = DEFAULT_RATE_MM_MIN
    b: Rate = DEFAULT_RATE_MM_MIN
    c: Rate = DEFAULT_RATE_MM_MIN


class AccelerationConfig(Section):
    """`acceleration` by axis, mm/s² (degrees/s²)."""

    x: Rate = DEFAULT_ACCELERATION_MM_S2
    y: Rate = DEFAULT_ACCELERATION_MM_S2
    z: Rate = DEFAULT_ACCELERATION_MM_S2
    a: Rate = DEFAULT_ACCELERATION_MM_S2
    b: Rate = DEFAULT_ACCELERATION_MM_S2
    c: Rate = DEFAULT_ACCELERATION_MM_S2


class TravelConfig(Section):
    """`travel` by axis, mm (degrees). The reach of an axis without it is not checked."""

    x: Travel | None = None
    y: Travel | None = None
    z: Travel | None = None
    a: Travel | None = None
    b: Travel | None = None
    c: Travel | None = None

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        for axis, travel in self.known().items():
            if not travel[0] < travel[1]:
                raise refused(axis, list(travel), "[lowest, highest], the lower first")
        return self

    def known(self) -> dict[str, tuple[float, float]]:
        """The axes whose reach is known."""
        return {axis: travel for axis, travel in self if travel is not None}


class StepsConfig(Section):
    """`steps_per_mm` by axis, steps/mm (steps/degree). The ways of an axis without it are not rounded to steps."""

    x: Steps = None
    y: Steps = None
    z: Steps = None
    a: Steps = None
    b: Steps = None
    c: Steps = None

    def known(self) -> dict[str, float]:
        """The axes whose steps are known."""
        return {axis: steps for axis, steps in self if steps is not None}


class MotionConfig(Section):
    """`[machine.motion]`: what the axes can do; for estimates of time and for the check before a run."""

    max_rate: RateConfig = RateConfig()
    acceleration: AccelerationConfig = AccelerationConfig()
    travel: TravelConfig = TravelConfig()
    steps_per_mm: StepsConfig = StepsConfig()
    junction_deviation: Annotated[float, Field(ge=0, le=10)] = DEFAULT_JUNCTION_DEVIATION_MM
    arc_tolerance: Annotated[float, Field(ge=0.00001, le=10)] = DEFAULT_ARC_TOLERANCE_MM
    planner_blocks: Annotated[int, Field(ge=1, le=10_000)] = DEFAULT_PLANNER_BLOCKS
    laser: bool = False

    def motion(self) -> Motion:
        """The same for the core."""
        return Motion(
            max_rate=dict(self.max_rate),
            acceleration=dict(self.acceleration),
            travel=self.travel.known(),
            steps_per_mm=self.steps_per_mm.known(),
            junction_deviation_mm=self.junction_deviation,
            arc_tolerance_mm=self.arc_tolerance,
            planner_blocks=self.planner_blocks,
            laser=self.laser,
        )


class MotionFile(Section):
    """The file of `millstream check --motion`: the table `[motion]`, as `[machine.motion]`."""

    motion: MotionConfig


@dataclass(frozen=True, slots=True)
class ProtocolEntry:
    """`section`: the key of a machine's table of this dialect. `profile`: its G-code, gcode/profiles/."""

    section: str
    profile: str


PROTOCOLS: Mapping[str, ProtocolEntry] = {
    "elvinto": ProtocolEntry(section="elvinto", profile="elvinto"),
}
"""Every protocol that `protocol =` may name."""


def _known_protocol(value: str) -> str:
    if value not in PROTOCOLS:
        raise ValueError
    return value


Protocol = Annotated[
    str, AfterValidator(_known_protocol), Allowed(" or ".join(f'"{name}"' for name in sorted(PROTOCOLS)))
]


class MachineConfig(Section):
    """`[[machine]]`: one machine and the link to it."""

    name: MachineName
    protocol: Protocol = "elvinto"
    port: PortName
    baud: Annotated[int, Field(ge=300, le=12_000_000)] = 115200
    autoconnect: bool = True
    resume_within: Annotated[float, Field(ge=0, le=3600)] = 10.0
    elvinto: ElvintoConfig = ElvintoConfig()
    motion: MotionConfig = MotionConfig()

    @model_validator(mode="after")
    def _sections_belong(self) -> Self:
        for protocol, entry in PROTOCOLS.items():
            if protocol != self.protocol and entry.section in self.model_fields_set:
                allowed = f'no such section for a machine with protocol = "{self.protocol}"'
                raise refused(entry.section, "a section", allowed)
        return self

    @property
    def profile(self) -> str:
        """The name of the G-code profile that this machine's controller has."""
        return PROTOCOLS[self.protocol].profile

    @property
    def shareable(self) -> bool:
        """Whether two machines may name the same port: every `sim:` is a machine of its own."""
        return self.port.startswith("sim:")


class Config(Section):
    """The whole file."""

    server: ServerConfig = ServerConfig()
    machine: Annotated[tuple[MachineConfig, ...], BeforeValidator(_as_tuple), Allowed("[[machine]] sections")] = ()

    @model_validator(mode="after")
    def _machines_differ(self) -> Self:
        for key in ("name", "port"):
            seen: dict[str, int] = {}
            for index, machine in enumerate(self.machine):
                value: Any = getattr(machine, key)
                if key == "port" and machine.shareable:
                    continue
                if value in seen:
                    allowed = f"a {key} of its own: machine[{seen[value]}] has this one"
                    raise refused(f"machine[{index}].{key}", value, allowed)
                seen[value] = index
        return self
