"""What a step writes is one transaction; without a step each write is one of its own."""

from collections.abc import Callable
from functools import partial
from typing import Any

from server.machine.together import Together


class Posted:
    """In the place of the database: what was posted, and all of it done at once by `commit`."""

    def __init__(self) -> None:
        self.transactions: list[tuple[Callable[..., Any], tuple[Any, ...], Callable[[], None] | None]] = []

    def post(self, fn: Callable[..., Any], *args: Any, then: Callable[[], None] | None = None) -> None:
        self.transactions.append((fn, args, then))

    def commit(self) -> list[list[Any]]:
        """What each transaction wrote."""
        found = []
        for fn, args, then in self.transactions:
            written: list[Any] = []
            fn(written, *args)
            found.append(written)
            if then is not None:
                then()
        return found


def write(db: list[Any], what: str) -> None:
    db.append(what)


def test_without_a_step_each_write_goes_alone() -> None:
    db, told = Posted(), list[str]()
    together = Together(db)  # type: ignore[arg-type]
    together.post(write, "a")
    together.post(write, "b", then=lambda: told.append("b"))
    assert db.commit() == [["a"], ["b"]]
    assert told == ["b"]


def test_a_step_is_one_transaction_and_everybody_is_told() -> None:
    db, told = Posted(), list[str]()
    together = Together(db)  # type: ignore[arg-type]
    together.hold()
    for name in "abc":
        together.post(write, name, then=None if name == "b" else partial(told.append, name))
    assert db.transactions == []
    together.release()
    together.post(write, "d")
    assert db.commit() == [["a", "b", "c"], ["d"]]
    assert told == ["a", "c"]


def test_a_step_without_an_end_loses_nothing_to_the_next() -> None:
    db = Posted()
    together = Together(db)  # type: ignore[arg-type]
    together.hold()
    together.post(write, "a")
    together.hold()
    together.post(write, "b")
    together.release()
    together.hold()
    together.release()
    assert db.commit() == [["a", "b"]]
