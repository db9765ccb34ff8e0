"""The body of an upload as a stream of pieces: the file itself, or the part `file` of a multipart form.

Nothing but a piece is collected here, neither in memory nor in a temporary file: a program of 10 GB passes through.
The one rule: a piece is handed on before the next one is read, so that a slow disk slows the sender and nothing else.
"""

from collections import deque
from collections.abc import AsyncIterator

from python_multipart.exceptions import FormParserError
from python_multipart.multipart import MultipartParser, parse_options_header
from starlette.requests import Request

from server.problems import ProblemError

FIELD = "file"
MAX_PART_HEADER_BYTES = 8192
MAX_NAME_CHARS = 255
PIECE_BYTES = 256 * 1024
"""What comes of a network in pieces of some kB is handed to the disk's thread in pieces of this: a thousand times a
second the handing over would cost the loop more than the taking in."""


def is_multipart(request: Request) -> bool:
    """Whether the body is a form (RFC 7578) and not the file itself."""
    return request.headers.get("content-type", "").lower().startswith("multipart/form-data")


class FileOfForm:
    """The part `file` of a multipart body.

    `name` is known after `find()`; then `chunks()` gives the content. Raises ProblemError for what is no such form.
    """

    def __init__(self, request: Request) -> None:
        _, options = parse_options_header(request.headers.get("content-type", ""))
        boundary = options.get(b"boundary")
        if not boundary:
            raise ProblemError("invalid_request", "The Content-Type multipart/form-data has no boundary.")
        self.name: str | None = None
        self._stream = request.stream()
        self._pieces: deque[bytes] = deque()
        self._found = False
        self._inside = False
        self._ended = False
        self._field = b""
        self._value = b""
        self._header_bytes = 0
        self._parser = MultipartParser(
            boundary,
            {
                "on_part_begin": self._on_part_begin,
                "on_header_field": self._on_header_field,
                "on_header_value": self._on_header_value,
                "on_header_end": self._on_header_end,
                "on_part_data": self._on_part_data,
                "on_part_end": self._on_part_end,
                "on_end": self._on_end,
            },
        )

    async def find(self) -> None:
        """Read up to the part `file`; its file name is then in `name` (None if it has none)."""
        while not self._found and await self._read():
            pass
        if not self._found:
            raise ProblemError("invalid_request", f"The form has no part named {FIELD!r}.")

    async def chunks(self) -> AsyncIterator[bytes]:
        """The content of the part, piece by piece. Raises ProblemError when the form breaks off."""
        while True:
            while self._pieces:
                yield self._pieces.popleft()
            if not await self._read():
                break
        if not self._ended:
            raise ProblemError("invalid_request", "The form breaks off before its end; nothing was kept.")

    async def _read(self) -> bool:
        """Parse what the next piece of the body holds; False at the end of the body."""
        data = await anext(self._stream, None)
        if data is None:
            return False
        try:
            self._parser.write(data)
        except FormParserError as error:
            raise ProblemError("invalid_request", f"The multipart form is malformed: {error}.") from error
        return True

    def _on_part_begin(self) -> None:
        self._header_bytes = 0

    def _on_header_field(self, data: bytes, start: int, end: int) -> None:
        self._field += self._bounded(data[start:end])

    def _on_header_value(self, data: bytes, start: int, end: int) -> None:
        self._value += self._bounded(data[start:end])

    def _bounded(self, text: bytes) -> bytes:
        self._header_bytes += len(text)
        if self._header_bytes > MAX_PART_HEADER_BYTES:
            raise FormParserError("the header of a part is too long")
        return text

    def _on_header_end(self) -> None:
        if self._field.lower() == b"content-disposition":
            _, options = parse_options_header(self._value)
            # The first part of this name is the file; whatever else a form sends is skipped.
            if options.get(b"name") == FIELD.encode() and not self._found:
                self._found = self._inside = True
                filename = options.get(b"filename")
                self.name = filename.decode("utf-8", "replace") if filename else None
        self._field = self._value = b""

    def _on_part_data(self, data: bytes, start: int, end: int) -> None:
        if self._inside:
            self._pieces.append(data[start:end])

    def _on_part_end(self) -> None:
        self._inside = False

    def _on_end(self) -> None:
        self._ended = True


async def gathered(chunks: AsyncIterator[bytes], size: int = PIECE_BYTES) -> AsyncIterator[bytes]:
    """The same bytes in pieces of `size` and more; the last may be smaller."""
    waiting: list[bytes] = []
    waiting_bytes = 0
    async for chunk in chunks:
        waiting.append(chunk)
        waiting_bytes += len(chunk)
        if waiting_bytes >= size:
            yield b"".join(waiting)
            waiting.clear()
            waiting_bytes = 0
    if waiting_bytes:
        yield b"".join(waiting)


def program_name(*candidates: str | None) -> str:
    """The first name that is given, without its directories. Raises ProblemError when there is none to use.

    A name is for people only (programs are stored under their hash), but it is shown and logged.
    """
    given = next((name for name in candidates if name), None)
    if given is None:
        raise ProblemError("invalid_request", "Give the program a name: POST /api/v1/programs?name=part.nc")
    name = given.replace("\\", "/").rpartition("/")[2].strip()
    # Not printable: what steers a terminal, and what turns the direction of a text, too (U+202E hides a real ending).
    if not 0 < len(name) <= MAX_NAME_CHARS or not name.isprintable() or not name.strip("."):
        raise ProblemError("invalid_request", f"A program's name is 1 to {MAX_NAME_CHARS} printable characters.")
    return name
