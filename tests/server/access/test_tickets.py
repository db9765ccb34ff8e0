"""Tickets: once, for a short time, in constant memory."""

from server.access.auth import Principal, Role
from server.access.tickets import LIFETIME_S, MAX_OPEN, MAX_OPEN_IN_ALL, Tickets

ANNA, BERT = Principal(Role.OPERATOR, "Anna", "t1"), Principal(Role.VIEWER, "Bert", "t2")


def test_good_once() -> None:
    tickets = Tickets()
    ticket = tickets.issue(ANNA, now=0.0)
    assert tickets.redeem("guess", now=0.0) is None
    assert tickets.redeem(ticket, now=LIFETIME_S - 0.1) == ANNA
    assert tickets.redeem(ticket, now=LIFETIME_S - 0.1) is None


def test_for_a_short_time() -> None:
    tickets = Tickets()
    ticket = tickets.issue(ANNA, now=0.0)
    assert tickets.redeem(ticket, now=LIFETIME_S) is None


def test_who_asks_for_many_loses_only_their_own() -> None:
    tickets = Tickets()
    berts = tickets.issue(BERT, now=0.0)
    first = tickets.issue(ANNA, now=0.0)
    many = [tickets.issue(ANNA, now=0.0) for _ in range(MAX_OPEN)]
    assert tickets.redeem(first, now=0.0) is None
    assert tickets.redeem(many[-1], now=0.0) == ANNA
    assert tickets.redeem(berts, now=0.0) == BERT


def test_memory_is_bounded_and_the_old_ones_are_forgotten() -> None:
    tickets = Tickets()
    for number in range(MAX_OPEN_IN_ALL // 64 + 10):
        for _ in range(64):
            tickets.issue(Principal(Role.VIEWER, "x", f"t{number}"), now=0.0)
    assert len(tickets._open) == MAX_OPEN_IN_ALL
    tickets.issue(ANNA, now=LIFETIME_S)
    assert len(tickets._open) == 1
