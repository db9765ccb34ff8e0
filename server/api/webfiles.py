"""The files of `web/` as a browser gets them: found by listing the folder, packed with gzip, with their ETag.

Not the routes (system.py). The one rule: a file that was changed on the disk is served changed without a restart, and
no file holds up the loop while it is packed.
"""

import asyncio
import mimetypes
import re
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from pathlib import Path, PurePosixPath

from starlette.datastructures import Headers
from starlette.responses import Response

MEDIA_TYPES = {
    ".js": "text/javascript",
    ".json": "application/json",
    ".mjs": "text/javascript",
    ".svg": "image/svg+xml",
    ".wasm": "application/wasm",
}
"""What `mimetypes` reads from the system differs between systems; scripts are refused under another type."""
PACKED_TYPES = ("text/", "application/json", "application/wasm", "image/svg+xml")
PIECE_BYTES = 32 * 1024
"""Packed at a time: about a millisecond on a small computer."""
GZIP = 16 + zlib.MAX_WBITS
PAGE = "index.html"
START = "app.js"
"""What the page begins with: all that it imports is named in the page, so that a browser fetches it at once."""
IMPORT = re.compile(r"""\b(?:import|export)\b(?:[^"';()]*?\bfrom)?\s*["'](\.{1,2}/[^"']+)["']""")


@dataclass(frozen=True, slots=True)
class WebFile:
    """One file as it was at `version`."""

    version: int
    content: bytes
    packed: bytes | None
    etag: str
    media_type: str


_known: dict[str, WebFile] = {}


@cache
def web_files() -> Mapping[str, Path]:
    """The files of the pages by the path under which they are served: inside the wheel, else in the repository.

    Type declarations are for people who work on the pages.
    """
    here = Path(__file__).resolve().parents[1]
    root = next((root for root in (here / "web", here.parent / "web") if (root / PAGE).is_file()), None)
    if root is None:
        return {}
    files = (file for file in sorted(root.rglob("*")) if file.is_file() and file.suffix != ".ts")
    return {file.relative_to(root).as_posix(): file for file in files}


async def web_file(path: str) -> WebFile | None:
    """The file of this path as it is now, None where there is none."""
    file = web_files().get(path)
    if file is None:
        return None
    version = max(one.stat().st_mtime_ns for one in (web_files().values() if path == PAGE else (file,)))
    known = _known.get(path)
    if known is None or known.version != version:
        known = _known[path] = await _read(path, file, version)
    return known


async def _read(path: str, file: Path, version: int) -> WebFile:
    content = _content(path, file)
    media_type = MEDIA_TYPES.get(file.suffix) or mimetypes.guess_type(file.name)[0] or "application/octet-stream"
    packed = await _packed(content) if media_type.startswith(PACKED_TYPES) else None
    return WebFile(version, content, packed, sha256(content).hexdigest()[:32], media_type)


def _content(path: str, file: Path) -> bytes:
    content = file.read_bytes()  # from the page cache: not worth a thread
    if path != PAGE:
        return content
    links = "".join(f'<link rel="modulepreload" href="/web/{name}">\n' for name in modules(START))
    return content.replace(b"</head>", f"{links}</head>".encode(), 1)


async def _packed(content: bytes) -> bytes:
    """In pieces, between which the loop does what is more urgent."""
    packer = zlib.compressobj(wbits=GZIP)
    parts = []
    for start in range(0, len(content), PIECE_BYTES):
        parts.append(packer.compress(content[start : start + PIECE_BYTES]))
        await asyncio.sleep(0)
    return b"".join([*parts, packer.flush()])


def modules(start: str) -> list[str]:
    """A module and all that it imports, and they import; not what is loaded later, by `import()`."""
    found = [start]
    for name in found:
        if name not in web_files():
            continue
        text = web_files()[name].read_text(encoding="utf-8")
        targets = (_joined(name, target) for target in IMPORT.findall(text))
        found += [target for target in dict.fromkeys(targets) if target not in found]
    return found


def _joined(name: str, target: str) -> str:
    """Where `target` leads from the file `name`."""
    parts: list[str] = []
    for part in (PurePosixPath(name).parent / target).parts:
        if part == "..":
            parts.pop()
        else:
            parts.append(part)
    return "/".join(parts)


def answer(file: WebFile, headers: Headers) -> Response:
    """The file, packed where the browser takes that, or 304 where it has it already."""
    packed = file.packed is not None and _takes_gzip(headers.get("accept-encoding", ""))
    etag = f'"{file.etag}{"-gz" if packed else ""}"'
    sent = {"ETag": etag, "Cache-Control": "no-cache", "Vary": "Accept-Encoding"}
    if etag in (tag.strip().removeprefix("W/") for tag in headers.get("if-none-match", "").split(",")):
        return Response(status_code=304, headers=sent)
    if not packed:
        return Response(file.content, headers=sent, media_type=file.media_type)
    return Response(file.packed, headers={**sent, "Content-Encoding": "gzip"}, media_type=file.media_type)


def _takes_gzip(accepted: str) -> bool:
    """RFC 9110 §12.5.3; a weight of 0 is a refusal."""
    for part in accepted.lower().split(","):
        name, _, weight = part.strip().partition(";")
        if name.strip() in ("gzip", "*"):
            return weight.strip().replace(" ", "") not in ("q=0", "q=0.0", "q=0.00", "q=0.000")
    return False
