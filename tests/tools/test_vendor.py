"""web/vendor/ and tests/web/vendor/ are exactly what tools/vendor.py pins. Nothing is fetched here."""

import json
import re
from dataclasses import replace
from pathlib import Path

import pytest

from tools.vendor import FOR_TESTS, MANIFEST, PARTS, VENDOR, Part, VendorError, licence_name, sha256, vendored

KEPT = {entry["name"]: entry for folder in (VENDOR, FOR_TESTS) for entry in json.loads((folder / MANIFEST).read_text())}
SERVED = [part for part in PARTS if part.folder == VENDOR]
HERE = Part("p", "1.0", "a.js", "", "p.js", "MIT", imports=(("q", "q.js"), ("q/r", "r.js")))


def pinned(content: bytes) -> Part:
    return replace(HERE, sha256=sha256(content))


@pytest.mark.parametrize("part", PARTS, ids=lambda part: part.name)
def test_a_kept_file_is_the_pinned_one(part: Part) -> None:
    entry, content = KEPT[part.name], (part.folder / part.name).read_bytes()
    assert (entry["package"], entry["version"], entry["upstream_sha256"]) == (part.package, part.version, part.sha256)
    assert entry["sha256"] == sha256(content), f"{part.name} was changed by hand: run tools/vendor.py"
    assert part.version in content.decode().splitlines()[0]
    assert (part.folder / licence_name(part)).stat().st_size > 500


@pytest.mark.parametrize("folder", [VENDOR, FOR_TESTS], ids=["served", "for-tests"])
def test_nothing_else_lies_there(folder: Path) -> None:
    parts = [part for part in PARTS if part.folder == folder]
    written = {MANIFEST} | {part.name for part in parts} | {licence_name(part) for part in parts}
    declarations = {f"{part.name.removesuffix('.js')}.d.ts" for part in parts}  # ours, for the type check
    assert {path.name for path in folder.iterdir()} - declarations == written


def test_every_part_is_kept() -> None:
    assert set(KEPT) == {part.name for part in PARTS}


@pytest.mark.parametrize("part", SERVED, ids=lambda part: part.name)
def test_a_browser_can_load_it_without_the_internet_and_without_an_import_map(part: Part) -> None:
    text = (VENDOR / part.name).read_text()
    for target in re.findall(r"""(?<!["'])\b(?:from\s*|import\s*\(?)["']([^"'\n]+)["']""", text):
        assert target.startswith("./"), target
        assert (VENDOR / target).is_file()
    assert "sourceMappingURL" not in text
    assert not re.search(r"\beval\(|new Function|\.innerHTML\s*\+?=\s*[^=!]+<script", text), "the policy forbids it"


def test_imports_become_relative_and_the_map_goes() -> None:
    content = b"""import{a}from"q";import b from 'q/r';import "./own.js"\n//# sourceMappingURL=a.js.map\n"""
    body = vendored(pinned(content), content).partition(b"\n")[2]
    assert body == b"""import{a}from"./q.js";import b from "./r.js";import "./own.js"\n"""


def test_a_word_of_a_comment_is_no_import() -> None:
    content = b"""// is a "from" band edge\nimport{a}from"q";\n// said so "twice"\n"""
    assert vendored(pinned(content), content).partition(b"\n")[2] == content.replace(b'"q"', b'"./q.js"')


def test_another_content_is_refused() -> None:
    content = b"export const a = 1"
    with pytest.raises(VendorError, match="pinned"):
        vendored(pinned(content), content + b";")


def test_an_import_that_is_not_vendored_is_refused() -> None:
    content = b'import x from "left-pad"'
    with pytest.raises(VendorError, match="left-pad"):
        vendored(pinned(content), content)
