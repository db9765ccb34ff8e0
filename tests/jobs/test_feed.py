"""The next batch: new ones, and those that were taken back."""

from jobs.effects import Entry
from jobs.feed import Ahead, Feed
from jobs.job import Status
from protocol.errors import LocalError
from tests.harness.fakes import ListSource, batch


def lines(feed: Feed) -> list[int]:
    found = []
    while (ahead := feed.plan()) is not None:
        found.append(ahead.batch.first_line)
        feed.ahead = None
    return found


def test_what_was_taken_back_goes_before_what_is_new() -> None:
    feed = Feed(ListSource([batch(5), batch(7)]))
    assert feed.plan() is not None
    assert feed.shelve() is None, "it had no row yet"
    feed.put_back([batch(1), batch(3)])
    assert lines(feed) == [1, 3, 5, 7]


def test_planning_again_gives_the_same_and_numbers_rise() -> None:
    feed = Feed(ListSource([batch(1), batch(3)]), next_seq=4)
    first = feed.plan()
    assert feed.plan() is first
    assert isinstance(first, Ahead)
    assert first.seq == 4
    feed.ahead = None
    second = feed.plan()
    assert second is not None
    assert second.seq == 5


def test_only_the_row_of_the_present_id_is_durable() -> None:
    feed = Feed(ListSource([batch(1)]))
    ahead = feed.plan()
    assert ahead is not None
    ahead.entry = Entry(1, 1, 1005, ahead.batch)
    feed.journaled(1, 1004)
    feed.journaled(2, 1005)
    assert not ahead.durable
    feed.journaled(1, 1005)
    assert ahead.durable
    assert feed.shelve() == ahead.entry
    feed.journaled(1, 1005)  # the news of a row that was taken back meanwhile


def test_how_it_ends() -> None:
    done, gap, gone = Feed(ListSource([])), Feed(ListSource([LocalError("line 3")])), Feed(ListSource([OSError("io")]))
    for feed in (done, gap, gone):
        assert feed.plan() is None
        assert feed.plan() is None
    assert [feed.end.status for feed in (done, gap, gone) if feed.end] == [
        Status.COMPLETED,
        Status.FAILED,
        Status.FAILED,
    ]


def test_nothing_comes_behind_the_end_of_the_program() -> None:
    feed = Feed(ListSource([batch(1, 1, ends_program=True, barrier=True), batch(2)]))
    assert lines(feed) == [1]


def test_without_a_source_there_is_nothing_and_no_end() -> None:
    feed = Feed()
    feed.relocate({"x": 1.0})
    assert feed.plan() is None
    assert feed.end is None
    source = ListSource([batch(3)])
    feed.supply(source, behind=[batch(1)], position={"x": 0.0})
    assert source.relocated == [{"x": 2.0}]
    assert lines(feed) == [3]
    feed.unreadable("too late to matter")
    assert feed.end is not None
    assert feed.end.status is Status.COMPLETED


def test_a_source_after_nothing_begins_where_the_machine_stands() -> None:
    feed, source = Feed(), ListSource([])
    feed.supply(source, behind=[], position={"x": 4.0})
    assert source.relocated == [{"x": 4.0}]


def test_a_source_that_comes_late_stands_behind_the_batch_ahead() -> None:
    """It is planned and journaled while the one before it executes: it is in no backlog any more, and not open yet."""
    feed, source = Feed(), ListSource([batch(5)])
    feed.put_back([batch(3)])
    assert feed.plan() is not None
    feed.supply(source, behind=[batch(1)], position={"x": 0.0})
    assert source.relocated == [{"x": 4.0}]


def test_while_the_reading_goes_on_there_is_no_end() -> None:
    source = ListSource([])
    source.reading = True
    feed = Feed(source)
    assert feed.plan() is None
    assert feed.reading
    assert feed.end is None
    source.reading = False
    assert feed.plan() is None
    assert not feed.reading
    assert feed.end is not None
