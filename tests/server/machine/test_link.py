"""The pump: what goes in, out and around for one engine."""

import asyncio
from collections.abc import Callable
from typing import Any

import pytest

from protocol.commands import EmergencyStop, ListFiles
from protocol.events import Event, LinkReady, MessageSeen, ProgramEnded
from server.machine.link import Link
from tests.harness.fakes import ScriptedEngine
from tests.harness.simloop import run_simulated


class Bench:
    def __init__(self) -> None:
        self.engine = ScriptedEngine()
        self.written: list[bytes] = []
        self.events: list[Event] = []
        self.follows = True
        self.on_event: Callable[[Event], None] = lambda _event: None
        self.offers: list[Callable[[], None]] = []
        self.link = Link(
            self.engine,  # type: ignore[arg-type]
            self.written.append,
            self._event,
            self._quiet,
            asyncio.get_running_loop(),
        )

    def _event(self, event: Event) -> bool:
        self.events.append(event)
        self.on_event(event)
        return self.follows

    def _quiet(self) -> bool:
        if not self.offers:
            return False
        self.offers.pop()()
        return True


def test_bytes_in_events_out_and_bytes_out() -> None:
    async def main() -> None:
        bench = Bench()
        bench.engine.events.append(LinkReady())
        bench.engine.outgoing += b"INIT;"
        bench.link.receive(b"READY;")
        assert bench.engine.heard == [b"READY;"]
        assert bench.events == [LinkReady()]
        assert bench.written == [b"INIT;"]

    run_simulated(main())


def test_what_is_submitted_when_all_is_quiet_goes_out_and_it_is_asked_again() -> None:
    async def main() -> None:
        bench = Bench()
        bench.offers.append(lambda: bench.engine.submit(ListFiles(1), 0.0))
        bench.link.pump()
        assert bench.written == [b"command;"]
        assert bench.offers == []

    run_simulated(main())


def test_a_call_from_inside_an_event_is_taken_up_outside() -> None:
    async def main() -> None:
        bench = Bench()
        bench.engine.events.extend([LinkReady(), ProgramEnded()])
        depth: list[int] = []

        def nested(_event: Event) -> None:
            depth.append(len(bench.events))
            bench.link.pump()
            assert len(bench.events) == depth[-1], "events come one after the other"

        bench.on_event = nested
        bench.link.pump()
        assert depth == [1, 2]

    run_simulated(main())


def test_the_realtime_lane_is_written_before_the_call_returns_even_from_inside_an_event() -> None:
    async def main() -> None:
        bench = Bench()
        bench.engine.events.append(LinkReady())
        seen: list[list[bytes]] = []

        def stop(_event: Event) -> None:
            bench.link.realtime(EmergencyStop(1))
            seen.append(list(bench.written))

        bench.on_event = stop
        bench.link.pump()
        assert seen == [[b"urgent;"]]

    run_simulated(main())


def test_one_timer_is_armed_anew_and_rings_once() -> None:
    async def main() -> None:
        bench = Bench()
        for due_at in (1.0, 5.0, 3.0):
            bench.engine.due_at = due_at
            bench.link.pump()
        await asyncio.sleep(10.0)
        assert bench.engine.ticks == pytest.approx([3.0])

    run_simulated(main())


def test_a_timer_that_rings_half_a_millisecond_too_early_is_not_asked_to_ring_again() -> None:
    async def main() -> None:
        bench = Bench()
        bench.engine.due_at = 1.0
        bench.link.pump()
        bench.engine.due_at = 1.0004  # as a loop rings that counts in milliseconds
        await asyncio.sleep(2.0)
        assert bench.engine.ticks == [1.0004], "and the engine hears of its deadline"

    run_simulated(main())


def test_behind_a_timer_nobody_is_asked_where_the_engine_has_no_news() -> None:
    async def main() -> None:
        bench = Bench()
        bench.engine.due_at = 1.0
        bench.link.pump()
        bench.engine.news = False
        bench.engine.outgoing += b"?"
        bench.offers.append(lambda: pytest.fail("nobody is asked"))
        await asyncio.sleep(2.0)
        assert (bench.written, len(bench.engine.ticks)) == ([b"?"], 1)

    run_simulated(main())


