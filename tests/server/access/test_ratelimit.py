"""Wrong tokens: how many are looked at, from where, and who is never kept out by them."""

from server.access.ratelimit import (
    BURST,
    FORGIVEN_S,
    MAX_ADDRESSES,
    MAX_TRUSTED,
    OVERALL_BURST,
    REFILL_S,
    RESERVE,
    TRUSTED_S,
    Attempts,
    network_of,
)

HERE, THERE = "10.0.0.1", "10.0.0.2"


def guess(attempts: Attempts, address: str, times: int, now: float = 0.0) -> None:
    for number in range(times):
        attempts.wrong(address, f"guess {number}", now=now)


def test_a_few_mistakes_are_forgiven_and_come_back_with_time() -> None:
    attempts = Attempts()
    guess(attempts, HERE, BURST - 1)
    assert attempts.wait_s(HERE, "x", now=0.0) == 0
    guess(attempts, HERE, 1)
    assert attempts.wait_s(HERE, "x", now=0.0) == REFILL_S
    assert attempts.wait_s(HERE, "x", now=REFILL_S - 0.5) == 1
    assert attempts.wait_s(HERE, "x", now=REFILL_S) == 0
    assert attempts.refused == 2


def test_a_script_with_an_old_token_leaves_attempts_for_a_person() -> None:
    attempts = Attempts()
    looked_at = 0
    for second in range(600):
        if attempts.wait_s(HERE, "old", now=float(second)) == 0:
            attempts.wrong(HERE, "old", now=float(second))
            looked_at += 1
        assert attempts.wait_s(HERE, "new", now=float(second)) == 0
    assert looked_at <= BURST - RESERVE + 600 / REFILL_S


def test_another_address_is_not_kept_out() -> None:
    attempts = Attempts()
    guess(attempts, HERE, 1000)
    assert attempts.wait_s(HERE, "x", now=0.0) > 0
    assert attempts.wait_s(THERE, "x", now=0.0) == 0


def test_what_was_right_from_there_before_is_no_guess() -> None:
    attempts = Attempts()
    attempts.right(HERE, "the secret", now=0.0)
    guess(attempts, HERE, 1000)
    assert attempts.wait_s(HERE, "the secret", now=0.0) == 0
    assert attempts.wait_s(HERE, "another", now=0.0) > 0
    guess(attempts, THERE, 1000)
    assert attempts.wait_s(THERE, "the secret", now=0.0) > 0, "from there it was never right"


def test_a_network_that_guesses_together_is_bounded_together() -> None:
    attempts = Attempts()
    for number in range(OVERALL_BURST):
        attempts.wrong(f"10.0.1.{number}", "guess", now=0.0)
    assert attempts.wait_s("10.0.1.5", "x", now=0.0) == 1
    assert attempts.wait_s(THERE, "x", now=0.0) == 0, "who has not guessed is heard"


def test_memory_is_constant() -> None:
    attempts = Attempts()
    for number in range(3 * MAX_ADDRESSES):
        address = f"10.{number >> 16}.{number >> 8 & 255}.{number & 255}"
        attempts.wrong(address, "guess", now=0.0)
        attempts.right(address, str(number), now=0.0)
    assert len(attempts._by_address) == MAX_ADDRESSES
    assert len(attempts._trusted) == MAX_TRUSTED


def test_a_clock_that_goes_back_forgives_nothing() -> None:
    attempts = Attempts()
    guess(attempts, HERE, BURST, now=100.0)
    assert attempts.wait_s(HERE, "x", now=0.0) > 0


def test_addresses_as_they_count() -> None:
    assert network_of("10.0.0.1") == "10.0.0.1"
    assert network_of("::ffff:10.0.0.1") == "10.0.0.1"
    assert network_of("2001:db8::1") == network_of("2001:db8::ffff") != network_of("2001:db8:0:1::1")
    assert network_of("fe80::1%eth0") == "fe80::/64"
    assert network_of("") == ""


def test_who_guesses_no_more_is_forgotten() -> None:
    attempts = Attempts()
    guess(attempts, HERE, BURST + 3)
    guess(attempts, THERE, 1, now=FORGIVEN_S - 1)
    assert list(attempts._by_address) == [HERE, THERE]
    guess(attempts, THERE, 1, now=FORGIVEN_S)
    assert list(attempts._by_address) == [THERE]
    guess(attempts, HERE, BURST, now=FORGIVEN_S)
    assert attempts.wait_s(HERE, "x", now=FORGIVEN_S) == REFILL_S, "it is counted anew"


def test_what_was_right_from_there_once_is_a_stranger_in_the_end() -> None:
    attempts = Attempts()
    attempts.right(HERE, "the secret", now=0.0)
    attempts.right(HERE, "another", now=TRUSTED_S - 1.0)
    guess(attempts, HERE, 100, now=TRUSTED_S - 1.0)
    assert attempts.wait_s(HERE, "the secret", now=TRUSTED_S - 1.0) == 0
    assert attempts.wait_s(HERE, "the secret", now=TRUSTED_S) > 0
    assert attempts.wait_s(HERE, "another", now=TRUSTED_S) == 0
    attempts.right(HERE, "another", now=TRUSTED_S)
    assert len(attempts._trusted) == 1
