"""Bytes on the wire, with `compact` against without. No machine: the batches of a program, written as messages.

What is counted is what a batch costs in both directions: header, data, RECEIVED, OK (elvinto §7).
"""

import re
from collections.abc import Iterable, Iterator
from pathlib import Path

from bench.programs import part, relief
from bench.report import Figure, Report
from gcode.lines import split_lines
from gcode.motion import Motion
from gcode.profile import load_profile
from jobs.batch import BatchLimits, BatchPlanner, PlannedBatch
from protocol.commands import SendBatch
from protocol.elvinto.dialect import Dialect
from protocol.elvinto.engine import ElvintoEngine
from sim.elvinto.machine import VirtualElvinto
from sim.elvinto.settings import SimSettings

TITLE = "wire: bytes with compact against without"
SEED = 12
CORPUS = Path(__file__).resolve().parents[2] / "shared" / "corpus"
CORPUS_FILES = ("gsender_mb31.nc", "ugs_gates_combined.nc", "fluidnc_raster_tree.nc", "camotics_compass.ngc")
CORPUS_LINES = 4000
"""Of each file: the longest has a hundred thousand."""
_ACKNOWLEDGED = re.compile(rb"(?:CRC16,[^;]*;)?(?:RECEIVED|OK),[^;]*;")


def batches(lines: Iterable[bytes], *, compact: bool) -> Iterator[PlannedBatch]:
    """The batches of a program on a machine with the default limits."""
    planner = BatchPlanner(
        enumerate(lines, 1), load_profile("elvinto"), Motion(), BatchLimits(), compact=compact, position={}
    )
    while (batch := planner.next()) is not None:
        yield batch


def wire_bytes(lines: Iterable[bytes], *, compact: bool) -> tuple[int, int]:
    """(bytes both ways, batches), from the real engine and the virtual machine joined by a variable."""
    planned = batches(lines, compact=compact)
    engine = ElvintoEngine(Dialect(report_moves=False), first_id=1000, baud=115200, now=0.0)
    machine = VirtualElvinto(SimSettings(instant=True, executed_limit=100))
    total = count = 0
    now = 0.0
    while True:
        now += 0.01
        down = engine.data_to_send(now)
        machine.receive_data(down, now)
        up = machine.data_to_send(now)
        engine.receive_data(up, now)
        if b"GCODE,DATA<" in down and b"<#W9" not in down:
            total += len(down) + sum(map(len, _ACKNOWLEDGED.findall(up)))
        while engine.next_event() is not None:
            pass
        if (due_at := engine.next_timer()) is not None and due_at <= now:
            engine.handle_timer(now)
        if engine.free():
            batch = next(planned, None)
            if batch is None:
                return total, count
            engine.submit(
                SendBatch(engine.next_id, batch.blocks, batch.seconds, batch.end, ends_program=batch.ends_program), now
            )
            count += 1


def compare(lines: list[bytes]) -> Iterator[Figure]:
    """One program both ways."""
    plain, plain_batches = wire_bytes(lines, compact=False)
    compact, compact_batches = wire_bytes(lines, compact=True)
    blocks = sum(len(batch.blocks) for batch in batches(lines, compact=True))
    yield Figure("bytes a block, without", plain / blocks, digits=1)
    yield Figure("bytes a block, with compact", compact / blocks, digits=1)
    yield Figure("bytes with / without", compact / plain, "x")
    yield Figure("batches with / without", compact_batches / plain_batches, "x")


def run(*, relief_lines: int = 4000, features: int = 30, corpus: Path = CORPUS) -> Report:
    """Generated programs, and files of the corpus where it is there."""
    programs = {
        "fine relief, every word in every line": _raw(relief(SEED, relief_lines)),
        "fine relief, modal": _raw(relief(SEED, relief_lines, wordy=False)),
        "ordinary part": _raw(part(SEED, features)),
    }
    groups = [(name, list(compare(lines))) for name, lines in programs.items()]
    for path in (corpus / name for name in CORPUS_FILES):
        if path.is_file():
            lines = list(split_lines([path.read_bytes()]))[:CORPUS_LINES]
            groups.append((path.name, list(compare(lines))))
    return Report.of(TITLE, groups)


def _raw(lines: Iterator[str]) -> list[bytes]:
    return [line.encode() for line in lines]
