"""The announcement: anew when the addresses change, withdrawn at the end, tried again when the network refuses."""

import asyncio
from collections.abc import Callable, Sequence
from typing import Any

import pytest
from zeroconf import NonUniqueNameException, ServiceInfo

from server.outbound import mdns
from server.outbound.announcement import Announcement, announcements
from server.outbound.mdns import LOOK_EVERY_S, Announcer, info_of, own_addresses, register
from server.outbound.tasks import end
from server.waysout import WayOut
from tests.harness.simloop import run_simulated


def wanted(*addresses: str) -> list[Announcement]:
    return announcements(
        name="", hostname="shop", port=8420, addresses=addresses, version="1.2", machines=["router", "lathe"]
    )


class Network:
    """What stands in it."""

    def __init__(self) -> None:
        self.standing: list[tuple[str, ...]] = []
        self.registered = 0
        self.refuses = False

    def register(self, told: Sequence[Announcement]) -> Any:
        if self.refuses:
            raise OSError("no route")
        network, addresses = self, told[0].addresses
        self.standing.append(addresses)
        self.registered += 1

        class Standing:
            def close(self) -> None:
                network.standing.remove(addresses)

        return Standing()


@pytest.fixture(autouse=True)
def _without_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    async def here(work: Callable[..., Any], *args: Any) -> Any:
        return work(*args)

    monkeypatch.setattr(mdns.asyncio, "to_thread", here)


def test_announced_anew_when_the_addresses_change_and_withdrawn_at_the_end() -> None:
    async def main() -> None:
        network, counted, own = Network(), WayOut(), ["192.0.2.7"]
        task = asyncio.create_task(Announcer(lambda: wanted(*own), network.register, counted).run())
        await asyncio.sleep(5 * LOOK_EVERY_S)
        assert network.standing == [("192.0.2.7",)]
        assert (network.registered, counted.connected, counted.sent) == (1, 1, 2)
        own[:] = ["192.0.2.8"]
        await asyncio.sleep(2 * LOOK_EVERY_S)
        assert network.standing == [("192.0.2.8",)]
        own.clear()
        await asyncio.sleep(2 * LOOK_EVERY_S)
        assert (network.standing, counted.connected) == ([], 0)
        own[:] = ["192.0.2.9"]
        await asyncio.sleep(2 * LOOK_EVERY_S)
        assert network.registered == 3
        await end([task])
        assert (network.standing, counted.connected) == ([], 0)

    run_simulated(main())


def test_a_network_that_refuses_is_tried_again_and_complained_of_once(caplog: pytest.LogCaptureFixture) -> None:
    async def main() -> None:
        network, counted = Network(), WayOut()
        network.refuses = True
        task = asyncio.create_task(Announcer(lambda: wanted("192.0.2.7"), network.register, counted).run())
        await asyncio.sleep(3.5 * LOOK_EVERY_S)
        assert (counted.failures, counted.connected) == (4, 0)
        network.refuses = False
        await asyncio.sleep(LOOK_EVERY_S)
        assert network.standing == [("192.0.2.7",)]
        await end([task])

    run_simulated(main())
    assert caplog.text.count("cannot be announced: no route") == 1


def test_as_zeroconf_wants_it() -> None:
    info = info_of(wanted("192.0.2.7", "2001:db8::7")[0])
    assert info.decoded_properties == {"version": "1.2", "path": "/", "machines": "router,lathe"}
    assert set(info.parsed_addresses()) == {"192.0.2.7", "2001:db8::7"}
    assert (info.name, info.server, info.port) == ("shop._millstream._tcp.local.", "shop.local.", 8420)


def test_this_computer_has_addresses() -> None:
    assert "127.0.0.1" in own_addresses()


class Library:
    """zeroconf, as far as it is used."""

    def __init__(self, interfaces: list[str], refuses: Exception | None = None) -> None:
        self.interfaces, self.refuses = interfaces, refuses
        self.told: list[str] = []

    def register_service(self, info: ServiceInfo, *, allow_name_change: bool) -> None:
        assert allow_name_change, "two daemons of one name are two"
        if self.refuses is not None:
            raise self.refuses
        self.told.append(info.name)

    def unregister_all_services(self) -> None:
        self.told.append("withdrawn")

    def close(self) -> None:
        self.told.append("closed")


def test_registered_at_the_addresses_and_taken_back(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[Library] = []
    monkeypatch.setattr(mdns, "Zeroconf", lambda interfaces: made.append(Library(interfaces)) or made[-1])
    standing = register(wanted("192.0.2.7"))
    standing.close()
    assert made[0].interfaces == ["192.0.2.7"]
    assert made[0].told == ["shop._millstream._tcp.local.", "shop._http._tcp.local.", "withdrawn", "closed"]


@pytest.mark.parametrize("error", [NonUniqueNameException(), OSError(19, "No such device"), RuntimeError("closed")])
def test_what_cannot_be_announced_is_an_os_error_and_leaves_nothing(
    error: Exception, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[Library] = []
    monkeypatch.setattr(mdns, "Zeroconf", lambda interfaces: made.append(Library(interfaces, error)) or made[-1])
    with pytest.raises(OSError):  # noqa: PT011 - the words are the library's
        register(wanted("192.0.2.7"))
    assert made[0].told == ["closed"]
