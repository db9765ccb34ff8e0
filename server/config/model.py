"""The configuration as a model: every key, its type, its bounds, its default. Not its reading (config/file.py).

Keys are what users write (api.md): times in seconds and lengths in mm without a suffix, as in the standard. What
belongs to one protocol is in its own file (config/elvinto.py, config/grbl.py, config/ncframe.py). The one rule: nothing
is guessed. A key that is not here, a value of another type and a value out of bounds are errors, and `Allowed` says in
words what would have been right.
"""

import ipaddress
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, BeforeValidator, Field, model_validator
from pydantic_core import PydanticCustomError

from gcode.profile import load_profile
from server.config.audit import AuditConfig
from server.config.changeposition import fault_of
from server.config.elvinto import ElvintoConfig
from server.config.grbl import GrblConfig
from server.config.history import HistoryConfig
from server.config.limits import LimitsConfig
from server.config.motion import MotionConfig
from server.config.ncframe import NcFrameConfig
from server.config.reentry import ReentryConfig
from server.config.section import Allowed, Section, as_tuple, refused
from server.config.telemetry import MdnsConfig, MqttConfig, MtconnectConfig, WebhookConfig
from server.config.toolchanger import ToolchangerConfig

DEFAULT_DATA_DIR = "~/.local/share/millstream"
NO_HOME = "/nonexistent"

GIB_BYTES = 1024**3


def _usable_port(value: str) -> str:
    """`tcp://` with a host and a port number, `sim:` with or without a query, else a device."""
    if value == "" or value != value.strip():
        raise ValueError
    if value.startswith("sim:"):
        if not re.fullmatch(r"sim:(\?.*)?", value):
            raise ValueError
    elif value.startswith("tcp://"):
        _, _, number = value.removeprefix("tcp://").rpartition(":")
        if not re.fullmatch(r"tcp://(\[[0-9A-Fa-f:.]+\]|[^:/\s]+):[0-9]{1,5}", value) or not 0 < int(number) < 65536:
            raise ValueError
    elif "://" in value:
        raise ValueError
    return value


def _network(value: str) -> str:
    ipaddress.ip_network(value, strict=False)
    return value


def _as_path(value: object) -> object:
    if not isinstance(value, str | Path) or value == "":
        return value
    try:
        return Path(value).expanduser()
    except RuntimeError:
        # A user without a home, as in a container: what Debian has for such, so that nothing is made in a wrong place.
        return Path(str(value).replace("~", NO_HOME, 1))


DirectoryPath = Annotated[Path, BeforeValidator(_as_path), Allowed("the path of a directory")]
Names = Annotated[tuple[str, ...], BeforeValidator(as_tuple), Allowed('a list of host names, e.g. ["mill.local"]')]
Networks = Annotated[
    tuple[Annotated[str, AfterValidator(_network)], ...],
    BeforeValidator(as_tuple),
    Allowed('a list of addresses or networks, e.g. ["127.0.0.1", "10.0.0.0/24"]'),
]
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


class ServerConfig(Section):
    """`[server]`: where the daemon listens and where it keeps its things."""

    host: Annotated[str, Field(min_length=1), Allowed("a host name or address to listen on")] = "127.0.0.1"
    port: Annotated[int, Field(ge=0, le=65535)] = 8420
    data_dir: Annotated[DirectoryPath, Field(validate_default=True)] = Path(DEFAULT_DATA_DIR)
    max_upload_bytes: Annotated[int, Field(ge=1024, le=1024 * GIB_BYTES)] = 16 * GIB_BYTES
    allowed_hosts: Names = ()
    trusted_proxies: Networks = ()
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


class MotionFile(Section):
    """The file of `millstream check --motion`: the table `[motion]`, as `[machine.motion]`."""

    motion: MotionConfig


DialectConfig = ElvintoConfig | GrblConfig | NcFrameConfig

