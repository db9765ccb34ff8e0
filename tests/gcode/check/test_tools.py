"""Tools that are not in the tool table: each T and M61 is a warning at its place, and without a table nothing is."""

from tests.harness.checks import checked, found

TOOLS = frozenset({0, 1, 5})


def test_each_t_that_the_table_does_not_have_is_told_at_its_place() -> None:
    report = checked("G21 G90|T1 M6|  T2 M6|T5|M6|T0|T99|M30", tools=TOOLS)
    told = found(report, "tool_not_in_table")
    assert [(finding.line, finding.column) for finding in told] == [(3, 3), (7, 1)]
    assert told[0].message == "T2 is not in the tool table: its tool change would end the job"
    assert told == [finding for finding in report.warnings if finding.code == "tool_not_in_table"]


def test_m61_says_a_tool_too() -> None:
    report = checked("G21 G90|M61 Q5|M61 Q7|M30", "rs274ngc", tools=TOOLS)
    assert [(finding.line, finding.column) for finding in found(report, "tool_not_in_table")] == [(3, 5)]


def test_an_empty_table_has_no_tool() -> None:
    assert len(found(checked("G21 G90|T1 M6|M30", tools=frozenset()), "tool_not_in_table")) == 1


def test_without_a_table_every_number_is_a_tool() -> None:
    for tools in ({}, {"tools": None}):
        assert found(checked("G21 G90|T77 M6|M30", **tools), "tool_not_in_table") == []


def test_many_are_counted_and_not_all_told() -> None:
    told = found(checked("G21 G90|" + "T2|" * 500 + "M30", tools=TOOLS), "tool_not_in_table")
    assert (len(told), sum(finding.count for finding in told)) == (100, 500)
