"""Commands of people as lines, and the events made of what comes back (grbl I, II.6).

Not when they go out: that is the engine's. The one rule: what was not read in full is not reported.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Final

from protocol.commands import (
    CheckMode,
    ClearAlarm,
    GrblCommand,
    Home,
    Jog,
    ListFiles,
    ReadDescriptions,
    ReadFirmware,
    ReadModal,
    ReadOffsets,
    ReadSettings,
    ReadStartupBlocks,
    Restore,
    RunFile,
    Sleep,
    WriteInfo,
    WriteSetting,
    WriteStartupBlock,
)
from protocol.errors import LocalError
from protocol.events import (
    CommandDone,
    CommandFailed,
    DescriptionsRead,
    Event,
    FilesListed,
    FirmwareRead,
    Homed,
    ModalRead,
    OffsetsRead,
    ProbeReported,
    SettingsRead,
    StartupBlocksRead,
)
from protocol.grbl.messages import (
    AxisNames,
    Fact,
    FileListed,
    Flavour,
    Help,
    Message,
    NewOptions,
    OffsetReported,
    Options,
    ParserState,
    ProbeResult,
    Said,
    SettingEnumerated,
    SettingValue,
    StartupBlock,
    Version,
)
from protocol.grbl.reports import AXES
from protocol.setting import SettingDescription

MAX_HEARD: Final = 2000
"""Rows kept of one answer: a grblHAL has some 300 settings; a controller that babbles must not fill memory."""
MAX_INFO_CHARS: Final = 80
_RESTORED: Final = {"settings": "$RST=$", "offsets": "$RST=#", "all": "$RST=*"}

Asked = GrblCommand | ClearAlarm | ListFiles | RunFile
CARD: Final = "SD"
"""What kind of card it is nobody says."""


@dataclass(slots=True)
class Request:
    """`expects`: without such a row the answer was none. `needs_idle`: refused while the machine moves (error:8).
    `in_alarm`: heard in alarm too. `resets`: the controller resets itself behind the ok."""

    token: int | None
    lines: tuple[str, ...]
    command: Asked | None = None
    expects: type | None = None
    needs_idle: bool = True
    in_alarm: bool = True
    resets: bool = False
    heard: list[Message] = field(default_factory=list)
    tries: int = 0

    @property
    def jog(self) -> bool:
        return isinstance(self.command, Jog)

    @property
    def homing(self) -> bool:
        return isinstance(self.command, Home)

    @property
    def complete(self) -> bool:
        """What was asked for has come."""
        return self.expects is None or any(isinstance(message, self.expects) for message in self.heard)

    def hear(self, message: Message) -> None:
        """A row that came while this was the line in hand."""
        if len(self.heard) < MAX_HEARD:
            self.heard.append(message)


_QUESTIONS: Final[dict[type, tuple[tuple[str, ...], type]]] = {
    ReadFirmware: (("$I", "$"), Options),
    ReadOffsets: (("$#",), OffsetReported),
    ReadSettings: (("$$",), SettingValue),
    ReadDescriptions: (("$ES",), SettingEnumerated),
    ReadStartupBlocks: (("$N",), StartupBlock),
}


def request(command: Asked) -> Request:
    """The lines of a command. Raises LocalError for what the controller could not take."""
    token = command.token
    match command:
        case ReadFirmware() | ReadOffsets() | ReadSettings() | ReadDescriptions() | ReadStartupBlocks():
            return question(type(command), token)
        case ReadModal():
            return Request(token, ("$G",), command, ParserState, needs_idle=False)
        case Jog():
            return Request(token, (_jog_line(command),), command, needs_idle=False, in_alarm=False)
        case ClearAlarm() | Home() | Sleep():
            return Request(token, _machine_lines(command), command)
        case ListFiles():
            return Request(token, ("$F",), command, in_alarm=False)
        case RunFile(name=name):
            return Request(token, (f"$F=/{name.removeprefix('/')}",), command, in_alarm=False)
        case CheckMode(on=on):
            return Request(token, ("$C",), command, in_alarm=False, resets=not on)
        case Restore(what=what):
            return Request(token, (_RESTORED[what],), command, resets=True)
        case WriteSetting() | WriteInfo() | WriteStartupBlock():
            return _write(command)


def question(kind: type, token: int | None) -> Request:
    """A question whose rows are collected; `token` None: the handshake's own."""
    lines, expects = _QUESTIONS[kind]
    return Request(token, lines, None, expects)


def modal_question() -> Request:
    """`$G` of the handshake."""
    return Request(None, ("$G",), None, ParserState)


def _machine_lines(command: ClearAlarm | Home | Sleep) -> tuple[str, ...]:
    match command:
        case Home(axes=axes):
            return tuple(f"$H{axis.upper()}" for axis in axes) or ("$H",)
        case ClearAlarm():
            return ("$X",)
        case Sleep():
            return ("$SLP",)


def _write(command: WriteSetting | WriteInfo | WriteStartupBlock) -> Request:
    token = command.token
    match command:
        case WriteSetting(number=number, value=value):
            return Request(token, (f"${number}={value}", "$$"), command, SettingValue)
        case WriteInfo(text=text):
            if len(text) > MAX_INFO_CHARS:
                raise LocalError(f"the info text has {len(text)} characters; {MAX_INFO_CHARS} fit")
            return Request(token, (f"$I={text}",), command)
        case WriteStartupBlock(index=index, block=block):
            return Request(token, (f"$N{index}={block}",), command, in_alarm=False)


