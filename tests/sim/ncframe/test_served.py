"""The lathe as it is served, in memory behind bad wires, with the daemon's pump and engine at the other end."""

import asyncio

from protocol.commands import SendBatch
from protocol.events import BatchDone, Event, LinkReady, ProtocolFault
from protocol.ncframe.dialect import Dialect
from protocol.ncframe.engine import NcFrameEngine
from server.machine.link import Link
from sim.kinds import build
from sim.options import lathe_options_from_query
from sim.shell import open_memory
from tests.harness.simloop import run_simulated

BATCHES = 10
FRAMES = 20


async def story(query: str) -> tuple[list[Event], list[str]]:
    """Ten batches through the pump; the events and the frames that the lathe executed."""
    options = lathe_options_from_query(query)
    loop = asyncio.get_running_loop()
    machine = build(options.settings, now=loop.time())
    events: list[Event] = []
    over = asyncio.Event()
    sent = 0

    def on_event(event: Event) -> bool:
        events.append(event)
        if sum(isinstance(each, BatchDone) for each in events) == BATCHES:
            over.set()
        return True

    def on_quiet() -> bool:
        nonlocal sent
        if sent == BATCHES or not engine.free():
            return False
        sent += 1
        engine.submit(SendBatch(engine.next_id, frames_of(sent), 5.0), loop.time())
        return True

    port = await open_memory(
        machine, lambda data: link.receive(data), faults=options.faults, seed=options.seed, baud=options.baud
    )
    engine = NcFrameEngine(Dialect(), first_id=1, baud=options.baud, now=loop.time())
    link = Link(engine, port.write, on_event, on_quiet, loop)
    link.pump()
    await over.wait()
    link.close()
    port.close()
    return events, [each.text for each in machine.executed]  # type: ignore[union-attr]


def frames_of(batch: int) -> tuple[str, ...]:
    return tuple(f"G{number % 2} X{number + 1} Z-{batch}" for number in range(FRAMES))


def test_every_frame_once_through_the_pump() -> None:
    events, executed = run_simulated(story("sim:?framing=gap&gap_s=0.005&baud=19200&loss=0.003&flip=0.003&seed=3"))
    assert executed == [text for batch in range(1, BATCHES + 1) for text in frames_of(batch)]
    assert any(isinstance(event, LinkReady) for event in events)
    assert any(isinstance(event, ProtocolFault) for event in events)
