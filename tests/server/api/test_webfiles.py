"""server/api/webfiles.py: what a browser gets of `web/`, packed or not, and what it has already."""

import gzip
import os
import re
from pathlib import Path

import pytest
from starlette.datastructures import Headers

from server.api import webfiles
from server.api.webfiles import WebFile, answer, modules, web_file, web_files
from tests.harness.fakeworkshop import FakeWorkshop
from tests.harness.simloop import run_simulated as run

WEB = Path(__file__).resolve().parents[3] / "web"
SCRIPT = WebFile(1, b"export {}", b"packed", "abc", "text/javascript")
PICTURE = WebFile(1, b"\x89PNG", None, "def", "image/png")


@pytest.mark.parametrize(
    ("accepted", "packed"),
    [
        ("gzip, deflate, br", True),
        ("br;q=1.0, GZIP;q=0.8", True),
        ("*", True),
        ("", False),
        ("identity", False),
        ("gzip;q=0", False),
        ("gzip; q=0.0, br", False),
    ],
)
def test_packed_for_those_who_take_it(accepted: str, packed: bool) -> None:
    sent = answer(SCRIPT, Headers({"accept-encoding": accepted}))
    assert sent.body == (b"packed" if packed else b"export {}")
    assert (sent.headers.get("content-encoding") == "gzip") == packed
    assert sent.headers["vary"] == "Accept-Encoding"
    assert sent.headers["cache-control"] == "no-cache", "kept, and asked for each time whether it is still so"


def test_a_packed_file_has_an_etag_of_its_own() -> None:
    plain, packed = Headers({}), Headers({"accept-encoding": "gzip"})
    etags = {answer(SCRIPT, headers).headers["etag"] for headers in (plain, packed)}
    assert etags == {'"abc"', '"abc-gz"'}


@pytest.mark.parametrize("asked", ['"abc-gz"', 'W/"abc-gz"', '"other", "abc-gz"'])
def test_what_a_browser_has_is_not_sent_again(asked: str) -> None:
    sent = answer(SCRIPT, Headers({"accept-encoding": "gzip", "if-none-match": asked}))
    assert (sent.status_code, sent.body) == (304, b"")
    assert answer(SCRIPT, Headers({"if-none-match": asked})).status_code == 200


def test_a_picture_is_not_packed_again() -> None:
    sent = answer(PICTURE, Headers({"accept-encoding": "gzip"}))
    assert sent.body == PICTURE.content
    assert "content-encoding" not in sent.headers


def test_what_is_packed_is_the_file() -> None:
    for name in ("app.js", "vendor/three.core.js", "i18n/ru.json"):
        file = run(web_file(name))
        assert file is not None
        assert file.packed is not None
        assert gzip.decompress(file.packed) == file.content == (WEB / name).read_bytes()
        assert len(file.packed) < len(file.content) / 2


def test_a_changed_file_is_served_changed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "a.js"
    monkeypatch.setattr(webfiles, "web_files", lambda: {"a.js": file})
    monkeypatch.setattr(webfiles, "_known", {})
    file.write_text("one")
    first = run(web_file("a.js"))
    assert first is run(web_file("a.js")), "read once"
    file.write_text("two")
    assert first is not None
    os.utime(file, ns=(first.version + 1, first.version + 1))
    second = run(web_file("a.js"))
    assert second is not None
    assert second.content == b"two"


def test_the_page_names_every_module_that_it_needs_and_none_that_it_loads_later() -> None:
    async def page() -> str:
        async with FakeWorkshop() as workshop, workshop.client() as client:
            return str((await client.get("/")).text)

    named = re.findall(r'<link rel="modulepreload" href="/web/([^"]+)">', run(page()))
    assert named == modules("app.js")
    assert set(named) >= {"app.js", "estop.js", "vendor/preact.js", "vendor/signals-core.js", "parts/button.js"}
    assert all(name in web_files() for name in named)
    later = {"vendor/uplot.js", "vendor/three.module.js", "preview/worker.js", "preview/scene.js"}
    assert not later & set(named)
