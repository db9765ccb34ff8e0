"""Asks an unknown controller who it is: which protocol, which dialect. Bytes over a line, nothing that moves a machine.

What is sent, in this order, and no further once something has answered: nothing for a moment (a banner may come by
itself); ENQ (0x05, NC frames); `?` (Grbl's real-time question), then `$I` to one that stands idle or in alarm; READY
and the question for the position (W95 under ID 1) in each way of writing the check header (ElVinto). The one rule: text
goes out only to what took no notice of single bytes, for to a lathe without a check byte text would be a frame.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any, Literal, Protocol

from protocol.elvinto.codec import Decoder as ElvintoDecoder
from protocol.elvinto.codec import Message, encode_gcode, encode_message, frame
from protocol.elvinto.dialect import Dialect
from protocol.grbl.codec import Decoder as GrblDecoder
from protocol.grbl.messages import Banner, Fact, Options, Version
from protocol.grbl.reports import StatusReport
from protocol.ncframe import answers, codec

BANNER_WAIT_S = 3.0
"""The boot loader of an Arduino that was restarted by opening its port."""
LISTEN_S = 0.4
ANSWER_S = 0.6
"""Twice the standard's 200 to 400 ms, in which an ElVinto machine answers; the others answer within milliseconds."""
TRIES = 2
"""Of each question: what lay in the controller's buffer may spoil the first."""
HEARD_BYTES_MOST = 8192
PROBE_ID = 1
"""The lowest: a machine that has worked accepts no ID that is not above its last, and executes nothing under it."""

ProtocolName = Literal["ncframe", "grbl", "elvinto"]
ORDER: tuple[ProtocolName, ...] = ("ncframe", "grbl", "elvinto")
"""Single bytes first (see the head of this file)."""


class Line(Protocol):
    """An open line to a controller."""

    def say(self, data: bytes) -> None:
        """Hand bytes to the wire. Raises OSError."""

    def hear(self, seconds: float) -> bytes:
        """What comes in within so many seconds. Raises OSError."""


@dataclass(frozen=True, slots=True)
class Answer:
    """Who answered, and what it said. `dialect`: keys of the section of its protocol; `unsure`: those that nothing it
    said could tell."""

    protocol: ProtocolName
    says: str
    dialect: Mapping[str, Any] = field(default_factory=dict)
    unsure: tuple[str, ...] = ()


@dataclass(slots=True)
class Talk:
    """A line and what went over it."""

    line: Line
    sent: list[bytes] = field(default_factory=list)
    heard: bytearray = field(default_factory=bytearray)

    def ask(self, data: bytes, seconds: float = ANSWER_S) -> bytes:
        """Say something and hear what comes."""
        self.sent.append(data)
        self.line.say(data)
        return self.listen(seconds)

    def listen(self, seconds: float) -> bytes:
        """Hear what comes by itself."""
        came = self.line.hear(seconds)[:HEARD_BYTES_MOST]
        if len(self.heard) < HEARD_BYTES_MOST:
            self.heard += came
        return came


def ask(talk: Talk, protocols: Sequence[ProtocolName] = ORDER, *, restarts: bool = False) -> Answer | None:
    """Who is at the other end, if it speaks one of these protocols. `restarts`: opening the port may have restarted it.

    Raises OSError when the line breaks.
    """
    greeting = talk.listen(BANNER_WAIT_S if restarts else LISTEN_S)
    for protocol in (one for one in ORDER if one in protocols):
        if "ncframe" in protocols and any(byte in answers.NAMES for byte in talk.heard):
            return None  # a lathe, though it says no more than NAK: text would do harm
        if (answer := QUESTIONS[protocol](talk, greeting)) is not None:
            return answer
    return None


# --- NC frames ------------------------------------------------------------------------------------------------


def _ask_lathe(talk: Talk, _greeting: bytes) -> Answer | None:
    for _ in range(TRIES):
        burst = talk.ask(bytes([codec.ENQ]))
        for counter in (True, False):
            reading = answers.read(burst, counter=counter)
            if reading is None or (reading.count is None if counter else reading.acks != 1 or reading.singles != 1):
                continue
            says = f"ACK, {reading.count} frames executed" if counter else "ACK, without a counter"
            return Answer("ncframe", says, {"counter": counter}, ("check", "resolution"))
    return None


# --- Grbl -----------------------------------------------------------------------------------------------------


