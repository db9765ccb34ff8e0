"""The codec against the vectors that come from the documents, and against any bytes."""

import base64
import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from protocol.elvinto.codec import (
    Decoder,
    MalformedError,
    Message,
    checksum,
    encode_gcode,
    encode_message,
    frame,
    parse_message,
)
from protocol.elvinto.dialect import Dialect
from protocol.errors import MessageTooLongError
from protocol.events import ProtocolFault

VECTORS = json.loads((Path(__file__).parents[2] / "vectors" / "elvinto.json").read_text())


def drain(decoder: Decoder) -> list[Message | ProtocolFault]:
    items = []
    while (item := decoder.next_item()) is not None:
        items.append(item)
    return items


@pytest.mark.parametrize("vector", VECTORS["checksums"], ids=lambda v: v["text"][:30])
def test_checksum_is_that_of_the_document(vector):
    assert checksum(base64.b64decode(vector["message_base64"])) == vector["checksum"]


@pytest.mark.parametrize("vector", VECTORS["frames"], ids=lambda v: v["wire"][:20])
def test_frames_are_byte_for_byte_those_of_the_document(vector):
    dialect = Dialect(**vector["dialect"])
    message = vector["message"].encode()
    assert frame(message, vector["id"], dialect).decode() == vector["wire"]


def test_the_scope_gcode_covers_the_code_alone():
    dialect = Dialect(checksum_scope="gcode")
    in_words = frame(encode_gcode(("G28",)), 9, dialect).decode()
    assert in_words.startswith("CRC16,VALUE<#472,MD5<#d6b990976a34a06c7df4a718d3107c56,ID<#9;")


@pytest.mark.parametrize("vector", VECTORS["reads"], ids=lambda v: v["wire"][:20])
def test_messages_are_read_as_the_document_prints_them(vector):
    message = parse_message(vector["wire"].encode())
    assert (message.name, dict(message.params)) == (vector["name"], vector["params"])


@pytest.mark.parametrize("text", VECTORS["malformed"])
def test_malformed_messages_are_told_and_skipped(text):
    with pytest.raises(MalformedError):
        parse_message(text.encode())
    decoder = Decoder(Dialect(require_header=False))
    decoder.receive_data(text.encode() + b"READY;")
    *faults, last = drain(decoder)
    assert faults
    assert all(isinstance(item, ProtocolFault) and item.kind == "malformed" for item in faults)
    assert isinstance(last, Message)
    assert last.name == "READY"


def test_values_that_cannot_stand_plain_travel_as_base64():
    assert encode_message("RUN", {"NAME": "деталь 1.nc"}) == b"RUN,NAME<0LTQtdGC0LDQu9GMIDEubmM=;"
    assert encode_gcode(("G1X1,5;<>",)) == b"GCODE,DATA<RzFYMSw1Ozw+;"
    assert encode_message("RUN", {"NAME": " a"}) == b"RUN,NAME<IGE=;"
    assert encode_message("FILE", {"NAME": ""}) == b"FILE,NAME<#;"


def test_another_encoding_of_file_names():
    raw = encode_message("FILE", {"NAME": "деталь"}, encoding="cp1251")
    assert parse_message(raw, "cp1251").params["NAME"] == "деталь"


@given(st.text(max_size=60))
def test_every_value_comes_back_as_it_was(value):
    raw = encode_message("FILE", {"NAME": value.replace("\ud800", "")}) if value.isascii() else None
    if raw is None:
        try:
            raw = encode_message("FILE", {"NAME": value})
        except UnicodeEncodeError:
            return
    assert parse_message(raw).params["NAME"] == value


def test_a_message_over_the_machines_buffer_is_refused():
    with pytest.raises(MessageTooLongError, match="fewer blocks"):
        frame(encode_gcode(("G1X1",) * 100), 1000, Dialect(max_message_bytes=256))


@given(st.binary(max_size=400), st.lists(st.integers(1, 30), max_size=20))
def test_any_bytes_in_any_pieces_read_the_same_and_raise_nothing(data, cuts):
    whole, pieces = Decoder(Dialect(max_message_bytes=64)), Decoder(Dialect(max_message_bytes=64))
    whole.receive_data(data)
    rest = data
    for cut in cuts:
        pieces.receive_data(rest[:cut])
        rest = rest[cut:]
    pieces.receive_data(rest)
    got, expected = drain(pieces), drain(whole)
    assert [i for i in got if isinstance(i, Message)] == [i for i in expected if isinstance(i, Message)]
    assert len(got) == len(expected)


