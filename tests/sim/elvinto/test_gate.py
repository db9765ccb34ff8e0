"""The gate alone: what passes, what is refused, and that refusals keep their order."""

from sim.elvinto.gate import Gate, Passed, Refused
from sim.elvinto.settings import SimSettings
from tests.harness.elvinto_peer import frame


def test_verdicts_come_in_order() -> None:
    gate = Gate(SimSettings(max_message_bytes=100))
    stream = frame("A;", 1) + b"B;" + frame("C;", 2)[:-2] + b"D;" + b"x" * 200 + b";" + b",;" + frame("E;")
    verdicts = list(gate.feed(stream))
    assert [verdict.message.name for verdict in verdicts if isinstance(verdict, Passed)] == ["A", "E"]
    refused = [verdict.reason for verdict in verdicts if isinstance(verdict, Refused)]
    assert refused == ["no_header", "checksum", "overlong", "malformed"]


def test_the_smaller_bound_counts() -> None:
    for settings in (SimSettings(receive_buffer_bytes=100), SimSettings(max_message_bytes=100)):
        (verdict,) = Gate(settings).feed(b"x" * 101 + b";")
        assert verdict == Refused("overlong", b"")


def test_clear_forgets_the_header_and_the_half_message() -> None:
    gate = Gate(SimSettings())
    header = frame("A;", 1)[:-2]
    assert list(gate.feed(header + b"half")) == []
    gate.clear()
    assert [verdict.raw for verdict in gate.feed(b"A;")] == [b"A;"]
