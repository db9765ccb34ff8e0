import re
import tomllib
from datetime import timedelta
from pathlib import Path

import pytest

from server.access.audit import MAX_PENDING
from server.access.ratelimit import BURST
from server.api.webfiles import web_files
from server.clock import utc_now
from tests.harness.fakeworkshop import FakeWorkshop
from tests.harness.simloop import run_simulated as run

ROOT = Path(__file__).resolve().parents[3]
WEB = ROOT / "web"
PAGES = sorted(WEB.glob("*.html"))
SCRIPTS = sorted(path for path in WEB.rglob("*.js") if path.parent.name != "vendor")
MARKUP = (
    "innerHTML", "outerHTML", "insertAdjacentHTML", "document.write", "eval(", "new Function", ".style.", "dangerously",
)  # fmt: skip


def get(path: str, **headers: str) -> tuple[int, str, bytes, str | None]:
    async def main() -> tuple[int, str, bytes, str | None]:
        async with FakeWorkshop() as workshop, workshop.client(**headers) as client:
            answer = await client.get(path)
            kind = answer.headers.get("content-type", "")
            return answer.status_code, kind, answer.content, answer.headers.get("etag")

    return run(main())


def test_alive() -> None:
    status, kind, body, _ = get("/healthz")
    version = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    assert (status, kind, body.decode()) == (200, "application/json", f'{{"status":"ok","version":"{version}"}}')


def test_metrics_are_prometheus_text() -> None:
    status, kind, body, _ = get("/metrics")
    assert (status, kind) == (200, "text/plain; version=0.0.4; charset=utf-8")
    assert b'millstream_jobs{status="completed"} 4.0' in body
    assert b'millstream_connected{machine="router"} 1.0' in body


def test_what_the_doors_refuse_is_counted() -> None:
    async def main() -> str:
        async with FakeWorkshop() as workshop, workshop.client() as client:
            good = await workshop.token("admin")
            over = (await workshop.tokens.create("over", "viewer", "1m"))["token"]
            workshop.tokens._clock = lambda: utc_now() + timedelta(hours=1)
            for secret in [good, over, *(f"mill_wrong{number}" for number in range(BURST + 2))]:
                await client.get("/api/v1/machines", headers={"Authorization": f"Bearer {secret}"})
            workshop.audit._pending.update(range(-MAX_PENDING, 0))
            signed = {"Authorization": f"Bearer {good}"}
            await client.post("/api/v1/machines/router/pause", headers=signed)
            return (await client.get("/metrics", headers=signed)).text

    text = run(main())
    assert 'millstream_tokens_refused_total{code="unauthorized"} 10.0' in text
    assert 'millstream_tokens_refused_total{code="too_many_attempts"} 2.0' in text
    assert 'millstream_tokens_refused_total{code="token_expired"} 1.0' in text
    assert 'millstream_websocket_clients_refused_total{limit="sockets"} 0.0' in text
    assert "millstream_audit_rows_lost_total 1.0" in text


@pytest.mark.parametrize(
    ("path", "file", "kind"),
    [
        ("/docs", "docs.html", "text/html; charset=utf-8"),
        ("/web/app.js", "app.js", "text/javascript; charset=utf-8"),
        ("/web/docs.js", "docs.js", "text/javascript; charset=utf-8"),
        ("/web/style.css", "style.css", "text/css; charset=utf-8"),
        ("/web/icon.svg", "icon.svg", "image/svg+xml"),
        ("/web/vendor/preact.js", "vendor/preact.js", "text/javascript; charset=utf-8"),
        ("/web/i18n/zh.json", "i18n/zh.json", "application/json"),
    ],
)
def test_pages(path: str, file: str, kind: str) -> None:
    status, got, body, etag = get(path)
    assert (status, got, body) == (200, kind, (WEB / file).read_bytes())
    assert etag is not None
    assert get(path, **{"If-None-Match": etag})[0] == 304


@pytest.mark.parametrize(
    "path",
    [
        "types.d.ts",
        "vendor/preact.d.ts",
        "../pyproject.toml",
        "..%2fpyproject.toml",
        "%2e%2e/README.md",
        "nothing.js",
        "/etc/passwd",
    ],
)
def test_nothing_but_the_pages_is_served(path: str) -> None:
    assert get(f"/web/{path}")[0] == 404


def test_the_wheel_carries_the_pages() -> None:
    """An editable install has no such files and finds them in the repository instead."""
    wheel = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["hatch"]["build"]["targets"]["wheel"]
    assert wheel["force-include"] == {"web": "server/web"}
    assert set(web_files()) >= {"index.html", "app.js", "style.css", "docs.html", "docs.js", "icon.svg"}


@pytest.mark.parametrize("page", PAGES, ids=[page.name for page in PAGES])
def test_pages_obey_their_own_security_policy(page: Path) -> None:
    text = page.read_text()
    assert not re.search(r"<style|style=|\son[a-z]+=|javascript:", text), "nothing inline"
    assert all('src="' in tag for tag in re.findall(r"<script[^>]*>", text))
    for address in re.findall(r'(?:src|href)="([^"]+)"', text):
        assert address.startswith("/"), f"{address} is not ours"
        assert get(address)[0] == 200, address


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda script: script.relative_to(WEB).as_posix())
def test_scripts_put_nothing_into_a_page_as_markup(script: Path) -> None:
    text = script.read_text()
    for trap in MARKUP:
        assert trap not in text
    assert not re.search(r"https?://", text), "works without the internet"


def test_the_estop_is_in_the_page_itself_and_needs_no_library() -> None:
    page, wanted, asked = (WEB / "index.html").read_text(), {"estop.js"}, set()
    assert '<script type="module" src="/web/estop.js">' in page
    while wanted:
        asked.add(name := wanted.pop())
        text = (WEB / name).read_text()
        assert not name.startswith("vendor/")
        if name == "estop.js":
            assert set(re.findall(r'getElementById\("([^"]+)"\)', text)) <= set(re.findall(r'id="([^"]+)"', page))
        targets = ((WEB / name).parent / target for target in re.findall(r'\bfrom "(\.[^"]+)"', text))
        wanted |= {target.resolve().relative_to(WEB).as_posix() for target in targets} - asked
    assert asked == {"estop.js", "net/client.js", "net/daemon.js", "net/http.js", "net/socket.js"}
