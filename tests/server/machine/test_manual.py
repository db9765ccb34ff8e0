"""Commands by hand: one by one to the engine, and everybody who waits is answered."""

import asyncio

import pytest

from protocol.commands import ClearAlarm, ListFiles, Override, RunBlock
from protocol.errors import MessageTooLongError
from protocol.events import CommandDone, CommandFailed, FilesListed, ModalRead
from server.machine.link import Link
from server.machine.manual import MAX_EVENTS, QUEUE_LIMIT, Answer, Manual
from server.problems import ProblemError
from tests.harness.fakes import ScriptedEngine
from tests.harness.simloop import run_simulated


def test_commands_go_out_when_the_engine_is_free_in_order() -> None:
    async def main() -> None:
        manual, engine = Manual("router", asyncio.get_running_loop()), ScriptedEngine()
        first, second = manual.put(ClearAlarm), manual.put(lambda token: RunBlock(token, ("G28",)))
        assert manual.offer(engine, 0.0)  # type: ignore[arg-type]
        assert not manual.offer(engine, 0.0)  # type: ignore[arg-type]
        assert (manual.busy, manual.waiting) == (True, True)
        manual.handle(CommandDone(1))
        engine.is_free = True
        assert manual.offer(engine, 0.0)  # type: ignore[arg-type]
        manual.handle(CommandFailed(2, 5, "no"))
        assert (await first).end == CommandDone(1)
        assert (await second).end == CommandFailed(2, 5, "no")
        assert engine.taken == [ClearAlarm(1), RunBlock(2, ("G28",))]
        assert not manual.busy

    run_simulated(main())


def test_behind_one_that_does_not_fit_the_next_goes_at_once() -> None:
    async def main() -> None:
        manual, engine = Manual("router", asyncio.get_running_loop()), ScriptedEngine()
        take = engine.submit

        def submit(command: object, now: float) -> None:
            if command == RunBlock(1, ("G1" + "X0" * 99,)):
                raise MessageTooLongError("198 characters")
            take(command, now)  # type: ignore[arg-type]

        engine.submit = submit  # type: ignore[method-assign]
        too_long = manual.put(lambda token: RunBlock(token, ("G1" + "X0" * 99,)))
        manual.put(ClearAlarm)
        assert manual.offer(engine, 0.0)  # type: ignore[arg-type]
        assert engine.taken == [ClearAlarm(2)]
        with pytest.raises(ProblemError, match="198 characters"):
            await too_long

    run_simulated(main())


def test_an_answer_is_everything_up_to_the_end_of_the_command() -> None:
    async def main() -> None:
        manual, engine = Manual("router", asyncio.get_running_loop()), ScriptedEngine()
        answer = manual.put(ListFiles)
        manual.offer(engine, 0.0)  # type: ignore[arg-type]
        listed = FilesListed(1, ("a.nc",), readable=True)
        manual.handle(ModalRead(None, ("G0",)))  # of the handshake: nobody's
        manual.handle(ModalRead(7, ("G0",)))  # somebody else's
        manual.handle(listed)
        await asyncio.sleep(0)
        assert (manual.busy, answer.done()) == (True, False)
        manual.handle(CommandDone(1))
        assert await answer == Answer((listed, CommandDone(1)), CommandDone(1))
        assert (await answer).only(FilesListed) is listed
        assert not manual.busy

    run_simulated(main())


def test_an_engine_that_babbles_does_not_fill_memory() -> None:
    async def main() -> None:
        manual, engine = Manual("router", asyncio.get_running_loop()), ScriptedEngine()
        answer = manual.put(ListFiles)
        manual.offer(engine, 0.0)  # type: ignore[arg-type]
        for _ in range(MAX_EVENTS * 3):
            manual.handle(FilesListed(1, ("a.nc",), readable=True))
        manual.handle(CommandDone(1))
        assert len((await answer).events) == MAX_EVENTS
        assert (await answer).end == CommandDone(1)

    run_simulated(main())