def _jog_line(jog: Jog) -> str:
    """`$J=` with all its modes spelt out: it leaves the parser's own untouched (II.7)."""
    words = "".join(f"{axis.upper()}{at:.3f}" for axis, at in jog.target.items())
    return f"$J={'G90' if jog.absolute else 'G91'}G21{words}F{jog.feed_mm_min:.1f}"


def results(asked: Request, flavour: Flavour, axes: tuple[str, ...]) -> Iterable[Event]:
    """What a request that was answered has brought, and its end."""
    token, heard = asked.token, asked.heard
    if not asked.complete:
        if token is not None:
            yield CommandFailed(token, None, "the controller answered without what was asked for; try again")
        return
    if asked.expects is Options:
        yield firmware(token, heard, flavour, axes)
    elif asked.expects is ParserState:
        yield ModalRead(token, next(m.words for m in heard if isinstance(m, ParserState)))
    elif asked.expects is OffsetReported:
        yield _offsets(token, heard, axes)
    elif asked.expects is SettingValue:
        yield SettingsRead(token, {m.number: m.value for m in heard if isinstance(m, SettingValue)})
    elif asked.expects is SettingEnumerated and token is not None:
        yield DescriptionsRead(token, tuple(_description(m) for m in heard if isinstance(m, SettingEnumerated)))
    elif asked.expects is StartupBlock and token is not None:
        rows = sorted((m.index, m.block) for m in heard if isinstance(m, StartupBlock))
        yield StartupBlocksRead(token, tuple(block for _, block in rows))
    elif isinstance(asked.command, ListFiles):
        yield FilesListed(asked.command.token, _files(heard), readable=True, card=CARD)
    elif isinstance(asked.command, Home):
        yield Homed(asked.command.axes)
    if token is not None:
        problem = _unverified(asked)
        yield CommandDone(token) if problem is None else CommandFailed(token, None, problem)


def firmware(token: int | None, heard: Iterable[Message], flavour: Flavour, axes: tuple[str, ...]) -> FirmwareRead:
    """`$I` as an event."""
    version, build, info, options = "", "", "", Options("")
    facts: dict[str, str] = {}
    for message in heard:
        match message:
            case Version():
                version, build, info = message.version, message.build, message.info
            case Options():
                options = message
            case NewOptions(words=words):
                facts["NEWOPT"] = ",".join(words)
            case AxisNames(names=names):
                axes = names
            case Help(text=text):
                facts["HLP"] = text
            case Fact(key=key, value=value):
                facts[key] = value
            case _:
                pass
    return FirmwareRead(
        token, flavour, version, build, info, options.letters, options.planner_blocks, options.rx_bytes, axes, facts
    )


def named(values: tuple[float, ...], axes: tuple[str, ...]) -> dict[str, float]:
    """Coordinates by axis name."""
    return dict(zip(axes or AXES, values, strict=False))


def refused_card(asked: Request, message: str) -> Iterable[Event]:
    """The card cannot be listed: that is an answer too."""
    assert asked.token is not None
    yield FilesListed(asked.token, (), readable=False, problem=message)
    yield CommandDone(asked.token)


def _files(heard: Iterable[Message]) -> tuple[str, ...]:
    """Names with their folders; folders themselves have no size."""
    return tuple(m.path.removeprefix("/") for m in heard if isinstance(m, FileListed) and m.size_bytes is not None)


def _offsets(token: int | None, heard: Iterable[Message], axes: tuple[str, ...]) -> OffsetsRead:
    offsets: dict[str, dict[str, float]] = {}
    probe: ProbeReported | None = None
    for message in heard:
        match message:
            case OffsetReported(name="TLO", values=(length,)):
                offsets["TLO"] = {"z": length}  # Grbl 1.1 has a tool length in Z alone
            case OffsetReported(name=name, values=values):
                offsets[name] = named(values, axes)
            case ProbeResult(position=position, succeeded=succeeded):
                probe = ProbeReported(named(position, axes), succeeded)
            case _:
                pass
    return OffsetsRead(token, offsets, probe)


def _description(said: SettingEnumerated) -> SettingDescription:
    return SettingDescription(
        said.number, said.name, said.unit, said.datatype, said.format, said.minimum, said.maximum, said.reboot
    )


def _unverified(asked: Request) -> str | None:
    """What reading back or the controller's own words say against a command that was answered with ok."""
    match asked.command:
        case WriteSetting(number=number, value=value):
            read = {m.number: m.value for m in asked.heard if isinstance(m, SettingValue)}.get(number)
            if read is None or not _same(read, value):
                return f"${number} was set to {value} and reads back as {read if read is not None else 'nothing'}"
        case CheckMode(on=on):
            said = {m.text for m in asked.heard if isinstance(m, Said)}
            if ("Disabled" if on else "Enabled") in said:
                return "check mode was switched the other way; ask again"
        case _:
            pass
    return None


def _same(read: str, written: str) -> bool:
    """Grbl prints 250 as 250.000 and cuts what it cannot hold: three decimals."""
    try:
        return abs(float(read) - float(written)) < 0.001
    except ValueError:
        return read.strip() == written.strip()