def test_a_timer_that_rings_before_anything_is_due_does_not_call_the_engine() -> None:
    async def main() -> None:
        bench = Bench()
        bench.engine.due_at = 1.0
        bench.link.pump()
        bench.engine.due_at = 4.0  # put off: the timer stays where it is
        bench.link.pump()
        bench.offers.append(lambda: pytest.fail("nothing has happened that could have made the engine free"))
        await asyncio.sleep(2.0)
        assert bench.engine.ticks == []
        bench.offers.clear()
        await asyncio.sleep(8.0)
        assert bench.engine.ticks == pytest.approx([4.0])

    run_simulated(main())


def test_a_timer_that_rings_when_there_is_no_deadline_any_more_does_nothing() -> None:
    async def main() -> None:
        bench = Bench()
        bench.engine.due_at = 1.0
        bench.link.pump()
        bench.engine.due_at = None  # without a pump: the engine was only asked something
        await asyncio.sleep(5.0)
        assert bench.engine.ticks == []
        bench.engine.due_at = 7.0
        bench.link.pump()
        await asyncio.sleep(5.0)
        assert bench.engine.ticks == pytest.approx([7.0])

    run_simulated(main())


def test_a_deadline_that_is_put_off_again_and_again_costs_one_timer() -> None:
    async def main() -> None:
        bench = Bench()
        loop = asyncio.get_running_loop()
        armed: list[float] = []
        call_at = loop.call_at

        def counted(when: float, *args: Any, **kwargs: Any) -> asyncio.TimerHandle:
            armed.append(when)
            return call_at(when, *args, **kwargs)

        loop.call_at = counted  # type: ignore[method-assign]
        for count in range(1, 101):
            bench.engine.due_at = float(count)
            bench.link.pump()
        assert armed == [1.0]

    run_simulated(main())


def test_after_close_nothing_comes_in_goes_out_or_rings() -> None:
    async def main() -> None:
        bench = Bench()
        bench.engine.due_at = 1.0
        bench.link.pump()
        bench.link.close()
        bench.engine.events.append(LinkReady())
        bench.engine.outgoing += b"late;"
        bench.link.receive(b"late;")
        bench.link.pump()
        await asyncio.sleep(5.0)
        assert (bench.engine.heard, bench.events, bench.written, bench.engine.ticks) == ([], [], [], [])

    run_simulated(main())


def test_a_link_that_is_closed_by_an_event_stops_at_once() -> None:
    async def main() -> None:
        bench = Bench()
        bench.engine.events.extend([LinkReady(), ProgramEnded()])
        bench.on_event = lambda _event: bench.link.close()
        bench.link.pump()
        assert bench.events == [LinkReady()]

    run_simulated(main())


def test_nobody_is_asked_where_nothing_follows_from_what_was_heard() -> None:
    async def main() -> None:
        bench = Bench()
        bench.link.pump()
        asked: list[bool] = []
        bench.offers.append(lambda: asked.append(True))
        bench.follows = False
        bench.engine.events.append(MessageSeen("<", "ok"))
        bench.link.receive(b"ok")
        assert (bench.events, asked) == ([MessageSeen("<", "ok")], []), "it was told, and nothing follows from it"
        bench.engine.next_id += 1
        bench.link.receive(b"ok")
        assert asked == [True], "what the engine takes has changed without an event"

    run_simulated(main())


def test_where_the_engine_has_no_news_its_bytes_go_out_and_that_is_all_until_it_has_or_the_link_is_closed() -> None:
    async def main() -> None:
        bench = Bench()
        bench.link.pump()
        bench.engine.news, seen = False, MessageSeen("<", "ok")
        bench.engine.events.append(seen)
        bench.engine.outgoing += b"X1;"
        bench.link.receive(b"ok")
        assert (bench.written, bench.events) == ([b"X1;"], [])
        bench.engine.news = True
        bench.link.receive(b"ok")
        assert bench.events == [seen]
        bench.engine.news = False
        bench.engine.events.append(seen)
        bench.link.receive(b"ok")
        bench.engine.outgoing += b"X2;"
        bench.link.close()
        assert (bench.written, bench.events) == ([b"X1;"], [seen, seen]), "told, and nothing more is sent"

    run_simulated(main())


def test_an_offer_is_made_where_something_follows_and_what_comes_of_it_is_written() -> None:
    async def main() -> None:
        bench = Bench()
        bench.link.pump()
        bench.offers.append(lambda: bench.engine.submit(ListFiles(1), 0.0))
        bench.engine.events.append(LinkReady())
        bench.link.receive(b"ok")
        assert (bench.offers, bench.written) == ([], [b"command;"])

    run_simulated(main())
