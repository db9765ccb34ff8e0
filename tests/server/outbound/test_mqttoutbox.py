"""What waits for a broker: bounded, the newest of each topic, what is kept in order, and what is dropped counted."""

from hypothesis import given
from hypothesis import strategies as st

from server.outbound.mqttoutbox import Outbox
from server.outbound.mqtttopics import Post
from server.waysout import WayOut


def drained(outbox: Outbox) -> list[str]:
    found = []
    while (post := outbox.take()) is not None:
        found.append(post.payload)
    return found


def test_of_states_the_newest_and_jobs_in_order_before_them() -> None:
    counted = WayOut()
    outbox = Outbox(10, counted)
    for number in range(3):
        outbox.put(Post("state", f"s{number}"))
        outbox.put(Post("job", f"j{number}", kept=True))
    assert counted.waiting == 4
    assert drained(outbox) == ["j0", "j1", "j2", "s2"]
    assert (counted.waiting, counted.dropped) == (0, 0)


def test_at_the_limit_the_oldest_goes_and_is_counted() -> None:
    counted = WayOut()
    outbox = Outbox(2, counted)
    for number in range(5):
        outbox.put(Post("job", f"j{number}", kept=True))
    assert counted.dropped == 3
    assert drained(outbox) == ["j3", "j4"]


def test_progress_that_waits_does_not_come_after_the_end_of_its_job() -> None:
    outbox = Outbox(10, WayOut())
    outbox.put(Post("job", "progress"))
    outbox.put(Post("job", "completed", kept=True))
    assert drained(outbox) == ["completed"]
    outbox.put(Post("job", "running", kept=True))
    outbox.put(Post("job", "progress"))
    assert drained(outbox) == ["running", "progress"]


def test_what_could_not_be_sent_comes_again_unless_there_is_something_newer() -> None:
    counted = WayOut()
    outbox = Outbox(2, counted)
    outbox.put(Post("job", "a", kept=True))
    outbox.put(Post("job", "b", kept=True))
    first = outbox.take()
    assert first is not None
    outbox.give_back(first)
    assert drained(outbox) == ["a", "b"]
    outbox.put(Post("state", "new"))
    outbox.give_back(Post("state", "old"))
    outbox.put(Post("job", "c", kept=True))
    outbox.give_back(Post("job", "progress before c"))
    assert drained(outbox) == ["c", "new"]
    outbox.put(Post("job", "d", kept=True))
    outbox.put(Post("job", "e", kept=True))
    outbox.give_back(first)
    assert counted.dropped == 1, "the oldest of three where two may wait"
    assert drained(outbox) == ["d", "e"]


@given(st.lists(st.tuples(st.sampled_from("abc"), st.booleans(), st.booleans()), max_size=60))
def test_never_more_than_the_limit_and_the_last_of_each_topic_is_there(steps: list[tuple[str, bool, bool]]) -> None:
    counted = WayOut()
    outbox, last, sent = Outbox(3, counted), {}, []
    for number, (topic, kept, taken) in enumerate(steps):
        outbox.put(Post(topic, str(number), kept))
        last[topic] = str(number)
        assert counted.waiting <= 3 + 3
        if taken and (post := outbox.take()) is not None:
            sent.append((post.topic, post.payload))
    while (post := outbox.take()) is not None:
        sent.append((post.topic, post.payload))
    if counted.dropped == 0:
        assert dict(sent) == last