def _ask_grbl(talk: Talk, greeting: bytes) -> Answer | None:
    decoder = GrblDecoder()
    messages = [heard.message for heard in decoder.receive_data(greeting)]
    for _ in range(TRIES):
        messages += [heard.message for heard in decoder.receive_data(talk.ask(b"?"))]
        if _of(messages, StatusReport):
            break
    reports, banners = _of(messages, StatusReport), _of(messages, Banner)
    if not reports and not banners:
        return None
    if reports and reports[-1].status in ("idle", "alarm"):
        messages += [heard.message for heard in decoder.receive_data(talk.ask(b"$I\n"))]
    facts = {fact.key: fact.value for fact in _of(messages, Fact)}
    hal = any(one.flavour == "grblhal" for one in banners) or facts.get("FIRMWARE", "").lower() == "grblhal"
    words = [one.text for one in banners[-1:]]
    words += [f"version {one.version}" for one in _of(messages, Version)[-1:]]
    words += [f"state {one.status}" for one in reports[-1:]]
    found = {"firmware": "grblhal" if hal else "grbl-1.1", "resets_on_open": bool(_of_greeting(greeting))}
    told = bool(banners or _of(messages, Version) or _of(messages, Options))
    return Answer("grbl", ", ".join(words), found, () if told else ("firmware",))


def _of(messages: list[Any], kind: type[Any]) -> list[Any]:
    return [message for message in messages if isinstance(message, kind)]


def _of_greeting(greeting: bytes) -> list[Banner]:
    return _of([heard.message for heard in GrblDecoder().receive_data(greeting)], Banner)


# --- ElVinto --------------------------------------------------------------------------------------------------


def dialects() -> Iterator[Dialect]:
    """Every way to write the check header that the standard's contradictions allow, the usual one first."""
    for radix, name in product((10, 16), ("CRC16", "CRC")):
        yield Dialect(header_name=name, crc_radix=radix)  # type: ignore[arg-type]


def _ask_elvinto(talk: Talk, greeting: bytes) -> Answer | None:
    # What spoke by itself (READY after a start, STATE) has said already how it writes.
    spoken = [dialect for dialect in dialects() if _messages(greeting, dialect)]
    for dialect in [*spoken, *(one for one in dialects() if one not in spoken)]:
        for _ in range(TRIES):
            data = talk.ask(frame(encode_message("READY"), PROBE_ID, dialect))
            reader, messages = _read(data)
            if messages:
                return _settle(talk, replace(dialect, require_header=reader is not None), messages)
    return None


def _settle(talk: Talk, dialect: Dialect, messages: list[Message]) -> Answer:
    """It answers; what its checksum is taken over shows only in a command, and only where it acknowledges one."""
    unsure: tuple[str, ...] = ("checksum_scope",)
    scopes: tuple[Literal["message", "gcode"], ...] = ("message", "gcode")
    for scope in scopes:
        tried = replace(dialect, checksum_scope=scope)
        answered = _read(talk.ask(frame(encode_gcode(("W95",)), PROBE_ID, tried)))[1]
        messages += answered
        if answered:
            dialect, unsure = tried, ()
            break
    keys = {
        "header_name": dialect.header_name,
        "crc_radix": dialect.crc_radix,
        "checksum_scope": dialect.checksum_scope,
        "require_header": dialect.require_header,
    }
    return Answer("elvinto", ", ".join(dict.fromkeys(message.name for message in messages)), keys, unsure)


def _read(data: bytes) -> tuple[Dialect | None, list[Message]]:
    """The messages in `data`, and the dialect in which they are verified; None: they come without a check header."""
    for dialect in dialects():
        if messages := _messages(data, dialect):
            return dialect, messages
    known = {"READY", "STATE", "RECEIVED", "RECEIVE", "OK", "ERROR", "TOOL"}
    plain = _messages(data, Dialect(require_header=False))
    return None, [message for message in plain if message.name in known]


def _messages(data: bytes, dialect: Dialect) -> list[Message]:
    decoder = ElvintoDecoder(dialect)
    decoder.receive_data(data)
    found = []
    while (item := decoder.next_item()) is not None:
        if isinstance(item, Message):
            found.append(item)
    return found


QUESTIONS: Mapping[ProtocolName, Callable[[Talk, bytes], Answer | None]] = {
    "ncframe": _ask_lathe,
    "grbl": _ask_grbl,
    "elvinto": _ask_elvinto,
}