def test_the_realtime_lane_waits_for_nobody_and_is_answered() -> None:
    async def main() -> None:
        loop = asyncio.get_running_loop()
        manual, engine = Manual("router", loop), ScriptedEngine()
        written: list[bytes] = []
        link = Link(engine, written.append, lambda _event: True, lambda: False, loop)  # type: ignore[arg-type]
        engine.is_free = False
        waits = manual.put(ClearAlarm)
        pressed = manual.press(link, lambda token: Override(token, "feed", "+10"))
        assert (written, engine.urgent) == ([b"urgent;"], [Override(2, "feed", "+10")])
        manual.handle(CommandDone(2))
        assert (await pressed).end == CommandDone(2)
        assert not waits.done()

    run_simulated(main())


def test_who_gives_up_while_a_command_waits_takes_it_back() -> None:
    async def main() -> None:
        manual, engine = Manual("router", asyncio.get_running_loop()), ScriptedEngine()
        given_up, kept = manual.put(ListFiles), manual.put(ClearAlarm)
        given_up.cancel()
        assert manual.offer(engine, 0.0)  # type: ignore[arg-type]
        assert engine.taken == [ClearAlarm(2)]
        assert not kept.done()

    run_simulated(main())


def test_more_than_a_few_are_refused() -> None:
    async def main() -> None:
        manual = Manual("router", asyncio.get_running_loop())
        for _ in range(QUEUE_LIMIT):
            manual.put(ClearAlarm)
        with pytest.raises(ProblemError) as refused:
            manual.put(ClearAlarm)
        assert refused.value.code == "machine_busy"

    run_simulated(main())


def test_jogs_can_be_taken_back_and_other_commands_not() -> None:
    async def main() -> None:
        manual = Manual("router", asyncio.get_running_loop())
        jog, kept = manual.put(lambda token: RunBlock(token, ("X1",)), droppable=True), manual.put(ClearAlarm)
        manual.drop_jogs()
        with pytest.raises(ProblemError):
            await jog
        assert not kept.done()
        assert manual.waiting

    run_simulated(main())


def test_everybody_is_answered_when_the_epoch_ends() -> None:
    async def main() -> None:
        manual, engine = Manual("router", asyncio.get_running_loop()), ScriptedEngine()
        answers = [manual.put(ClearAlarm), manual.put(ClearAlarm)]
        manual.offer(engine, 0.0)  # type: ignore[arg-type]
        manual.epoch_ended()
        for answer in answers:
            with pytest.raises(ProblemError) as refused:
                await answer
            assert refused.value.code == "no_answer"
        manual.handle(CommandDone(1))  # the late news of an engine that is gone
        assert not manual.busy

    run_simulated(main())


def test_a_request_that_was_given_up_does_not_free_the_machine() -> None:
    async def main() -> None:
        manual, engine = Manual("router", asyncio.get_running_loop()), ScriptedEngine()
        answer = manual.put(ClearAlarm)
        manual.offer(engine, 0.0)  # type: ignore[arg-type]
        answer.cancel()
        assert manual.busy
        manual.handle(CommandDone(1))
        assert not manual.busy

    run_simulated(main())


def test_only_what_was_not_handed_over_can_be_withdrawn() -> None:
    async def main() -> None:
        manual, engine = Manual("router", asyncio.get_running_loop()), ScriptedEngine()
        sent, waits = manual.put(ClearAlarm), manual.put(ClearAlarm)
        manual.offer(engine, 0.0)  # type: ignore[arg-type]
        assert (manual.withdraw(sent), manual.withdraw(waits), manual.withdraw(waits)) == (False, True, False)
        assert (sent.done(), waits.cancelled(), manual.waiting) == (False, True, False)

    run_simulated(main())


@pytest.mark.parametrize("error", [MessageTooLongError("too long"), UnicodeEncodeError("cp1251", "é", 0, 1, "no")])
def test_what_does_not_fit_the_wire_is_refused_and_bars_nobody(error: Exception) -> None:
    async def main() -> None:
        manual, engine = Manual("router", asyncio.get_running_loop()), ScriptedEngine()
        submit = engine.submit

        def refuse(*_args: object) -> None:
            raise error

        engine.submit = refuse  # type: ignore[method-assign, assignment]
        answer = manual.put(ClearAlarm)
        assert not manual.offer(engine, 0.0)
        with pytest.raises(ProblemError) as refused:
            await answer
        assert refused.value.code == "invalid_request"
        assert not manual.busy
        engine.submit = submit  # type: ignore[method-assign]
        manual.put(ClearAlarm)
        assert manual.offer(engine, 0.0)

    run_simulated(main())
