"""`[mtconnect]`, `[mqtt]`, `[[webhook]]` and `[mdns]` as models: where else the daemon says what its machines do.

Not the saying (server/outbound/). The one rule: all of it is off unless somebody switches it on, and nothing that comes
in this way moves a machine.
"""

import re
from pathlib import Path
from typing import Annotated, Self
from urllib.parse import urlsplit

from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from server.config.section import Allowed, Section, as_tuple, refused

MAX_RATE_HZ = 50.0
EVENTS = (
    "job.queued",
    "job.checking",
    "job.running",
    "job.paused",
    "job.waiting",
    "job.completed",
    "job.failed",
    "job.cancelled",
    "job.interrupted",
    "alarm.raised",
    "alarm.cleared",
    "machine.connected",
    "machine.disconnected",
)
"""What a webhook can be told."""


def _as_path(value: object) -> object:
    return Path(value).expanduser() if isinstance(value, str) and value else value


def _url(value: str) -> str:
    parts = urlsplit(value)
    if parts.scheme not in ("http", "https") or not parts.hostname or "@" in parts.netloc or not value.isprintable():
        raise ValueError
    if parts.port == 0 or " " in value:
        raise ValueError
    return value


def _topic(value: str) -> str:
    if not re.fullmatch(r"[^+#\x00-\x1f\x7f/]+(/[^+#\x00-\x1f\x7f/]+)*", value):
        raise ValueError
    return value


def _events(value: tuple[str, ...]) -> tuple[str, ...]:
    if not value or set(value) - set(EVENTS):
        raise ValueError
    return value


FilePath = Annotated[Path, BeforeValidator(_as_path), Allowed("the path of a file")]
Text = Annotated[str, Field(min_length=1), Allowed("a text")]
Host = Annotated[str, Field(min_length=1), Allowed("a host name or address")]
Topic = Annotated[
    str, AfterValidator(_topic), Allowed('the first levels of a topic, e.g. "millstream" or "shop/millstream"')
]


class MtconnectConfig(Section):
    """`[mtconnect]`: an adapter that MTConnect agents connect to."""

    enabled: bool = False
    host: Annotated[str, Field(min_length=1), Allowed("a host name or address to listen on")] = "127.0.0.1"
    port: Annotated[int, Field(ge=0, le=65535)] = 7878
    rate: Annotated[float, Field(ge=0.1, le=MAX_RATE_HZ)] = 10.0
    max_clients: Annotated[int, Field(ge=1, le=64)] = 8


class MqttConfig(Section):
    """`[mqtt]`: a broker that is told."""

    enabled: bool = False
    host: Host = "localhost"
    port: Annotated[int, Field(ge=1, le=65535)] = 1883
    tls: bool = False
    ca_file: FilePath | None = None
    username: Text | None = None
    password: Text | None = None
    password_file: FilePath | None = None
    prefix: Topic = "millstream"
    rate: Annotated[float, Field(ge=0.01, le=MAX_RATE_HZ)] = 1.0
    keepalive: Annotated[int, Field(ge=5, le=3600)] = 30
    queue_limit: Annotated[int, Field(ge=10, le=100_000)] = 1000
    discovery: bool = True
    discovery_prefix: Topic = "homeassistant"
    allow_commands: bool = False

    @model_validator(mode="after")
    def _one_password(self) -> Self:
        if self.password is not None and self.password_file is not None:
            raise refused("password_file", str(self.password_file), "password or password_file, not both")
        return self


class WebhookConfig(Section):
    """`[[webhook]]`: an address that is told by POST."""

    url: Annotated[str, AfterValidator(_url), Allowed('an address, "https://host/path", without a password in it')]
    events: Annotated[
        tuple[str, ...], BeforeValidator(as_tuple), AfterValidator(_events), Allowed("a list of " + ", ".join(EVENTS))
    ] = ("job.completed", "job.failed", "job.interrupted", "alarm.raised")
    machines: Annotated[
        tuple[str, ...], BeforeValidator(as_tuple), Allowed('a list of machines, e.g. ["router"]; empty: all')
    ] = ()
    secret: Text | None = None
    secret_file: FilePath | None = None
    timeout: Annotated[float, Field(ge=0.1, le=120)] = 10.0
    give_up_after: Annotated[float, Field(ge=1, le=30 * 86_400)] = 86_400.0
    queue_limit: Annotated[int, Field(ge=1, le=10_000)] = 1000

    @model_validator(mode="after")
    def _one_secret(self) -> Self:
        if self.secret is not None and self.secret_file is not None:
            raise refused("secret_file", str(self.secret_file), "secret or secret_file, not both")
        return self


class MdnsConfig(Section):
    """`[mdns]`: the daemon's name on the local network."""

    enabled: bool = False
    name: Annotated[str, Field(max_length=63), Allowed("a name of at most 63 bytes; empty: the computer's")] = ""

    @model_validator(mode="after")
    def _fits_a_label(self) -> Self:
        if len(self.name.encode()) > 63 or not (self.name.isprintable()):
            raise refused("name", self.name, "a name of at most 63 bytes; empty: the computer's")
        return self
