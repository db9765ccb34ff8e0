"""What the network is told: never of a daemon that it cannot reach, and within the limits of DNS."""

import pytest

from server.outbound.announcement import SERVICES, announcements, reachable

OWN = ["127.0.0.1", "192.0.2.7", "10.0.0.1", "::1", "fe80::1%eth0", "2001:db8::7"]


@pytest.mark.parametrize(
    ("host", "wanted"),
    [
        ("127.0.0.1", ()),
        ("localhost", ()),
        ("::1", ()),
        ("192.0.2.7", ("192.0.2.7",)),
        ("0.0.0.0", ("10.0.0.1", "192.0.2.7")),
        ("::", ("10.0.0.1", "192.0.2.7", "2001:db8::7")),
        ("[2001:db8::7]", ("2001:db8::7",)),
        ("fe80::1", ()),
    ],
)
def test_addresses_at_which_others_reach_it(host: str, wanted: tuple[str, ...]) -> None:
    assert reachable(host, OWN) == wanted


def told(**changes: object) -> list[object]:
    known = {"name": "", "hostname": "shop.lan", "port": 8420, "addresses": ("192.0.2.7",), "version": "1.2"}
    return list(announcements(**{**known, "machines": ["router", "lathe"], **changes}))  # type: ignore[arg-type]


def test_both_services_with_where_and_what() -> None:
    found = announcements(
        name="", hostname="shop.lan", port=8420, addresses=("192.0.2.7",), version="1.2", machines=["router", "lathe"]
    )
    assert [one.type for one in found] == list(SERVICES)
    for one in found:
        assert one.name == f"shop.{one.type}"
        assert (one.server, one.port, one.addresses) == ("shop.local.", 8420, ("192.0.2.7",))
        assert one.properties == {"version": "1.2", "path": "/", "machines": "router,lathe"}


def test_nothing_where_nobody_reaches_it() -> None:
    assert told(addresses=()) == []


def test_a_hundred_machines_and_a_long_name_fit() -> None:
    found = announcements(
        name="ü" * 40,
        hostname="",
        port=1,
        addresses=("192.0.2.7",),
        version="1",
        machines=[f"machine-number-{number}" for number in range(100)],
    )
    for one in found:
        text = f"machines={one.properties['machines']}"
        assert 230 < len(text) <= 255
        assert not text.endswith(",")
        assert len(one.name.removesuffix(f".{one.type}").encode()) <= 63
        assert one.server == "millstream.local."
