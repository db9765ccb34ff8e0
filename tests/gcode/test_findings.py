"""Findings: bounded in number, and nothing uncounted."""

import json

from gcode.findings import FULL_FINDINGS, MAX_KINDS, MOST_MESSAGE_CHARS, Finding, Findings, Report


def test_the_first_of_a_kind_stand_in_full_and_the_rest_is_counted() -> None:
    findings = Findings()
    for line in range(1, 251):
        findings.add("warning", line, 1, "ignored", "G54 is ignored", subject="G54")
    findings.add("warning", 7, 3, "ignored", "G17 is ignored", subject="G17")
    found = findings.of("warning")
    assert len(found) == FULL_FINDINGS + 1
    assert sum(finding.count for finding in found) == 251
    assert found[-1] == Finding(100, 1, "ignored", "G54 is ignored", 151)
    assert [finding.line for finding in found[:8]] == [1, 2, 3, 4, 5, 6, 7, 7]
    assert findings.of("error") == ()


def test_ever_new_kinds_do_not_grow_for_ever() -> None:
    findings = Findings()
    for number in range(MAX_KINDS * FULL_FINDINGS * 2):
        findings.add("error", 1, 1, "unknown_code", "no", subject=f"G{number}")
    found = findings.of("error")
    assert len(found) == MAX_KINDS + FULL_FINDINGS
    assert sum(finding.count for finding in found) == MAX_KINDS * FULL_FINDINGS * 2


def test_the_report_is_json() -> None:
    finding = Finding(1, 2, "code", "message")
    report = Report((finding,), (), (), {"x": (0.0, 1.0)}, 1.5, 3, 2, 10.0, 5.0, (1,), (100.0,))
    assert not report.ok
    table = json.loads(json.dumps(report.to_json()))
    assert table["errors"] == [{"line": 1, "column": 2, "code": "code", "message": "message", "count": 1}]
    assert table["bounds"] == {"x": [0.0, 1.0]}
    assert (table["tools"], table["feeds"], table["seconds"]) == ([1], [100.0], 1.5)


def test_a_long_message_is_cut() -> None:
    findings = Findings()
    findings.add("error", 1, 1, "group_conflict", "G1 " * 1000 + "contradict each other")
    [found] = findings.of("error")
    assert len(found.message) == MOST_MESSAGE_CHARS
    assert found.message.endswith("…")
