"""Lines of a Grbl controller: bytes to messages. What was sent, and what a message means for it, is the engine's.

The one rule: any bytes in any pieces, nothing raises, nothing grows past `MAX_LINE_BYTES`.
Source: grbl II.3 (answers and push lines), II.6 ($ lines), and the table of grblHAL's differences.
"""

import re
from collections.abc import Callable, Iterable, Iterator
from typing import Final

from protocol.events import ProtocolFault
from protocol.grbl.messages import (
    AlarmRaised,
    AxisNames,
    Banner,
    CodeEnumerated,
    Echo,
    Fact,
    FileListed,
    FreeText,
    Heard,
    Help,
    Message,
    NewOptions,
    OffsetReported,
    Ok,
    Options,
    ParserState,
    ProbeResult,
    Refusal,
    Said,
    SettingDescribed,
    SettingEnumerated,
    SettingGroup,
    SettingValue,
    StartupAnswer,
    StartupBlock,
    Version,
)
from protocol.grbl.reports import MalformedReportError, are_inches, in_mm, numbers, parse_report

MAX_LINE_BYTES: Final = 2048
"""The longest lines are grblHAL's `[SETTING:...]` rows with their lists of options, some 600 bytes; what is longer is
noise and is skipped up to the next line end."""
CONSOLE_TEXT_LIMIT: Final = 600
"""Characters of a line kept for the console and in faults."""

_CODE = re.compile(r"(error|ALARM):\s*(.*)", re.IGNORECASE)
_BANNER = re.compile(r"(grblhal|grbl)\s+(\d[\w.]*)\s*\[.*", re.IGNORECASE)
_SETTING = re.compile(r"\$(\d{1,5})=(.*)")
_STARTUP = re.compile(r"\$N(\d{1,2})=(.*)")
_STARTUP_ANSWER = re.compile(r">(.*):(?:ok|error:(\d{1,5}))")
_BRACKETS = re.compile(r"\[([^:\]]{1,40})(?::(.*))?\]")
_OFFSET_NAMES: Final = frozenset(
    (*(f"G{n}" for n in range(54, 60)), "G59.1", "G59.2", "G59.3", "G28", "G30", "G92", "TLO", "TLR", "HOME")
)


OK_LINE: Final = b"ok\r\n"
OK: Final = Heard("ok", Ok())


class Decoder:
    """Bytes from the controller in, one `Heard` for every line that is not empty. One per connection."""

    def __init__(self) -> None:
        self._buffer = bytearray()
        self._skipping = False
        self._report = b"", OK
        self.between_lines = True
        """What comes next is the beginning of a line."""

    def receive_data(self, data: bytes) -> Iterable[Heard]:
        """The lines that are complete with `data`. Taking them is what reads: exhaust the iterator."""
        count = len(data) // len(OK_LINE)
        if data == OK_LINE * count and self.between_lines:
            return (OK,) * count
        return self._lines(data)

    def _lines(self, data: bytes) -> Iterator[Heard]:
        for piece in data.splitlines(keepends=True):
            self._buffer += piece
            ended = self.between_lines = piece.endswith((b"\n", b"\r"))
            if len(self._buffer) > MAX_LINE_BYTES and not self._skipping:
                self._skipping = True
                yield Heard("", ProtocolFault("too_long", f"over {MAX_LINE_BYTES} bytes without a line end"))
            if self._skipping:
                self._skipping = not ended
                self._buffer.clear()
            elif ended:
                raw = bytes(self._buffer).strip()
                self._buffer.clear()
                if raw:
                    yield self._read(raw)

    def _read(self, raw: bytes) -> Heard:
        """A machine that stands reports the same all night: that is read once."""
        if raw == b"ok":
            return OK
        if raw == self._report[0]:
            return self._report[1]
        heard = Heard(printable(raw), parse_line(raw))
        if raw.startswith(b"<"):
            self._report = raw, heard
        return heard


def printable(raw: bytes) -> str:
    """Wire bytes for people: bounded, everything outside ASCII escaped."""
    return raw[:CONSOLE_TEXT_LIMIT].decode("latin-1").encode("unicode_escape").decode("ascii")


def parse_line(raw: bytes) -> Message | ProtocolFault:
    """What one line, without its end, means. Never raises."""
    if not raw.isascii() or not raw.decode("ascii").isprintable():
        # Grbl prints ASCII alone; anything else is noise, or a name in a grblHAL text, and must not pass for an answer.
        return _not_ascii(raw)
    text = raw.decode("ascii")
    try:
        return _parse(text)
    except MalformedReportError as error:
        return ProtocolFault("malformed", f"{error}: {text[:CONSOLE_TEXT_LIMIT]}")


def _not_ascii(raw: bytes) -> Message | ProtocolFault:
    if raw.startswith((b"[MSG:", b"[FILE:", b"[VER:")) and raw.endswith(b"]"):
        text = raw.decode("utf-8", "replace")
        if text.isprintable():
            return _parse_brackets(text)
    return ProtocolFault("malformed", f"not ASCII: {printable(raw)}")


