"""Pictures of the dashboard for the documentation:  .venv/bin/python -m tools.screenshots [VIEW...]   (needs Chromium)

Every view, or those named, at the width of a workshop's screen, of a tablet and of a phone, from a daemon with virtual
machines that work. Not a test. The one rule: nothing in a picture is painted; what it shows is what the daemon said in
that moment.
"""

import base64
import math
import struct
import sys
import tempfile
import zlib
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from playwright.sync_api import Browser, expect

from tests.harness.browser import Screen, chromium, screen
from tests.harness.process import Daemon, daemon, until

IMAGES = Path(__file__).resolve().parents[1] / "docs" / "images"
WIDTHS: dict[int, tuple[tuple[int, int], str]] = {
    1920: ((1920, 1080), "light"),
    1024: ((1024, 768), "light"),
    390: ((390, 844), "dark"),
}
MACHINES = """
[[machine]]
name = "router"
port = "sim:"
protocol = "grbl"
motion = {travel = {x = [-200.0, 0.0], y = [-200.0, 0.0], z = [-60.0, 0.0]}}
"""
DRIVER = r"GL Driver Message|GPU stall|status of 4\\d\\d"
SETTLED_MS = 700
SHOWN_AT_LINE = 200
TURNS = 4800
"""Some minutes: it works as long as pictures are taken."""
COLOURS = 256
INDEXED = 3
"""PNG (RFC 2083) colour type."""
PALETTE_OF = """async ([data, most]) => {
    const image = new Image();
    image.src = `data:image/png;base64,${data}`;
    await image.decode();
    const {width, height} = image, canvas = new OffscreenCanvas(width, height), pen = canvas.getContext("2d");
    pen.drawImage(image, 0, 0);
    const pixels = pen.getImageData(0, 0, width, height).data;
    const bucket = (at) => (pixels[at] >> 3 << 10) | (pixels[at + 1] >> 3 << 5) | (pixels[at + 2] >> 3);
    const sums = new Map();
    for (let at = 0; at < pixels.length; at += 4) {
        const key = bucket(at), sum = sums.get(key) ?? [0, 0, 0, 0];
        for (let part = 0; part < 3; part++) sum[part] += pixels[at + part];
        sum[3] += 1;
        sums.set(key, sum);
    }
    const kept = [...sums].sort((one, other) => other[1][3] - one[1][3]).slice(0, most);
    const palette = kept.map(([, sum]) => sum.slice(0, 3).map((part) => Math.round(part / sum[3])));
    const place = new Map(kept.map(([key], index) => [key, index]));
    const far = (one, at) => one.reduce((sum, part, place) => sum + (part - pixels[at + place]) ** 2, 0);
    let rows = "";
    for (let at = 0; at < pixels.length; at += 4) {
        const key = bucket(at);
        if (!place.has(key)) {
            const all = palette.map((one) => far(one, at));
            place.set(key, all.indexOf(Math.min(...all)));
        }
        rows += String.fromCharCode(place.get(key));
    }
    return {width, height, palette, rows: btoa(rows)};
}"""
"""The commonest colours of a picture, and of each pixel which of them; anything else takes the nearest."""


