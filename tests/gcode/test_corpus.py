"""Programs as people have them: every file is read, every word is understood or reported. Skipped without the files."""

import re
from collections import Counter
from collections.abc import Iterator

import numpy as np
import pytest

from gcode.check import check_program
from gcode.check.words import judge
from gcode.compact import Compactor
from gcode.interpreter import Interpreter
from gcode.lines import split_lines
from gcode.profile import load_profile, profile_names
from gcode.words import decode_line, parse_block, parse_carefully
from tests.gcode.corpus_findings import HEAD, TABLE, begin_of, rows_of
from tests.harness.effort import more
from tests.harness.programs import FITTING_FILES, corpus_files, elvinto

MAX_LINES = more(1_000)
"""Of each file: the shapes repeat, the time of the tests is better spent elsewhere."""


def lines_of(name: str, raw: bytes) -> list[bytes]:
    lines = list(split_lines([raw]))
    assert lines, name
    return lines[:MAX_LINES]


def every_line() -> Iterator[tuple[str, int, bytes]]:
    for path in corpus_files():
        for number, raw in enumerate(lines_of(path.name, path.read_bytes()), 1):
            yield path.name, number, raw


@pytest.mark.slow
def test_every_word_is_understood_or_reported() -> None:
    for name, number, raw in every_line():
        text = decode_line(raw)
        block = parse_block(text)
        assert block == parse_carefully(text), (name, number)
        if block.faults or text.lstrip().startswith(("%", "#", "//")):
            continue
        plain = re.sub(r"\([^)]*\)|;.*|[ \t]", "", text).upper().replace(":", "O")
        assert "".join(word.letter + word.text for word in block.words) == re.sub(r"^/[1-9]?", "", plain), (
            name,
            number,
        )


@pytest.mark.slow
def test_every_file_can_be_checked() -> None:
    known = elvinto()
    for path in corpus_files():
        report = check_program(lines_of(path.name, path.read_bytes()), known)
        assert report.blocks or report.errors, path.name
        if path.name in FITTING_FILES:
            assert not [finding for finding in report.errors if finding.code != "no_end"], path.name
        # What the table does not have is never passed over.
        if path.name == "gsender_invalid_gcode.nc":
            assert {"unknown_word", "bad_number", "unknown_code"} <= {finding.code for finding in report.errors}


@pytest.mark.slow
def test_no_word_of_any_file_is_passed_over_with_any_profile() -> None:
    for path in corpus_files():
        lines = lines_of(path.name, begin_of(path))[:300]
        words = [(word.letter, word.code) for raw in lines for word in parse_block(decode_line(raw)).words]
        for name in profile_names():
            profile = load_profile(name)
            expected: Counter[str] = Counter()
            for letter, code in words:
                if verdict := judge(profile, code if letter in profile.code_letters else letter):
                    expected[verdict[1]] += 1
            report = check_program(lines, profile)
            counted: Counter[str] = Counter()
            for finding in (*report.errors, *report.warnings):
                if finding.code in ("unknown_word", "unknown_code", "ignored", "differs"):
                    counted[finding.code] += finding.count
            assert counted == expected, (path.name, name)


@pytest.mark.slow
def test_what_the_check_says_of_real_files_changes_only_on_purpose() -> None:
    head, *expected = TABLE.read_text(encoding="utf-8").splitlines(keepends=True)
    assert head == HEAD
    found = [row for path in corpus_files() for row in rows_of(path)]
    said = "run `python -m tests.gcode.corpus_findings > tests/gcode/corpus_findings.tsv` and look at the difference"
    assert found == expected, said


@pytest.mark.slow
def test_compaction_keeps_the_motion_of_real_programs() -> None:
    for path in corpus_files():
        compactor = Compactor(elvinto())
        original, shorter = Interpreter(elvinto()), Interpreter(elvinto())
        for number, raw in enumerate(lines_of(path.name, path.read_bytes()), 1):
            block = parse_block(decode_line(raw))
            original.step(number, block)
            shorter.step(number, parse_block(compactor.compact(block)))
        before, after = original.take(), shorter.take()
        for name in ("line", "kind", "start", "end", "feed", "spindle", "dwell_s", "sweep", "centre"):
            message = f"{path.name}: {name}"
            np.testing.assert_allclose(getattr(before, name), getattr(after, name), rtol=0, atol=1e-9, err_msg=message)
