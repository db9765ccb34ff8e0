"""What is known of batches: how each leaves `open`, and which lines are in doubt."""

import pytest

from jobs.effects import Entry, RowStatus
from jobs.ledger import Flight, Ledger
from tests.harness.fakes import batch

AT = "2026-03-01T09:00:00.000Z"


def ledger_with(*lines: int) -> Ledger:
    ledger = Ledger()
    for seq, line in enumerate(lines, 1):
        ledger.submit(Entry(1, seq, 1000 + seq, batch(line)))
    return ledger


def test_done_moves_the_cursor_and_the_position_and_marks_the_row() -> None:
    ledger = ledger_with(1)
    flight = ledger.open[0]
    ledger.sent(flight, 1, "first")
    ledger.sent(flight, 2, "second")
    ledger.received(flight, "then")
    mark = ledger.done(flight, inferred=False, position=None, at=AT)
    assert (mark.status, mark.attempts, mark.sent_at, mark.received_at, mark.ok_at) == (
        RowStatus.OK,
        2,
        "first",
        "then",
        AT,
    )
    assert (ledger.cursor.done, ledger.position, ledger.open) == (2, {"x": 2.0}, [])


def test_a_position_that_was_asked_for_is_better_than_the_planned_one() -> None:
    ledger = ledger_with(1)
    assert ledger.done(ledger.open[0], inferred=True, position={"x": 9.0}, at=AT).end == {"x": 9.0}


def test_doubt_spans_what_is_open_what_is_doubtful_and_what_was_doubtful_before() -> None:
    ledger = ledger_with(5, 7)
    assert ledger.lines_in_doubt() == (5, 8)
    ledger.doubt([ledger.open[0]], RowStatus.DOUBTFUL)
    assert ledger.lines_in_doubt() == (5, 8)
    ledger.done(ledger.open[0], inferred=False, position=None, at=AT)
    assert ledger.lines_in_doubt() == (5, 6)
    ledger.inherited_doubt = (3, 4)
    assert ledger.lines_in_doubt() == (3, 6)
    assert Ledger().lines_in_doubt() == (None, None)


@pytest.mark.parametrize(
    ("open_lines", "lines", "inherited"),
    [((), (3, 6), (3, 6)), ((5,), (3, 6), (3, 4)), ((5,), (5, 6), None), ((5,), (None, None), None)],
)
def test_only_doubt_about_open_rows_can_be_cleared(
    open_lines: tuple[int, ...], lines: tuple[int | None, int | None], inherited: tuple[int, int] | None
) -> None:
    ledger = ledger_with(*open_lines)
    ledger.inherit_doubt(*lines)
    assert ledger.inherited_doubt == inherited


def test_undo_gives_the_batches_back_in_order() -> None:
    ledger = ledger_with(1, 3)
    marks, batches = ledger.undo()
    assert [mark.status for mark in marks] == [RowStatus.UNDONE, RowStatus.UNDONE]
    assert [undone.first_line for undone in batches] == [1, 3]
    assert (ledger.cursor.sent, ledger.cursor.read, ledger.open) == (0, 4, [])


def test_a_row_is_found_by_its_wire_id() -> None:
    ledger = ledger_with(1, 3)
    assert ledger.flight(1002) is ledger.open[1]
    assert ledger.flight(7) is None
    assert isinstance(ledger.open[0], Flight)


def test_a_batch_that_was_cut_is_done_up_to_there_and_nothing_is_in_doubt() -> None:
    """Two lines of which the first became two frames: one frame is executed, so the line is not."""
    ledger = Ledger()
    three = batch(5, blocks=("X1", "X2", "X3"), lines=(5, 5, 6), parts=(2, 0, 0), last_line=6, end={"x": 6.0})
    ledger.submit(Entry(1, 1, 1001, three))
    mark, rest = ledger.cut(ledger.open[0], 1, {"x": 1.0}, AT)
    assert (mark.status, mark.line_done, mark.end) == (RowStatus.OK, 4, {"x": 1.0})
    assert mark.cut is not None
    assert (mark.cut.blocks, mark.cut.last_line, mark.cut.part) == (("X1",), 5, 2)
    assert (rest.blocks, rest.first_line, rest.lines, rest.start, rest.end) == (
        ("X2", "X3"),
        5,
        (5, 6),
        {"x": 1.0},
        {"x": 6.0},
    )
    assert (ledger.cursor.done, ledger.position, ledger.executed, ledger.open) == (4, {"x": 1.0}, 1001, [])
    assert ledger.lines_in_doubt() == (None, None)


def test_a_line_of_which_a_frame_is_left_is_not_done() -> None:
    ledger = Ledger()
    ledger.submit(Entry(1, 1, 1001, batch(5, blocks=("X1", "X2"), lines=(5, 5), parts=(2, 3), last_line=5)))
    assert ledger.done(ledger.open[0], inferred=False, position=None, at=AT).line_done == 4
    assert ledger.executed == 1002
