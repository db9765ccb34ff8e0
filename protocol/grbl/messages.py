"""What a controller can say, one frozen dataclass a kind (grbl II.3 to II.6). Read by `codec.py`.

Texts inside are a peer's: bounded by the codec's line limit, to be escaped by whoever shows them.
The one rule: `Ok` and `Refusal` answer a line; nothing else here does, whatever it looks like.
"""

from dataclasses import dataclass
from typing import Literal, TypeAlias

from protocol.events import ProtocolFault
from protocol.grbl.reports import StatusReport

Flavour: TypeAlias = Literal["grbl", "grblhal"]
Numbers: TypeAlias = tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Ok:
    """`ok`: the oldest line without an answer was parsed, and planned if it moves. Not: it was executed."""


@dataclass(frozen=True, slots=True)
class Refusal:
    """`error:N`: the oldest line without an answer was refused. `code` None: words instead of a number (before 1.1)."""

    code: int | None
    text: str = ""


@dataclass(frozen=True, slots=True)
class AlarmRaised:
    """`ALARM:N`. Answers no line."""

    code: int | None
    text: str = ""


@dataclass(frozen=True, slots=True)
class Banner:
    """The controller has started or was reset: RX, planner and parser state are gone (II.4)."""

    text: str
    flavour: Flavour
    version: str


@dataclass(frozen=True, slots=True)
class Said:
    """`[MSG:text]`."""

    text: str


@dataclass(frozen=True, slots=True)
class ParserState:
    """`[GC:...]`, word by word; the dot after grblHAL's S is gone."""

    words: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class ProbeResult:
    """`[PRB:x,y,z:1]`, machine coordinates in the units of `$13`."""

    position: Numbers
    succeeded: bool
    inches: bool = False


@dataclass(frozen=True, slots=True)
class OffsetReported:
    """A row of `$#`: `name` G54..G59.3, G28, G30, G92, TLO, TLR or HOME, in the units of `$13`."""

    name: str
    values: Numbers
    inches: bool = False


@dataclass(frozen=True, slots=True)
class Version:
    """`[VER:1.1h.20190830:info]`."""

    version: str
    build: str
    info: str


@dataclass(frozen=True, slots=True)
class Options:
    """`[OPT:letters,planner blocks,RX bytes,axes,tools]`; the last two only from grblHAL."""

    letters: str
    planner_blocks: int | None = None
    rx_bytes: int | None = None
    axes: int | None = None
    tools: int | None = None


@dataclass(frozen=True, slots=True)
class NewOptions:
    """`[NEWOPT:word,word]` of grblHAL."""

    words: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class AxisNames:
    """`[AXS:3:XYZ]` of grblHAL; `names` are lower-case."""

    names: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Help:
    """`[HLP:...]`."""

    text: str


@dataclass(frozen=True, slots=True)
class Echo:
    """`[echo:LINE]` of builds that repeat what they have read."""

    line: str


@dataclass(frozen=True, slots=True)
class SettingValue:
    """`$n=v`."""

    number: int
    value: str


@dataclass(frozen=True, slots=True)
class StartupBlock:
    """`$Nn=block`."""

    index: int
    block: str


@dataclass(frozen=True, slots=True)
class StartupAnswer:
    """`>block:ok` or `>block:error:N`: a start-up block was run. Answers no line of ours."""

    block: str
    code: int | None


@dataclass(frozen=True, slots=True)
class SettingEnumerated:
    """`[SETTING:id|group|name|unit|datatype|format|min|max|reboot|optional]` of `$ES`; absent fields are empty."""

    number: int
    group: int | None
    name: str
    unit: str
    datatype: int | None
    format: str = ""
    minimum: float | None = None
    maximum: float | None = None
    reboot: bool = False
    optional: bool = False


@dataclass(frozen=True, slots=True)
class SettingGroup:
    """`[SETTINGGROUP:id|parent|name]` of `$EG`."""

    number: int
    parent: int | None
    name: str


@dataclass(frozen=True, slots=True)
class SettingDescribed:
    """`[SETTINGDESCR:n|text]` of `$SED=n`."""

    number: int
    text: str


@dataclass(frozen=True, slots=True)
class CodeEnumerated:
    """`[ALARMCODE:n||text]` of `$EA`, `[ERRORCODE:n||text]` of `$EE`."""

    kind: Literal["alarm", "error"]
    number: int
    text: str


@dataclass(frozen=True, slots=True)
class FileListed:
    """`[FILE:/a.nc|SIZE:123]` of `$F`; `size_bytes` None: a folder, or not told."""

    path: str
    size_bytes: int | None


@dataclass(frozen=True, slots=True)
class Fact:
    """Any other `[KEY:value]`: FIRMWARE, BOARD, DRIVER, SIGNALS, T, PARAM, ..."""

    key: str
    value: str = ""


@dataclass(frozen=True, slots=True)
class FreeText:
    """A line of no known form: grblHAL's `$HELP topic`, a boot loader, noise that came out printable."""

    text: str


Message: TypeAlias = (
    Ok
    | Refusal
    | AlarmRaised
    | Banner
    | StatusReport
    | Said
    | ParserState
    | ProbeResult
    | OffsetReported
    | Version
    | Options
    | NewOptions
    | AxisNames
    | Help
    | Echo
    | SettingValue
    | StartupBlock
    | StartupAnswer
    | SettingEnumerated
    | SettingGroup
    | SettingDescribed
    | CodeEnumerated
    | FileListed
    | Fact
    | FreeText
)


@dataclass(frozen=True, slots=True)
class Heard:
    """One line as it came: `text` printable and bounded, `message` what it means or what is wrong with it."""

    text: str
    message: Message | ProtocolFault