PROTOCOLS: Mapping[str, str] = {"elvinto": "elvinto", "grbl": "grbl", "ncframe": "ncframe"}
"""Every protocol that `protocol =` may name, and the key of a machine's table of that dialect."""


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
    dtr: bool = True
    resume_within: Annotated[float, Field(ge=0, le=3600)] = 10.0
    elvinto: ElvintoConfig = ElvintoConfig()
    grbl: GrblConfig = GrblConfig()
    ncframe: NcFrameConfig = NcFrameConfig()
    motion: MotionConfig = MotionConfig()
    reentry: ReentryConfig = ReentryConfig()
    toolchanger: ToolchangerConfig = ToolchangerConfig()

    @model_validator(mode="after")
    def _sections_belong(self) -> Self:
        for protocol, section in PROTOCOLS.items():
            if protocol != self.protocol and section in self.model_fields_set:
                allowed = f'no such section for a machine with protocol = "{self.protocol}"'
                raise refused(section, "a section", allowed)
        return self

    @model_validator(mode="after")
    def _simulator_takes_the_query(self) -> Self:
        from sim.options import READERS

        if self.port.startswith("sim:"):
            try:
                READERS[self.protocol](self.port)
            except (ValueError, OSError) as error:
                context = {"key": "port", "value": self.port, "advice": str(error)}
                raise PydanticCustomError("unusable", "{advice}", context) from error
        return self

    @model_validator(mode="after")
    def _change_position_fits(self) -> Self:
        """Before a job stands in the middle of a tool change with it."""
        if not (blocks := self.toolchanger.change_position):
            return self
        key = "toolchanger.change_position"
        if self.protocol != "grbl" or not self.has_changer:
            allowed = "no such blocks for a controller that is sent M6 and goes there by itself"
            raise refused(key, list(blocks), allowed)
        fault = fault_of(blocks, load_profile(self.profile), self.motion.motion())
        if fault is not None:
            raise refused(key, *fault)
        return self

    @property
    def dialect(self) -> DialectConfig:
        """The section of this machine's protocol."""
        section: DialectConfig = getattr(self, PROTOCOLS[self.protocol])
        return section

    @property
    def profile(self) -> str:
        """The name of the G-code profile that this machine's controller has."""
        return self.dialect.profile

    @property
    def has_changer(self) -> bool:
        """M6 is a dialogue with the changer of [machine.toolchanger]; without, grblHAL asks a person by itself."""
        return not (self.profile == "grblhal" and self.toolchanger.kind == "manual")

    @property
    def shareable(self) -> bool:
        """Whether two machines may name the same port: every `sim:` is a machine of its own."""
        return self.port.startswith("sim:")


class Config(Section):
    """The whole file."""

    server: ServerConfig = ServerConfig()
    history: HistoryConfig = HistoryConfig()
    audit: AuditConfig = AuditConfig()
    limits: LimitsConfig = LimitsConfig()
    machine: Annotated[tuple[MachineConfig, ...], BeforeValidator(as_tuple), Allowed("[[machine]] sections")] = ()
    mtconnect: MtconnectConfig = MtconnectConfig()
    mqtt: MqttConfig = MqttConfig()
    webhook: Annotated[tuple[WebhookConfig, ...], BeforeValidator(as_tuple), Allowed("[[webhook]] sections")] = ()
    mdns: MdnsConfig = MdnsConfig()

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

    @model_validator(mode="after")
    def _webhooks_differ_and_name_machines(self) -> Self:
        known = [machine.name for machine in self.machine]
        urls = [webhook.url for webhook in self.webhook]
        for index, webhook in enumerate(self.webhook):
            if webhook.url in urls[:index]:
                raise refused(f"webhook[{index}].url", webhook.url, "an address of its own: another has this one")
            for name in webhook.machines:
                if name not in known:
                    raise refused(f"webhook[{index}].machines", name, " or ".join(known))
        return self
