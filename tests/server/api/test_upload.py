import contextlib
from collections.abc import AsyncIterator

import pytest
from hypothesis import given
from hypothesis import strategies as st
from starlette.requests import Request
from starlette.types import Message

from server.api.upload import (
    MAX_NAME_CHARS,
    MAX_PART_HEADER_BYTES,
    FileOfForm,
    gathered,
    is_multipart,
    program_name,
)
from server.problems import ProblemError
from tests.harness.simloop import run_simulated as run

BOUNDARY = b"----mill"


def part(disposition: bytes, content: bytes) -> bytes:
    return b"--" + BOUNDARY + b"\r\nContent-Disposition: form-data; " + disposition + b"\r\n\r\n" + content + b"\r\n"


END = b"--" + BOUNDARY + b"--\r\n"


def request(body: bytes, *, size: int = 7, content_type: str = "multipart/form-data; boundary=----mill") -> Request:
    pieces = [body[at : at + size] for at in range(0, len(body), size)]

    async def receive() -> Message:
        piece = pieces.pop(0) if pieces else b""
        return {"type": "http.request", "body": piece, "more_body": bool(pieces)}

    headers = [(b"content-type", content_type.encode())]
    return Request({"type": "http", "method": "POST", "path": "/", "headers": headers}, receive)


def read(body: bytes, **options: int) -> tuple[str | None, bytes]:
    async def main() -> tuple[str | None, bytes]:
        form = FileOfForm(request(body, **options))
        await form.find()
        chunks: AsyncIterator[bytes] = form.chunks()
        return form.name, b"".join([chunk async for chunk in chunks])

    return run(main())


def refused(body: bytes, words: str) -> None:
    with pytest.raises(ProblemError, match=words) as caught:
        read(body)
    assert caught.value.code == "invalid_request"


@given(content=st.binary(max_size=200), size=st.integers(1, 300))
def test_any_content_in_any_pieces_comes_out_as_it_was(content: bytes, size: int) -> None:
    body = (
        part(b'name="note"', b"x") + part(b'name="file"; filename="part.nc"', content) + part(b'name="z"', b"y") + END
    )
    assert read(body, size=size) == ("part.nc", content)


@given(st.binary(max_size=200), st.integers(1, 50))
def test_any_bytes_are_refused_or_read_but_never_break_anything(junk: bytes, size: int) -> None:
    with contextlib.suppress(ProblemError):
        read(b"--" + BOUNDARY + b"\r\n" + junk, size=size)


def test_content_that_looks_like_a_boundary() -> None:
    content = b"\r\n------mil\r\n--\r\n--" + BOUNDARY + b"x"
    assert read(part(b'name="file"', content) + END, size=3)[1].startswith(b"\r\n------mil")


def test_only_the_first_file_counts() -> None:
    body = part(b'name="file"; filename="a.nc"', b"first") + part(b'name="file"; filename="b.nc"', b"second") + END
    assert read(body) == ("a.nc", b"first")


def test_a_file_without_a_name_and_one_with_a_foreign_one() -> None:
    assert read(part(b'name="file"', b"x") + END)[0] is None
    assert read(part('name="file"; filename="деталь.nc"'.encode(), b"x") + END)[0] == "деталь.nc"


def test_forms_that_are_none() -> None:
    refused(part(b'name="other"', b"x") + END, "no part named")
    refused(b"", "no part named")
    refused(b"G21\nM30\n", "malformed|no part")
    refused(part(b'name="file"', b"x")[:-4], "breaks off")
    refused(part(b'name="file"', b"x"), "breaks off")
    refused(part(b'name="' + b"x" * (MAX_PART_HEADER_BYTES + 1) + b'"', b"x"), "malformed")


def test_a_form_without_a_boundary() -> None:
    with pytest.raises(ProblemError, match="boundary"):
        FileOfForm(request(b"", content_type="multipart/form-data"))


def test_what_is_a_form() -> None:
    assert is_multipart(request(b""))
    assert not is_multipart(request(b"", content_type="text/plain"))


@pytest.mark.parametrize(
    ("candidates", "name"),
    [
        (("part.nc", "other.nc"), "part.nc"),
        ((None, "other.nc"), "other.nc"),
        (("", "other.nc"), "other.nc"),
        (("../../etc/passwd",), "passwd"),
        (("C:\\cam\\деталь 1.nc",), "деталь 1.nc"),
    ],
)
def test_names(candidates: tuple[str | None, ...], name: str) -> None:
    assert program_name(*candidates) == name


@pytest.mark.parametrize("name", [None, "", "  ", "dir/", "a\nb", "a\x00", "\u202egpj.nc", "x" * (MAX_NAME_CHARS + 1)])
def test_names_that_are_refused(name: str | None) -> None:
    with pytest.raises(ProblemError):
        program_name(name)


@pytest.mark.parametrize(
    "name",
    [
        ".",
        "..",
        "../..",
        "a/..",
        "a\\..",
        "...",
        "x\x00.nc",
        "x\n.nc",
        "x\u202egpj.nc",
        "x\x1b[2J",
        "x" * 300,
        " ",
        "/",
    ],
)
def test_names_that_are_refused_whatever_they_would_do(name: str) -> None:
    with pytest.raises(ProblemError) as refused:
        program_name(name)
    assert refused.value.code == "invalid_request"


@pytest.mark.parametrize(
    ("name", "kept"),
    [("/etc/passwd", "passwd"), ("..\\..\\part.nc", "part.nc"), ("CON", "CON"), ("aux.nc", "aux.nc"), ("=1+1", "=1+1")],
)
def test_a_name_is_for_people_alone(name: str, kept: str) -> None:
    """Files are stored under their hash, so the name of a device, or of a formula, is a name."""
    assert program_name(name) == kept


async def pieces_of(*chunks: bytes) -> AsyncIterator[bytes]:
    for chunk in chunks:
        yield chunk


@given(st.lists(st.binary(max_size=12), max_size=30), st.integers(1, 20))
def test_small_pieces_are_gathered_and_nothing_else_changes(chunks: list[bytes], size: int) -> None:
    async def main() -> list[bytes]:
        return [piece async for piece in gathered(pieces_of(*chunks), size)]

    pieces = run(main())
    assert b"".join(pieces) == b"".join(chunks)
    assert all(len(piece) >= size for piece in pieces[:-1])
    assert all(len(piece) < size + 12 for piece in pieces)
    assert b"" not in pieces


def test_no_more_is_read_than_a_piece_before_it_is_handed_on() -> None:
    read_bytes = 0

    async def chunks() -> AsyncIterator[bytes]:
        nonlocal read_bytes
        for _ in range(100):
            read_bytes += 10
            yield b"G1 X12345\n"

    async def main() -> None:
        handed_on = 0
        async for piece in gathered(chunks(), 64):
            handed_on += len(piece)
            assert read_bytes == handed_on

    run(main())
    assert read_bytes == 1000
