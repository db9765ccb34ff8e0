"""Keeping a port open: for ever, with growing pauses, and never listening to an epoch that is over."""

import asyncio

import pytest

from server.machine.reconnect import DELAYS_S, TABLE, Phase, Reconnect
from tests.harness.simloop import run_simulated


class Ports:
    """Opens as long as `broken` is False."""

    def __init__(self) -> None:
        self.broken = False
        self.opened: list[tuple[int, float]] = []
        self.refused: list[str] = []
        self.slow_s = 0.0
        self.reconnect = Reconnect(self.open, self.refused.append)

    async def open(self, epoch: int) -> None:
        await asyncio.sleep(self.slow_s)
        if self.broken:
            raise OSError("no such device")
        self.opened.append((epoch, asyncio.get_running_loop().time()))


def test_every_phase_of_the_table_can_be_left() -> None:
    assert {phase for phase, _ in TABLE} == set(Phase)


def test_it_opens_and_after_a_loss_opens_again_soon() -> None:
    async def main() -> None:
        ports = Ports()
        ports.reconnect.want()
        await asyncio.sleep(1)
        assert ports.reconnect.phase is Phase.OPEN
        ports.reconnect.proved()
        ports.reconnect.lost(1)
        await asyncio.sleep(DELAYS_S[0] + 0.1)
        assert ports.opened == [(1, 0.0), (2, pytest.approx(1 + DELAYS_S[0]))]
        ports.reconnect.unwant()

    run_simulated(main())


def test_it_tries_for_ever_with_growing_pauses() -> None:
    async def main() -> None:
        ports = Ports()
        ports.broken = True
        ports.reconnect.want()
        await asyncio.sleep(3600)
        assert len(ports.refused) == pytest.approx(3600 / DELAYS_S[-1], rel=0.05)
        assert ports.reconnect.refusal == "no such device"
        ports.broken = False
        await asyncio.sleep(DELAYS_S[-1])
        assert ports.reconnect.phase is Phase.OPEN
        assert ports.reconnect.refusal == "", "the next one is news"
        ports.reconnect.unwant()

    run_simulated(main())


def test_whatever_goes_wrong_it_tries_again(caplog: pytest.LogCaptureFixture) -> None:
    async def main() -> None:
        ports = Ports()
        attempts = []

        async def fail(epoch: int) -> None:
            attempts.append(epoch)
            raise ZeroDivisionError

        reconnect = Reconnect(fail, ports.refused.append)
        reconnect.want()
        await asyncio.sleep(DELAYS_S[0] + 0.1)
        assert attempts == [1, 2]
        assert ports.refused == ["ZeroDivisionError"] * 2
        reconnect.unwant()

    run_simulated(main())
    assert "could not be begun" in caplog.text


def test_a_port_that_opens_and_never_answers_does_not_reset_the_pause() -> None:
    async def main() -> None:
        ports = Ports()
        ports.reconnect.want()
        for _ in range(10):
            await asyncio.sleep(DELAYS_S[-1] + 0.1)
            ports.reconnect.lost(ports.reconnect.epoch)
        await asyncio.sleep(DELAYS_S[-1] - 0.5)
        assert ports.reconnect.phase is Phase.WAITING
        ports.reconnect.want()
        await asyncio.sleep(0.01)
        assert ports.reconnect.phase is Phase.OPEN, "somebody asked for it: at once"
        ports.reconnect.unwant()

    run_simulated(main())


def test_news_of_an_old_epoch_are_not_heard() -> None:
    async def main() -> None:
        ports = Ports()
        ports.reconnect.want()
        await asyncio.sleep(1)
        ports.reconnect.lost(1)
        await asyncio.sleep(5)
        ports.reconnect.lost(1)
        await asyncio.sleep(5)
        assert (ports.reconnect.epoch, ports.reconnect.phase) == (2, Phase.OPEN)
        ports.reconnect.unwant()

    run_simulated(main())


def test_a_port_that_is_lost_while_it_is_opened_is_opened_again() -> None:
    async def main() -> None:
        ports = Ports()
        ports.slow_s = 1.0
        ports.reconnect.want()
        await asyncio.sleep(0.5)
        ports.reconnect.lost(1)
        await asyncio.sleep(5)
        assert [epoch for epoch, _ in ports.opened] == [1, 2]
        ports.reconnect.unwant()

    run_simulated(main())


def test_unwanted_it_stays_closed_and_the_attempt_under_way_is_no_epoch_any_more() -> None:
    async def main() -> None:
        ports = Ports()
        ports.slow_s = 1.0
        ports.reconnect.want()
        await asyncio.sleep(0.5)
        ports.reconnect.unwant()
        ports.reconnect.unwant()
        await asyncio.sleep(60)
        assert (ports.opened, ports.reconnect.phase, ports.reconnect.wanted) == ([], Phase.OFF, False)
        assert ports.reconnect.epoch == 2

    run_simulated(main())
