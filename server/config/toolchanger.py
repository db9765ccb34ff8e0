"""`[machine.toolchanger]` as a model: who changes the tools of a machine, and how long is waited for it.

Keys are what users write; `io()` hands them on under the names of the core (protocol/iocontrol). What the kinds mean is
in docs/toolchanger.md. The one rule: the default is a person, and a person is never assumed to have done anything.
"""

from typing import Annotated, Literal, Self

from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from gcode.words import parse_block
from protocol.iocontrol.config import IoConfig
from server.config.section import Allowed, Section, as_tuple, refused

MAX_POSITION_BLOCKS = 20
MAX_TIMEOUT_S = 86_400


def _plain_blocks(value: tuple[str, ...]) -> tuple[str, ...]:
    """Blocks of G-code, one an entry, and no system commands."""
    if len(value) > MAX_POSITION_BLOCKS:
        raise ValueError
    for text in value:
        block = parse_block(text)
        if block.faults or not block.words or not text.isprintable() or set(text) & set("!?~$"):
            raise ValueError
    return value


PositionBlocks = Annotated[
    tuple[str, ...],
    BeforeValidator(as_tuple),
    AfterValidator(_plain_blocks),
    Allowed(f'a list of at most {MAX_POSITION_BLOCKS} blocks, e.g. ["G53 G0 Z-5", "G53 G0 X-10 Y-10"]'),
]
Pins = Annotated[
    tuple[str, ...],
    BeforeValidator(as_tuple),
    Allowed('a list of inputs that are wired to their output, e.g. ["start-change-ack"]'),
]
Timeout = Annotated[float, Field(ge=0, le=MAX_TIMEOUT_S)]


class ToolchangerConfig(Section):
    """`[machine.toolchanger]`. `change_position`: how a controller without M6 goes to where tools are changed."""

    kind: Literal["manual", "external", "loopback", "none"] = "manual"
    protocol_version: Literal[1, 2] = 2
    support_start_change: bool = False
    prepare_timeout: Timeout = 60.0
    change_timeout: Timeout = 300.0
    ack_timeout: Timeout = 5.0
    pulse: Annotated[float, Field(ge=0, le=10)] = 0.02
    random: bool = False
    io_error: Annotated[str, Field(max_length=200), Allowed("a text with one %d in it")] = "toolchanger error %d"
    jumpers: Pins = ()
    start_in_estop: bool | None = None
    always_ask: bool = False
    change_position: PositionBlocks = ()

    @model_validator(mode="after")
    def _is_sound(self) -> Self:
        """What the core would refuse is refused here, under the key's own name."""
        try:
            self.io()
        except ValueError as error:
            key, _, advice = str(error).partition(": ")
            key = key.removesuffix("_s")
            raise refused(key, getattr(self, key), advice) from error
        return self

    def io(self) -> IoConfig:
        """The same for the I/O control block."""
        return IoConfig(
            kind=self.kind,
            protocol_version=self.protocol_version,
            support_start_change=self.support_start_change,
            prepare_timeout_s=self.prepare_timeout,
            change_timeout_s=self.change_timeout,
            ack_timeout_s=self.ack_timeout,
            pulse_s=self.pulse,
            io_error=self.io_error,
            jumpers=frozenset(self.jumpers),
            start_in_estop=self.start_in_estop,
            always_ask=self.always_ask,
        )
