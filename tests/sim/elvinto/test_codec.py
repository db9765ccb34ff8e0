"""The machine's reading of the wire against the vectors of the documents."""

import base64
import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.elvinto.codec import CheckHeader, MalformedError, Reader, checksum, md5_hex, message, parse, with_header
from tests.harness.elvinto_peer import unframe

VECTORS: dict[str, Any] = json.loads(
    (Path(__file__).parents[2] / "vectors" / "elvinto.json").read_text(encoding="utf-8")
)


@pytest.mark.parametrize("vector", VECTORS["checksums"], ids=lambda vector: vector["text"][:30])
def test_checksums(vector: dict[str, Any]) -> None:
    data = base64.b64decode(vector["message_base64"])
    assert checksum(data) == vector["checksum"]
    assert md5_hex(data) == vector["md5"]


# The STATE without a comma is for readers of machines; a machine does not have to read it.
READS = [vector for vector in VECTORS["reads"] if " ALARMNUM" not in vector["wire"]]


@pytest.mark.parametrize("vector", READS, ids=lambda vector: vector["wire"][:30])
def test_reads(vector: dict[str, Any]) -> None:
    (raw,) = Reader(8192).feed(vector["wire"].encode())
    found = parse(raw)
    assert found.name == vector["name"]
    assert {key: value.decode() for key, value in found.params.items()} == vector["params"]


@pytest.mark.parametrize("text", VECTORS["malformed"])
def test_malformed(text: str) -> None:
    with pytest.raises(MalformedError):
        parse(text.encode())


@pytest.mark.parametrize("vector", VECTORS["frames"], ids=lambda vector: vector["wire"][-30:])
def test_headers_of_commands(vector: dict[str, Any]) -> None:
    header, body = Reader(8192).feed(vector["wire"].encode())
    found = parse(header)
    assert found.name == vector["dialect"]["header_name"]
    check = CheckHeader.of(found, vector["dialect"]["crc_radix"])
    assert check.id == vector["id"]
    gcode_only = vector["dialect"]["checksum_scope"] == "gcode"
    assert check.covers(parse(body).params["DATA"] + b";" if gcode_only else body)


def test_both_value_and_md5_must_match() -> None:
    good = CheckHeader(checksum(b"G28;"), md5_hex(b"G28;"), 1)
    assert good.covers(b"G28;")
    assert not good.covers(b"G82;"), "the sum alone does not see two bytes that changed places"
    assert checksum(b"G82;") == checksum(b"G28;")
    assert not CheckHeader(checksum(b"G28;") ^ 1, md5_hex(b"G28;"), 1).covers(b"G28;")


def test_the_hash_is_compared_without_regard_to_case() -> None:
    found = parse(f"CRC16,VALUE<#472,MD5<#{md5_hex(b'G28;').upper()};".encode())
    assert CheckHeader.of(found, 10).covers(b"G28;")


@pytest.mark.parametrize(
    "text",
    [
        "CRC16,MD5<#00;",
        "CRC16,VALUE<#1;",
        "CRC16,VALUE<#zz,MD5<#00;",
        "CRC16,VALUE<#1_0,MD5<#00;",
        "CRC16,VALUE<#+1,MD5<#00;",
        "CRC16,VALUE<#1,MD5<#00,ID<#-1;",
        "CRC16,VALUE<#1,MD5<#00,ID<#;",
        "CRC16,VALUE<#1,MD5<#00,ID<#" + "9" * 5000 + ";",
        "CRC16,VALUE<#1,MD5<//8=;",
    ],
)
def test_headers_that_are_none(text: str) -> None:
    found = parse(text.encode())
    with pytest.raises(MalformedError):
        CheckHeader.of(found, 10)


def test_values_that_do_not_go_plain() -> None:
    assert message("FILE", ("NAME", "part 1.nc")) == b"FILE,NAME<#part 1.nc;"
    for name in ("деталь, 1.nc", "a;b", "a<b", " a", "a\nb"):
        raw = message("FILE", ("NAME", name))
        assert b"#" not in raw
        assert parse(raw).params["NAME"].decode() == name
    assert parse(message("FILE", ("NAME", "деталь"), encoding="cp1251")).params["NAME"] == "деталь".encode("cp1251")


def test_own_messages_carry_a_header_without_an_id() -> None:
    assert unframe(with_header(b"READY;", name="CRC16", radix=10)) == ["READY;"]
    assert unframe(with_header(b"READY;", name="CRC", radix=16), name="CRC", radix=16) == ["READY;"]


@given(st.lists(st.binary(max_size=40).filter(lambda data: b";" not in data), max_size=6), st.data())
def test_chunking_does_not_matter(texts: list[bytes], data: st.DataObject) -> None:
    stream = b"".join(text + b";" for text in texts)
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=8)))
    pieced = Reader(30)
    out: list[bytes] = []
    for start, end in zip([0, *cuts], [*cuts, len(stream)], strict=True):
        out += pieced.feed(stream[start:end])
    assert out == Reader(30).feed(stream)


def test_an_overlong_message_is_lost_and_nothing_else() -> None:
    reader = Reader(16)
    assert reader.feed(b"A;" + b"x" * 10_000) == [b"A;"]
    assert reader.feed(b"x" * 10_000 + b";B;") == [b"", b"B;"]
    assert reader.overlong == 1


@given(st.binary(max_size=200))
def test_any_bytes_raise_nothing_but_malformed(data: bytes) -> None:
    for raw in Reader(64).feed(data):
        try:
            CheckHeader.of(parse(raw), 10)
        except MalformedError:
            continue
