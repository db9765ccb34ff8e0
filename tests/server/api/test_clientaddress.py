"""From where a request comes, behind proxies and with headers that anybody can write."""

from typing import Any

import pytest

from server.api.clientaddress import Proxies


def address(peer: str | None, trusted: tuple[str, ...] = (), *forwarded: str) -> str:
    scope: dict[str, Any] = {
        "type": "http",
        "client": None if peer is None else (peer, 40000),
        "headers": [(b"x-forwarded-for", one.encode()) for one in forwarded],
    }
    return Proxies(trusted).address_of(scope)


def test_a_header_is_not_believed_unless_the_peer_is_a_known_proxy() -> None:
    assert address("10.0.0.9", (), "1.2.3.4") == "10.0.0.9"
    assert address("10.0.0.9", ("127.0.0.1",), "1.2.3.4") == "10.0.0.9"
    assert address("127.0.0.1", ("127.0.0.1",), "1.2.3.4") == "1.2.3.4"
    assert address(None) == ""


@pytest.mark.parametrize(
    ("forwarded", "expected"),
    [
        (("6.6.6.6, 1.2.3.4",), "1.2.3.4"),  # what stands before the first stranger is hearsay
        (("6.6.6.6, 1.2.3.4, 10.0.0.2",), "1.2.3.4"),  # two proxies of ours
        (("6.6.6.6", "1.2.3.4"), "1.2.3.4"),
        (("1.2.3.4:5000",), "1.2.3.4"),
        (("[2001:db8::1]:5000",), "2001:db8::1"),
        (("<script>",), "10.0.0.1"),
        (("1.2.3.4, nonsense",), "10.0.0.1"),
        (("",), "10.0.0.1"),
        ((",".join(["10.0.0.3"] * 1000),), "10.0.0.3"),
    ],
)
def test_a_list_is_read_from_the_right(forwarded: tuple[str, ...], expected: str) -> None:
    assert address("10.0.0.1", ("10.0.0.0/8",), *forwarded) == expected


@pytest.mark.parametrize(
    ("scheme", "peer", "proto", "expected"),
    [
        ("http", "127.0.0.1", ("https",), True),
        ("ws", "::ffff:127.0.0.1", ("wss",), True),
        ("http", "127.0.0.1", (" HTTPS , http",), True),  # the second proxy was spoken to without
        ("http", "127.0.0.1", ("http, https",), False),
        ("http", "127.0.0.1", ("http", "https"), False),
        ("http", "127.0.0.1", (), False),
        ("http", "127.0.0.1", ("",), False),
        ("http", "10.0.0.9", ("https",), False),  # no proxy of ours: anybody can write it
        ("http", None, ("https",), False),
        ("https", "10.0.0.9", ("http",), True),
    ],
)
def test_tls_is_what_the_first_proxy_was_spoken_to_with(
    scheme: str, peer: str | None, proto: tuple[str, ...], expected: bool
) -> None:
    scope = {
        "type": "http",
        "scheme": scheme,
        "client": None if peer is None else (peer, 40000),
        "headers": [(b"x-forwarded-proto", one.encode()) for one in proto],
    }
    assert Proxies(("127.0.0.1",)).is_tls(scope) is expected
    assert Proxies().is_tls(scope) is (scheme == "https")
