"""How fast programs are read and checked, beside a plain regular expression over the same file, and beside two readers
from the npm registry where they are installed.

The expression finds words and their numbers and does nothing else: no comments, no faults, no state. It is the
yardstick of this computer at this moment, so the ratios can be compared between computers, the lines a second cannot.
"""

import json
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import Any

from bench.programs import arcs, four_axis, raster, relief
from bench.reader import KINDS
from bench.report import Figure, Report
from bench.wire import batches

TITLE = "reading: lines a second of processor time, beside a plain regular expression"
SEED = 13
GOAL_LINES_S = 1_000_000.0
GOAL_MB = 300.0
PEERS = ("gcode-interpreter", "gcode-toolpath")
"""npm packages: words alone, and words with modal state and motion. Found through NODE_PATH or node_modules."""


def _measured(command: list[str]) -> dict[str, Any] | None:
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    return json.loads(ended.stdout) if ended.returncode == 0 else None


def _peer(name: str, path: Path) -> dict[str, Any] | None:
    node = shutil.which("node")
    return _measured([node, "bench/peers.mjs", name, str(path)]) if node else None


def compare(path: Path) -> Iterator[Figure]:
    """One program; processor time, so that neighbours count little."""
    found = {kind: _measured([sys.executable, "-m", "bench.reader", kind, str(path)]) for kind in KINDS}
    found |= {name: _peer(name, path) for name in PEERS}
    yard = found["expression"]
    assert yard is not None
    for kind, took in found.items():
        if took is None:
            continue
        goal = GOAL_LINES_S if kind == "check" else None
        lines_s = took["lines"] / max(took["cpu_s"], 1e-6)
        yield Figure(kind, lines_s, "lines/s", goal=goal, sense="least", digits=0)
        if kind != "expression":
            yield Figure(f"{kind} / expression", yard["cpu_s"] / max(took["cpu_s"], 1e-6), "x as fast", digits=2)
        if kind in ("check", *PEERS):
            yield Figure(f"{kind}, peak of memory", took["peak_mb"], "MiB", goal=GOAL_MB if kind == "check" else None)


def planned(lines: int) -> Iterator[Figure]:
    """Batches for an ElVinto machine, with compaction and the planner's seconds."""
    program = [line.encode() for line in relief(SEED, lines)]
    began_s = time.process_time()
    blocks = sum(len(batch.blocks) for batch in batches(program, compact=True))
    yield Figure("blocks planned into batches", blocks / max(time.process_time() - began_s, 1e-6), "blocks/s", digits=0)


def run(*, lines: int = 1_000_000, planned_lines: int = 30_000, programs: int = 5) -> Report:
    """Every kind of program, or the first few."""
    kinds = {
        "relief, modal": relief(SEED, lines, wordy=False),
        "relief, every word in every line": relief(SEED, lines),
        "arcs": arcs(SEED, lines),
        "four axes": four_axis(SEED, lines),
        "laser raster": raster(SEED, lines),
    }
    groups: list[tuple[str, list[Figure]]] = []
    with tempfile.TemporaryDirectory(prefix="millstream-bench-") as folder:
        for name, program in islice(kinds.items(), programs):
            path = Path(folder) / "program.nc"
            with path.open("w", encoding="ascii") as file:
                file.writelines(f"{line}\n" for line in program)
            groups.append((f"{name}, {lines:,} lines", list(compare(path))))
    groups.append((f"batches of a relief, {planned_lines:,} lines", list(planned(planned_lines))))
    return Report.of(TITLE, groups)