def program() -> str:
    """A pocket that spirals down, a ring of holes, a frame: two tools."""
    lines = ["G21 G90 G17", "T1 M6", "M3 S14000", "G0 Z5", "G0 X60 Y40"]
    for turn in range(TURNS):
        angle, radius = turn / 18, 3 + 22 * (turn % 600) / 600
        depth = 0.5 * (1 + turn // 600)
        feed = f"G1 X{60 + radius * math.cos(angle):.3f} Y{40 + radius * math.sin(angle):.3f} Z-{depth} F1400"
        lines.append(feed)
    lines += ["G0 Z5", "T2 M6", "M3 S9000"]
    for hole in range(12):
        angle = hole * math.tau / 12
        lines += [f"G0 X{60 + 34 * math.cos(angle):.3f} Y{40 + 34 * math.sin(angle):.3f}", "G1 Z-6 F300", "G0 Z5"]
    lines += ["G0 X0 Y0", "G1 Z-4 F400", "G1 X120 F1800", "G1 Y80", "G1 X0", "G1 Y0", "G0 Z5", "M5", "M30"]
    return "\n".join(lines) + "\n"


@dataclass(frozen=True, slots=True)
class Shop:
    """A daemon whose mill has done one job and is at another."""

    daemon: Daemon
    done: int
    running: int
    program: str


def main(only: Collection[str] = (), folder: Path = IMAGES) -> None:
    """Write the pictures anew: all, or those of some views."""
    folder.mkdir(parents=True, exist_ok=True)
    with chromium() as browser, shop() as one:
        if wanted("tool-change", only):
            taken(browser, one, folder, tool_change)
        one.daemon.post("/machines/mill/tool/confirm")
        until(lambda: one.daemon.get(f"/jobs/{one.running}")["progress"]["line"] > SHOWN_AT_LINE)
        taken(browser, one, folder, partial(views, only=only))
    total = sum(file.stat().st_size for file in folder.glob("*.png"))
    print(f"{total / 1024 / 1024:.1f} MiB in all")


def wanted(name: str, only: Collection[str]) -> bool:
    """Whether a view is to be taken."""
    return not only or name in only


def taken(browser: Browser, one: Shop, folder: Path, through: Callable[[Screen, Shop], Iterator[str]]) -> None:
    """Pictures of what `through` shows, at each width."""
    for width, (size, scheme) in WIDTHS.items():
        with screen(browser, one.daemon.url, size, color_scheme=scheme) as person:
            person.allowed.append(DRIVER)
            for name in through(person, one):
                expect(person.page.locator("main .panel:visible").first).to_be_visible()
                person.page.wait_for_timeout(SETTLED_MS)
                file = folder / f"{name}-{width}.png"
                file.write_bytes(small(browser, person.page.screenshot()))
                print(f"{file.name}: {file.stat().st_size / 1024:.0f} KiB", flush=True)


@contextmanager
def shop() -> Iterator[Shop]:
    """With two machines; it waits for the first tool of a long job."""
    with tempfile.TemporaryDirectory() as place, daemon(Path(place), "sim:", elvinto=MACHINES) as one:
        until(lambda: all(machine["link"] == "connected" for machine in one.get("/machines")))
        moves = "".join(f"G1 X{i % 9} Y{i % 4} F3000\n" for i in range(60))
        done = one.job(f"G21 G90\nG28\nM3 S9000\n{moves}M30\n")
        one.status(done, "completed")
        stored = one.http.post("/api/v1/programs?name=flange.nc", content=program()).json()["id"]
        job = {"program": stored, "machine": "mill", "force": True}
        running = one.post("/jobs", job)["id"]
        for note in ("left vice", "right vice"):
            one.post("/jobs", {**job, "hold": True, "note": note})
        one.status(running, "waiting")
        yield Shop(one, done, running, stored)


def tool_change(person: Screen, _: Shop) -> Iterator[str]:
    person.go("mill/machine")
    expect(person.named("call")).to_be_visible()
    yield "tool-change"


def views(person: Screen, one: Shop, only: Collection[str] = ()) -> Iterator[str]:
    """Goes from view to view; each is named when it is there."""
    places = {
        "machine": "mill/machine",
        "programs": "mill/programs",
        "jobs": "mill/jobs",
        "job": f"mill/jobs/{one.done}",
        "console": "mill/console",
        "tools": "mill/tools",
        "settings": "router/settings",
        "offsets": "router/settings/offsets",
        "controller": "router/settings/controller",
        "plots": "mill/plots",
        "program": f"mill/programs/{one.program}",
    }
    for name, place in places.items():
        if not wanted(name, only):
            continue
        person.go(place)
        if name == "settings":
            expect(person.page.locator("#setting-110")).to_be_visible()
        yield name
    if not wanted("path", only):
        return
    person.go(places["program"])
    person.press("preview-toggle")
    expect(person.named("path-view")).to_have_attribute("data-complete", "true")
    person.page.evaluate("document.querySelector('[data-name=preview]').scrollIntoView()")
    person.page.evaluate("scrollBy(0, -90)")
    yield "path"
    person.press("preview-toggle")


def small(browser: Browser, picture: bytes) -> bytes:
    """The same picture with a palette: a third of the bytes, and nobody sees it."""
    context = browser.new_context()
    try:
        found = context.new_page().evaluate(PALETTE_OF, [base64.b64encode(picture).decode(), COLOURS])
    finally:
        context.close()
    return png(found)


def png(found: dict[str, Any]) -> bytes:
    """RFC 2083, indexed."""
    width, height, rows = found["width"], found["height"], base64.b64decode(found["rows"])
    lines = b"".join(b"\0" + rows[at * width : (at + 1) * width] for at in range(height))
    palette = b"".join(bytes(colour) for colour in found["palette"])
    head = struct.pack(">IIBBBBB", width, height, 8, INDEXED, 0, 0, 0)
    parts = ((b"IHDR", head), (b"PLTE", palette), (b"IDAT", zlib.compress(lines, 9)), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body)) for kind, body in parts
    )


if __name__ == "__main__":
    main(sys.argv[1:])