def _parse(text: str) -> Message:
    if text == "ok":
        return Ok()
    if text[0] == "<":
        return parse_report(text)
    if text[0] == "[":
        return _parse_brackets(text)
    if text[0] == "$":
        return _parse_dollar(text)
    if text[0] == ">" and (answer := _STARTUP_ANSWER.fullmatch(text)):
        return StartupAnswer(answer[1], int(answer[2]) if answer[2] else None)
    if match := _CODE.fullmatch(text):
        kind = Refusal if match[1].lower() == "error" else AlarmRaised
        number = match[2]
        return kind(None, number) if _count(number) is None else kind(int(number))
    if match := _BANNER.fullmatch(text):
        return Banner(text, "grblhal" if match[1].lower() == "grblhal" else "grbl", match[2])
    return FreeText(text)


def _parse_dollar(text: str) -> Message:
    if match := _SETTING.fullmatch(text):
        return SettingValue(int(match[1]), _bare(match[2]))
    if match := _STARTUP.fullmatch(text):
        return StartupBlock(int(match[1]), match[2])
    return FreeText(text)


def _bare(value: str) -> str:
    """Grbl built with names says `$0=10 (step pulse, usec)`."""
    return value.partition(" (")[0].strip() if value.endswith(")") else value


def _parse_brackets(text: str) -> Message:
    match = _BRACKETS.fullmatch(text)
    if match is None:
        if not text.endswith("]"):
            raise MalformedReportError("a message ends with ']'")
        return FreeText(text)
    key, value = match[1], match[2] or ""
    if key in _OFFSET_NAMES:
        return _offset(key, value)
    reader = _READERS.get(key)
    return Fact(key, value) if reader is None else reader(value)


def _offset(name: str, value: str) -> Message:
    """`[G54:x,y,z]`, `[TLO:z]`; `[HOME:x,y,z:mask]` and `[TLR:0]` of grblHAL."""
    values, _, _ = value.partition(":")
    inches = are_inches(values)
    return OffsetReported(name, in_mm(numbers(values), inches=inches), inches)


def _probe(value: str) -> Message:
    values, _, flag = value.partition(":")
    if flag not in ("0", "1"):
        raise MalformedReportError("[PRB:] ends with 0 or 1")
    inches = are_inches(values)
    return ProbeResult(in_mm(numbers(values), inches=inches), flag == "1", inches)


def _parser_state(value: str) -> Message:
    return ParserState(tuple(word.rstrip(".") for word in value.split()))


def _version(value: str) -> Message:
    """`1.1h.20190830:info`: the build is what follows the last dot."""
    numbers_, _, info = value.partition(":")
    version, _, build = numbers_.rpartition(".")
    return Version(version or numbers_, build if version else "", info)


def _options(value: str) -> Message:
    letters, *rest = value.split(",")
    counts = [_count(part) for part in rest[:4]]
    counts += [None] * (4 - len(counts))
    return Options(letters, *counts)


def _axes(value: str) -> Message:
    _, _, names = value.partition(":")
    letters = tuple(name.lower() for name in names if name.isalpha())
    if not letters or len(set(letters)) != len(letters):
        raise MalformedReportError("[AXS:] names each axis once")
    return AxisNames(letters)


def _file(value: str) -> Message:
    path, _, rest = value.partition("|SIZE:")
    return FileListed(path, _count(rest.partition("|")[0]))


def _setting(value: str) -> Message:
    parts = [*value.split("|"), *[""] * 10][:10]
    number = _count(parts[0])
    if number is None:
        raise MalformedReportError("[SETTING:] begins with a number")
    return SettingEnumerated(
        number=number,
        group=_count(parts[1]),
        name=parts[2],
        unit=parts[3],
        datatype=_count(parts[4]),
        format=parts[5],
        minimum=_limit(parts[6]),
        maximum=_limit(parts[7]),
        reboot=parts[8] == "1",
        optional=parts[9] == "1",
    )


def _group(value: str) -> Message:
    parts = [*value.split("|"), "", ""][:3]
    number = _count(parts[0])
    if number is None:
        raise MalformedReportError("[SETTINGGROUP:] begins with a number")
    return SettingGroup(number, _count(parts[1]), parts[2])


def _described(value: str) -> Message:
    number, _, text = value.partition("|")
    if _count(number) is None:
        raise MalformedReportError("[SETTINGDESCR:] begins with a number")
    return SettingDescribed(int(number), text)


def _code(value: str) -> tuple[int, str]:
    """`n|short|text`; the longest of the two texts."""
    parts = value.split("|", 2)
    number = _count(parts[0])
    if number is None:
        raise MalformedReportError("a code is a number")
    return number, max(parts[1:], key=len, default="")


def _count(text: str) -> int | None:
    return int(text) if text.isascii() and text.isdigit() and len(text) <= 15 else None


def _limit(text: str) -> float | None:
    try:
        return numbers(text)[0]
    except MalformedReportError:
        return None


_READERS: Final[dict[str, Callable[[str], Message]]] = {
    "MSG": Said,
    "GC": _parser_state,
    "PRB": _probe,
    "VER": _version,
    "OPT": _options,
    "NEWOPT": lambda value: NewOptions(tuple(word for word in value.split(",") if word)),
    "AXS": _axes,
    "HLP": Help,
    "echo": Echo,
    "FILE": _file,
    "SETTING": _setting,
    "SETTINGGROUP": _group,
    "SETTINGDESCR": _described,
    "ALARMCODE": lambda value: CodeEnumerated("alarm", *_code(value)),
    "ERRORCODE": lambda value: CodeEnumerated("error", *_code(value)),
}
