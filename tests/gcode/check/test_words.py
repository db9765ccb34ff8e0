"""Words as such: what a controller does not have, ignores, makes something else of; blocks too long; calls."""

import pytest

from gcode.check.words import judge
from gcode.profile import load_profile, profile_names
from tests.harness.checks import checked, every, found, level_of

HEAD = "G21 G90|M3 S1000|"


def test_every_code_of_every_profile_has_the_verdict_of_its_status() -> None:
    expected = {"exists": None, "ignored": "ignored", "differs": "differs", "missing": "unknown_code"}
    for name in profile_names():
        profile = load_profile(name)
        for code in profile.codes.values():
            verdict = judge(profile, code.name)
            assert (verdict and verdict[1]) == expected[code.status], (name, code.name)
        assert {letter: judge(profile, letter) for letter in profile.letters} == dict.fromkeys(profile.letters)


def test_a_verdict_names_the_controller_and_says_what_it_does_instead() -> None:
    level, code, message = judge(load_profile("elvinto"), "M8") or ("", "", "")
    assert (level, code) == ("warning", "differs")
    assert "ElVinto" in message
    assert "plasma" in message
    assert judge(load_profile("elvinto"), "G" + "9" * 50) == (
        "error",
        "unknown_code",
        "G" + "9" * 23 + "... does not exist on ElVinto v11",
    )


@pytest.mark.parametrize(
    ("word", "code"),
    [
        ("G123", "unknown_code"),
        ("G-1", "unknown_code"),
        ("G1.55", "unknown_code"),
        ("G0.005", "unknown_code"),
        ("G999999", "unknown_code"),
        ("M55", "unknown_code"),
        ("E5", "unknown_word"),
        ("M3.01", "unknown_code"),
    ],
)
def test_codes_of_any_number_are_found_in_their_place(word: str, code: str) -> None:
    report = checked(HEAD + f"  {word}|G0 X1 {word}|M30")
    assert [(finding.line, finding.column) for finding in found(report, code)] == [(3, 3), (4, 7)]


def test_codes_are_known_however_they_are_written() -> None:
    report = checked("G21 G90|G00 X1|G01. X2 F100|g1.00 x3|G001 X4|M030")
    assert found(report, "unknown_code") == []


def test_a_word_that_stands_twice_has_both_columns() -> None:
    report = checked(HEAD + "E5 E6|E7|M30")
    assert [(finding.line, finding.column) for finding in found(report, "unknown_word")] == [(3, 1), (3, 4), (4, 1)]


def test_the_first_hundred_stand_in_full_and_all_are_counted() -> None:
    report = checked(HEAD + "E1|" * 250 + "M30")
    findings = found(report, "unknown_word")
    assert len(findings) == 100
    assert sum(finding.count for finding in findings) == 250
    assert findings[-1].line == 102


def test_what_cannot_be_read_keeps_its_fault() -> None:
    report = checked(HEAD + "$H|G1 X!|G1 X1 )|(open|G1 X[1+2]|G1 Xф|M30")
    assert [(finding.line, finding.code) for finding in report.errors if finding.code != "feed_missing"][:5] == [
        (3, "system_command"),
        (4, "no_number"),
        (4, "realtime_character"),
        (5, "stray_bracket"),
        (6, "unclosed_comment"),
    ]
    assert {"expression", "not_ascii"} <= {finding.code for finding in every(report)}


def test_the_length_of_a_block_is_that_of_what_goes_out() -> None:
    block = "N10 G1 X1 Y2 F100 (a comment)"
    assert found(checked(HEAD + block + "|M30", max_block_bytes=10), "block_too_long") == []
    report = checked(HEAD + block + "|M30", max_block_bytes=9)
    (finding,) = found(report, "block_too_long")
    assert (finding.line, finding.message) == (3, "the block has 10 bytes without comments, the machine takes 9")


@pytest.mark.parametrize(("words", "columns"), [("G0 X1 F-5", [7]), ("T256", [1]), ("T255 F0 S0", []), ("N-5", [])])
def test_numbers_that_the_controller_refuses(words: str, columns: list[int]) -> None:
    report = checked(HEAD + words + "|M30")
    assert [finding.column for finding in found(report, "out_of_range")] == columns
    assert level_of(report, "out_of_range") == ("error" if columns else None)


def test_calls_need_a_target() -> None:
    program = HEAD + "M98 P1000|M98|M98 P2000|M98 P32000|M30|O2000|G0 X1|M99"
    report = checked(program)
    assert [finding.line for finding in found(report, "call_without_target")] == [3, 4]
    assert level_of(report, "call_without_target") == "warning"