wire_frames = st.lists(
    st.sampled_from(["OK,ID<#1001;", "RECEIVED,ID<#1001;", "READY;", "STATE,TYPE<#idle,MX<#1.5,ISABS<#Y;"]),
    min_size=1,
    max_size=6,
)


@given(wire_frames, st.lists(st.integers(1, 50), max_size=30))
def test_verified_messages_come_through_however_they_are_cut(messages, cuts):
    dialect = Dialect()
    data = b"".join(frame(m.encode(), 0, dialect) for m in messages)
    decoder = Decoder(dialect)
    for cut in cuts:
        decoder.receive_data(data[:cut])
        data = data[cut:]
    decoder.receive_data(data)
    assert [item.text for item in drain(decoder)] == messages


@given(st.integers(0, 7), st.data())
def test_a_flipped_bit_never_yields_another_message(bit, data):
    message = b"ERROR,ID<#1018,NUM<#3;"
    raw = bytearray(frame(message, 0, Dialect()))
    start = len(raw) - len(message)
    position = data.draw(st.integers(start, len(raw) - 2))
    raw[position] ^= 1 << bit
    decoder = Decoder(Dialect())
    decoder.receive_data(bytes(raw))
    assert not [item for item in drain(decoder) if isinstance(item, Message)]


def test_a_message_without_header_is_believed_only_where_the_dialect_says_so():
    strict, lenient = Decoder(Dialect()), Decoder(Dialect(require_header=False))
    for decoder in (strict, lenient):
        decoder.receive_data(b"READY;")
    (fault,) = drain(strict)
    assert isinstance(fault, ProtocolFault)
    assert fault.kind == "no_header"
    (message,) = drain(lenient)
    assert isinstance(message, Message)


def test_a_header_counts_for_the_next_message_alone():
    header = frame(b"READY;", 0, Dialect())[: -len(b"READY;")]
    decoder = Decoder(Dialect())
    decoder.receive_data(header + header + b"READY;READY;")
    first, second = drain(decoder)
    assert isinstance(first, Message)
    assert isinstance(second, ProtocolFault)


@pytest.mark.parametrize("name", ["CRC", "CRC16"])
def test_both_names_of_the_header_are_read(name):
    decoder = Decoder(Dialect())
    decoder.receive_data(frame(b"READY;", 0, Dialect(header_name=name)))
    assert isinstance(decoder.next_item(), Message)


def test_hexadecimal_checksums_and_upper_case_md5():
    dialect = Dialect(crc_radix=16)
    raw = frame(b"READY;", 0, dialect).replace(b"a1fe1328575795c2966c395eb88d2c51", b"A1FE1328575795C2966C395EB88D2C51")
    decoder = Decoder(dialect)
    decoder.receive_data(raw)
    assert isinstance(decoder.next_item(), Message)


@pytest.mark.parametrize("value", [b"VALUE<#864", b"VALUE<#", b"VALUE<#86x"])
def test_a_wrong_checksum_with_a_right_md5_is_not_enough(value):
    raw = frame(b"READY;", 0, Dialect()).replace(b"VALUE<#864", value)
    decoder = Decoder(Dialect())
    decoder.receive_data(raw)
    item = decoder.next_item()
    assert isinstance(item, Message) == (value == b"VALUE<#864")


def test_blanks_between_header_and_message_are_not_the_messages_own():
    raw = frame(b"READY;", 0, Dialect()).replace(b";READY;", b";\r\nREADY;")
    decoder = Decoder(Dialect())
    decoder.receive_data(raw)
    assert isinstance(decoder.next_item(), Message)


def test_an_endless_message_is_skipped_and_memory_stays_bounded():
    decoder = Decoder(Dialect(max_message_bytes=100, require_header=False))
    for _ in range(1000):
        decoder.receive_data(b"x" * 99)
    assert len(decoder._buffer) <= 200
    decoder.receive_data(b"tail;READY;")
    fault, message = drain(decoder)
    assert isinstance(fault, ProtocolFault)
    assert fault.kind == "too_long"
    assert isinstance(message, Message)
