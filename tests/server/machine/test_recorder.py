"""The console and the dump of frames: bounded, and never wrong about what bytes were there."""

from datetime import UTC, datetime, timedelta

import pytest

from protocol.engine import Frame
from server.machine.recorder import CONSOLE_MESSAGES, DUMPED_FRAMES, MESSAGE_CHARS, Recorder, dump

NOON = datetime(2026, 3, 1, 12, tzinfo=UTC)


def test_the_last_messages_oldest_first() -> None:
    recorder = Recorder(lambda: NOON + timedelta(seconds=4), lambda: 104.0)
    for number in range(5):
        recorder.record([(100.0 + number, "<", f"OK,ID<#{number};")])
    assert [entry["text"] for entry in recorder.console(2)] == ["OK,ID<#3;", "OK,ID<#4;"]
    newest = {"at": "2026-03-01T12:00:04.000Z", "direction": "<", "text": "OK,ID<#4;"}
    assert recorder.console(1) == [newest]
    assert recorder.newest() == newest
    assert recorder.console(5)[0]["at"] == "2026-03-01T12:00:00.000Z"
    assert recorder.console(0) == []
    assert len(recorder.console(99)) == 5


@pytest.mark.parametrize("offset_s", [0.0, 2.0004, 2.9996, 1234.5678])
def test_the_times_of_many_are_those_of_each(offset_s: float) -> None:
    """Over the turn of a second and of a day, a millisecond like any other."""
    now = 5000.25
    recorder = Recorder(lambda: NOON.replace(hour=0) + timedelta(seconds=offset_s), lambda: now)
    singly = []
    for number in range(40):
        recorder.record([(now - 4 + number * 0.1001, ">", str(number))])
        singly.append(recorder.newest())
    for one, entry in zip(singly, recorder.console(40), strict=True):
        apart = datetime.fromisoformat(one["at"]) - datetime.fromisoformat(entry["at"])
        assert abs(apart) <= timedelta(milliseconds=1), "a microsecond of rounding may be on either side"
        assert (one["text"], len(one["at"])) == (entry["text"], len(entry["at"]))


def test_one_by_one_they_are_what_there_was_at_the_first() -> None:
    recorder = Recorder(lambda: NOON, lambda: 0.0)
    recorder.record([(0.0, ">", "a"), (0.0, "<", "b")])
    before, one_by_one = recorder.console(9), recorder.each(9)
    said = [next(one_by_one)]
    recorder.record([(0.0, ">", str(number)) for number in range(CONSOLE_MESSAGES)])
    assert [*said, *one_by_one] == before


def test_it_is_bounded_in_messages_and_in_characters() -> None:
    recorder = Recorder(lambda: NOON, lambda: 0.0)
    for _ in range(CONSOLE_MESSAGES + 10):
        recorder.record([(0.0, ">", "x" * 10_000)])
    console = recorder.console(CONSOLE_MESSAGES * 2)
    assert len(console) == CONSOLE_MESSAGES
    assert {len(entry["text"]) for entry in console} == {MESSAGE_CHARS}


def test_messages_that_came_together_are_counted_and_cut_one_by_one() -> None:
    recorder = Recorder(lambda: NOON, lambda: 0.0)
    texts = [str(number) for number in range(CONSOLE_MESSAGES + 7)]
    for at in range(0, len(texts), 3):
        recorder.record([(0.0, "<", text) for text in texts[at : at + 3]])
    assert [entry["text"] for entry in recorder.console(4)] == texts[-4:]
    assert [entry["text"] for entry in recorder.console(CONSOLE_MESSAGES * 2)] == texts[-CONSOLE_MESSAGES:]


def test_frames_say_how_long_ago_and_show_every_byte() -> None:
    frames = [Frame(10.0, ">", b"READY;"), Frame(10.5, "<", b"\xff\x00OK;")]
    assert dump(frames, now=11.0) == {
        "frames": [
            {"seconds_ago": 1.0, "direction": ">", "text": "READY;"},
            {"seconds_ago": 0.5, "direction": "<", "text": "\\xff\x00OK;"},
        ]
    }
    assert len(dump(frames * DUMPED_FRAMES, now=11.0)["frames"]) == DUMPED_FRAMES
