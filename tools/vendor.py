"""Fetches the pinned files of web/vendor/ and tests/web/vendor/ from npm:  python tools/vendor.py   (needs npm)

Not a bundler and no part of the daemon: what it writes is committed, so nobody who uses or builds millstream runs it.
The one rule: a file is taken only when its SHA-256 is the one that stands here; to move to another version, change the
version and the sum, and look at what changed. Bare imports ("preact") become relative ones, because our pages have
neither a build step nor an import map (an inline script, which the Content-Security-Policy forbids).
"""

import hashlib
import json
import re
import subprocess
import tarfile
import tempfile
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
VENDOR = ROOT / "web" / "vendor"
FOR_TESTS = ROOT / "tests" / "web" / "vendor"
"""Never served, in no package; here so that a test needs no internet."""
MANIFEST = "vendor.json"
SOURCE_MAP = re.compile(rb"\n?//# sourceMappingURL=\S+\s*$")
BARE_IMPORT = re.compile(rb"""((?<!["'])\b(?:from|import)\s*)["']([^"'./\n][^"'\n]*)["']""")
"""`"from"` in quotes is a word of a comment."""


@dataclass(frozen=True, slots=True)
class Part:
    """One file of one package. `sha256` is of the file as the registry has it; `imports`: bare names to our files."""

    package: str
    version: str
    file: str
    sha256: str
    name: str
    licence: str
    licence_file: str = "LICENSE"
    imports: tuple[tuple[str, str], ...] = ()
    folder: Path = VENDOR


PARTS = (
    Part(
        "preact",
        "11.2.0",
        "dist/preact.mjs",
        "bdcbd9abdf2c77c5c45326eab42191e949222d479d0d5f69467387a77040cb55",
        "preact.js",
        "MIT",
    ),
    Part(
        "preact",
        "11.2.0",
        "hooks/dist/hooks.mjs",
        "e862ab2973aa6455eaa0f77c5d832d2157d6be59a17c8ba546550a575b58c6b4",
        "hooks.js",
        "MIT",
        imports=(("preact", "preact.js"),),
    ),
    Part(
        "htm",
        "3.1.1",
        "dist/htm.mjs",
        "ab33dd3f38059b9be4d5f5350128eefb2356639c4e0bbe9d9e8b3ba75847e9e4",
        "htm.js",
        "Apache-2.0",
    ),
    Part(
        "@preact/signals-core",
        "1.14.5",
        "dist/signals-core.mjs",
        "0c80bc127d72ecb1496ef116ffddae75079829a3af01e7f417c8e5a6474c68b6",
        "signals-core.js",
        "MIT",
    ),
    Part(
        "@preact/signals",
        "2.11.4",
        "dist/signals.mjs",
        "ba8177597f45acaca4d05dcf3966b527d0a8264cfa2b0a87ace92dff324217f8",
        "signals.js",
        "MIT",
        imports=(
            ("preact", "preact.js"),
            ("preact/hooks", "hooks.js"),
            ("@preact/signals-core", "signals-core.js"),
        ),
    ),
    Part(
        "uplot",
        "1.6.32",
        "dist/uPlot.esm.js",
        "5dd9b3281aa64b461b42d9945f6adb2649d346502b12281a9ae0d46599a80eba",
        "uplot.js",
        "MIT",
    ),
    Part(
        "uplot",
        "1.6.32",
        "dist/uPlot.min.css",
        "df630c6a8d6f8eeaff264b50f73ce5b114f646ffd9a0bb74f049b0a00135fa04",
        "uplot.css",
        "MIT",
    ),
    Part(
        "three",
        "0.187.0",
        "build/three.core.js",
        "613e370f76638fdef83926642bf256dc9615684922de1ce1f63a8583e5d78578",
        "three.core.js",
        "MIT",
    ),
    Part(
        "three",
        "0.187.0",
        "build/three.module.js",
        "104f56145899722094556490d787aae0617cc2fc3382f31df02d724ea1aee341",
        "three.module.js",
        "MIT",
    ),
    Part(
        "axe-core",
        "4.14.1",
        "axe.min.js",
        "29348999450cdf2849a8e70b7912fc2da85a849da39c0d0d5394f51d4a9ed95c",
        "axe.js",
        "MPL-2.0",
        folder=FOR_TESTS,
    ),
)


class VendorError(Exception):
    """Something is not what it was when it was pinned."""


def vendored(part: Part, content: bytes) -> bytes:
    """The file as it is kept: with a notice, with relative imports, without the address of its source map.

    Raises VendorError when the content is not the pinned one, or imports something that is not vendored.
    """
    if (found := sha256(content)) != part.sha256:
        raise VendorError(f"{part.package} {part.version} {part.file} has SHA-256 {found}, pinned is {part.sha256}")
    known = dict(part.imports)

    def relative(match: re.Match[bytes]) -> bytes:
        target = match[2].decode()
        if target not in known:
            raise VendorError(f"{part.package} {part.file} imports {target!r}, which is not vendored")
        return match[1] + f'"./{known[target]}"'.encode()

    body = BARE_IMPORT.sub(relative, SOURCE_MAP.sub(b"", content))
    name = f"{part.package} {part.version}, {part.file}. Licence: {part.licence}, see {licence_name(part)}."
    return f"/* {name} Written by tools/vendor.py: do not edit. */\n".encode() + body.rstrip() + b"\n"


def licence_name(part: Part) -> str:
    """Under which name the licence of a package is kept."""
    return f"{part.package.removeprefix('@').replace('/', '-')}.LICENSE.txt"


def sha256(content: bytes) -> str:
    """In hexadecimal."""
    return hashlib.sha256(content).hexdigest()


def package_files(package: str, version: str, folder: Path) -> dict[str, bytes]:
    """All files of a package of the registry by their path in it."""
    command = ["npm", "pack", f"{package}@{version}", "--silent", "--pack-destination", str(folder)]
    said = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    with tarfile.open(folder / said.strip().splitlines()[-1]) as archive:
        files = [member for member in archive if member.isfile()]
        return {file.name.partition("/")[2]: opened.read() for file in files if (opened := archive.extractfile(file))}


def main() -> None:
    """Write both folders anew."""
    packages: dict[str, dict[str, bytes]] = {}
    manifests: dict[Path, list[dict[str, str]]] = {}
    for part in PARTS:
        if part.package not in packages:
            with tempfile.TemporaryDirectory() as folder:
                packages[part.package] = package_files(part.package, part.version, Path(folder))
        files = packages[part.package]
        content = vendored(part, files[part.file])
        part.folder.mkdir(exist_ok=True)
        (part.folder / part.name).write_bytes(content)
        (part.folder / licence_name(part)).write_bytes(files[part.licence_file])
        manifests.setdefault(part.folder, []).append(
            {
                "name": part.name,
                "package": part.package,
                "version": part.version,
                "file": part.file,
                "licence": part.licence,
                "upstream_sha256": part.sha256,
                "sha256": sha256(content),
            }
        )
    for folder, entries in manifests.items():
        (folder / MANIFEST).write_text(json.dumps(entries, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
