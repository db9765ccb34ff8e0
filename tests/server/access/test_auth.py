import pytest

from server.access.auth import (
    GRANTABLE,
    MAX_SESSIONS,
    SESSION_LIFETIME_S,
    ExposureError,
    Role,
    Sessions,
    check_exposure,
    digest,
    is_loopback,
)


def test_roles_rise() -> None:
    assert Role.PUBLIC < Role.VIEWER < Role.OPERATOR < Role.ADMIN
    assert GRANTABLE == ("viewer", "operator", "admin")


@pytest.mark.parametrize("host", ["127.0.0.1", "127.9.9.9", "::1", "[::1]", "localhost", "LOCALHOST", "localhost."])
def test_loopback(host: str) -> None:
    assert is_loopback(host)
    check_exposure(host, [])


@pytest.mark.parametrize(
    "host", ["0.0.0.0", "::", "192.168.1.5", "mill.local", "localhost.evil.example", "", "128.0.0.1"]
)
def test_a_network_address_demands_a_token(host: str) -> None:
    assert not is_loopback(host)
    with pytest.raises(ExposureError, match="millstream token create"):
        check_exposure(host, [])
    check_exposure(host, ["a token"])


def test_a_session_stands_for_its_token_until_it_ends() -> None:
    sessions = Sessions()
    cookie = sessions.begin("t1", now=0.0)
    assert sessions.token_id(cookie, now=SESSION_LIFETIME_S - 1) == "t1"
    assert sessions.token_id(cookie, now=SESSION_LIFETIME_S) is None
    assert sessions.token_id(cookie, now=0.0) is None, "an ended session does not come back"


def test_sign_out_ends_this_session_only() -> None:
    sessions = Sessions()
    one, other = sessions.begin("t1", now=0.0), sessions.begin("t1", now=0.0)
    sessions.end(one)
    sessions.end("never was")
    assert sessions.token_id(one, now=0.0) is None
    assert sessions.token_id(other, now=0.0) == "t1"


def test_sessions_are_bounded() -> None:
    sessions = Sessions()
    cookies = [sessions.begin("t1", now=0.0) for _ in range(MAX_SESSIONS + 1)]
    assert sessions.token_id(cookies[0], now=0.0) is None
    assert all(sessions.token_id(cookie, now=0.0) for cookie in cookies[1:])


def test_sessions_that_nobody_signed_out_of_go_with_their_time() -> None:
    sessions = Sessions()
    for day in range(100):
        sessions.begin("t1", now=day * 86_400.0)
    assert len(sessions._sessions) == SESSION_LIFETIME_S / 86_400.0


def test_cookies_are_kept_as_hashes_only() -> None:
    sessions = Sessions()
    cookie = sessions.begin("t1", now=0.0)
    assert cookie not in repr(vars(sessions))
    assert digest(cookie) in repr(vars(sessions))
