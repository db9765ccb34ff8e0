"""What comes from a controller, as any bytes: ElVinto messages, Grbl lines, NC frames and their answers.

Not the engines: those are driven by hostile wires elsewhere (tests/protocol). The one rule: a parser is asked twice,
the second time with its input cut into pieces, and must say the same.
"""

from collections.abc import Iterable, Iterator
from typing import Any

from protocol.elvinto import codec as elvinto_codec
from protocol.elvinto.dialect import Dialect
from protocol.events import ProtocolFault
from protocol.grbl import codec as grbl_codec
from protocol.grbl import settings as grbl_settings
from protocol.grbl.messages import SettingValue
from protocol.ncframe import answers, codec

DIALECTS = (Dialect(), Dialect(require_header=False, crc_radix=16, encoding="cp1251", max_message_bytes=300))
FAULT_CHARS = 4 * elvinto_codec.CONSOLE_TEXT_LIMIT + 100
"""A fault shows a byte outside ASCII as four characters."""


def pieces(data: bytes) -> Iterator[bytes]:
    """The same bytes in pieces of 1 to 17, whose sizes follow from the bytes."""
    at = 0
    while at < len(data):
        size = 1 + (data[at] * 7 + at) % 17
        yield data[at : at + size]
        at += size


def elvinto(data: bytes) -> None:
    """Whatever the machine says is messages and faults; what was read is read again from what we would write."""
    for dialect in DIALECTS:
        whole = list(_elvinto_items([data], dialect))
        assert whole == list(_elvinto_items(pieces(data), dialect))
        for item in whole:
            if isinstance(item, ProtocolFault):
                assert len(item.detail) <= FAULT_CHARS
                continue
            assert len(item.text) <= dialect.max_message_bytes
            written = elvinto_codec.encode_message(item.name, item.params)
            again = elvinto_codec.parse_message(written)
            assert (again.name, again.params) == (item.name, item.params)
            framed = elvinto_codec.frame(written, 7, Dialect(max_message_bytes=1 << 20))
            [back] = _elvinto_items([framed], Dialect(max_message_bytes=1 << 20))
            if item.name not in elvinto_codec.HEADER_NAMES:
                assert (back.name, back.params) == (item.name, item.params)


def _elvinto_items(parts: Iterable[bytes], dialect: Dialect) -> Iterator[Any]:
    decoder = elvinto_codec.Decoder(dialect)
    for part in parts:
        decoder.receive_data(part)
        assert len(decoder._buffer) <= dialect.max_message_bytes
        while (item := decoder.next_item()) is not None:
            yield item


def grbl(data: bytes) -> None:
    """Whatever the controller says is lines with a meaning, and faults; texts for people are bounded and printable."""
    whole = list(_grbl_lines([data]))
    assert whole == list(_grbl_lines(pieces(data)))
    for heard in whole:
        assert len(heard.text) <= 4 * grbl_codec.CONSOLE_TEXT_LIMIT
        assert heard.text.isprintable()
        if isinstance(heard.message, SettingValue):
            _setting(heard.message)


def _grbl_lines(parts: Iterable[bytes]) -> Iterator[Any]:
    decoder = grbl_codec.Decoder()
    for part in parts:
        yield from decoder.receive_data(part)
        assert len(decoder._buffer) <= grbl_codec.MAX_LINE_BYTES


def _setting(said: SettingValue) -> None:
    for grblhal in (False, True):
        setting = grbl_settings.known(said.number, grblhal=grblhal)
        if setting is not None:
            reason = setting.valid(said.value)
            assert reason is None or reason


def ncframe(data: bytes) -> None:
    """Bytes and texts that are a frame are exactly one, and nothing else is; answers have one reading or none."""
    _same_frame(lambda: codec.Frame.from_bytes(data), lambda frame: frame.to_bytes() == data)
    text = data.decode("latin-1")
    _same_frame(lambda: codec.Frame.from_text(text), lambda frame: frame.to_text() == text)
    for counter in (False, True):
        reading = answers.read(data, counter=counter)
        if reading is not None and reading.count is not None:
            assert counter
            assert 0 <= reading.count < 1 << 8 * codec.COUNT_BYTES
            assert answers.read(data, counter=counter, plausible=frozenset({reading.count})) is not None
        assert answers.console(data[:100], counter=counter).isascii()


def _same_frame(read: Any, same: Any) -> None:
    try:
        frame = read()
    except codec.FrameError:
        return
    assert same(frame)
    assert codec.Frame.from_bytes(frame.to_bytes()) == codec.Frame.from_text(frame.to_text()) == frame
    for check in ("none", "xor", "crc8"):
        sealed = codec.seal(frame.sendable, check)
        assert sealed[0] not in (codec.ENQ, codec.CAN)
        length = codec.frame_bytes(sealed[0])
        assert codec.check_bytes(sealed[:length], check) == sealed[length:]
