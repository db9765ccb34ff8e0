"""Every benchmark in a tiny setting: it runs to its end and measures what it says. No figure of a clock is compared."""

import subprocess
import sys
from pathlib import Path

import pytest

from bench import frames, instant, load, memory, reading, streaming, toolpath, wire
from bench.__main__ import NAMES, main
from bench.programs import as_bytes, raster, relief
from bench.reader import KINDS

ROOT = Path(__file__).resolve().parents[2]


def test_streaming_in_simulated_time_accounts_for_all_dead_time() -> None:
    found = streaming.simulated(as_bytes(relief(1, 200)))
    assert found.blocks > 190
    parts_s = found.unhidden_s + found.answer_wait_s + found.turnaround_s + found.command_wait_s
    assert parts_s == pytest.approx(found.dead_s, abs=1e-6)
    assert found.unhidden_s < found.dead_s


def test_streaming_keeps_to_the_bound_of_the_protocol() -> None:
    # Simulated time: nothing of this depends on the computer.
    report = streaming.run(relief_lines=700, real_lines=0, features=2)
    for heading, _ in report.groups:
        assert report.value(heading, "dead / bound") <= streaming.GOAL


@pytest.mark.real
def test_streaming_in_real_time() -> None:
    found = streaming.real(relief(1, 40))
    assert found.blocks > 30
    assert found.turnaround_s > 0
    assert found.total_s > found.executing_s > 0


def test_compact_saves_bytes_on_a_wordy_program_and_never_costs_any() -> None:
    report = wire.run(relief_lines=300, features=4, corpus=Path("nowhere"))
    assert report.value("fine relief, every word in every line", "bytes with / without") < 0.6
    for heading, _ in report.groups:
        assert report.value(heading, "bytes with / without") <= 1.0


def test_both_writings_of_a_relief_cost_the_same_on_the_wire_when_compact() -> None:
    lines = [[line.encode() for line in relief(2, 300, wordy=wordy)] for wordy in (True, False)]
    wordy, modal = (wire.wire_bytes(program, compact=True) for program in lines)
    assert wordy[0] == pytest.approx(modal[0], rel=0.02)


def test_frames_are_a_third_of_the_text_and_every_program_translates() -> None:
    report = frames.run(lines=300)
    assert len(report.groups) == 3
    for heading, _ in report.groups:
        assert report.value(heading, "frames / text") < 0.45
        assert 0.5 < report.value(heading, "frames / text with compact") < 0.75
        assert 0.9 < report.value(heading, "frames a line") < 1.2


@pytest.mark.real
def test_reading() -> None:
    report = reading.run(lines=300, planned_lines=300, programs=2)
    assert len(report.groups) == 3
    for heading, figures in report.groups[:-1]:
        for name in KINDS:
            assert report.value(heading, name) > 0
        assert 1 < report.value(heading, "check, peak of memory") < 1000
        assert len(figures) >= 8


def test_toolpath() -> None:
    report = toolpath.run(relief_lines=300, features=6, other_lines=300)
    assert len(report.groups) == 5
    for heading, _ in report.groups:
        segments = report.value(heading, "segments")
        assert segments > 100
        assert report.value(heading, "all levels, for a segment") > 0
        # So small a program is mostly head, but what a level takes does not depend on the computer.
        assert report.value(heading, "level 0, 0 mm") * toolpath.MILLION / segments < toolpath.GOAL_BYTES
    assert report.value("fine relief", "of them arcs") == 0
    assert report.value("ordinary part", "of them arcs") > 10


@pytest.mark.parametrize("kind", KINDS)
def test_every_reader_reads_the_whole_file(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "program.nc"
    path.write_text("".join(f"{line}\n" for line in raster(2, 300)), encoding="ascii")
    assert KINDS[kind](path) == 300


@pytest.mark.real
def test_instant() -> None:
    work = instant.work(relief(1, 2000), 2000)
    assert work.blocks > 1000
    assert 30 < work.batches < work.blocks
    assert work.wall_s > 0


@pytest.mark.real
def test_memory() -> None:
    report = memory.run(lines=500, batches=100)
    (heading, _) = report.groups[0]
    assert 10 < report.value(heading, "idle") <= report.value(heading, "highest of all")


def test_an_unknown_name_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["nonsense"]) == 2
    refusal = capsys.readouterr().err
    assert all(name in refusal for name in NAMES)


@pytest.mark.parametrize("arguments", [["load", "--only", "nonsense"], ["wire", "--only", "pause"], ["load", "--only"]])
def test_an_unknown_part_is_refused(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(arguments) == 2
    assert f"{arguments[0]} has no part" in capsys.readouterr().err


@pytest.mark.parametrize("arguments", [["load"], ["load", "--only", "pause"], ["--only", "pause", "load"]])
def test_a_part_is_handed_on_and_what_it_says_is_printed(
    arguments: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(load, "run", lambda only, *, say: say(f"parts: {only}"))
    assert main(arguments) == 0
    said = capsys.readouterr().out
    assert f"parts: {['pause'] if len(arguments) > 1 else []}" in said


@pytest.mark.real
def test_the_module_can_be_run() -> None:
    done = subprocess.run([sys.executable, "-m", "bench", "nonsense"], cwd=ROOT, capture_output=True, check=False)
    assert done.returncode == 2
