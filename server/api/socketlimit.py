"""How many WebSockets may be open, of one address and in all.

The one rule: there is always a connection left for a plain request, and an e-stop is one.
"""

from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from server.config.limits import LimitsConfig
from server.problems import ProblemError


class SocketLimit:
    """Counts those that are open."""

    def __init__(self, limits: Callable[[], LimitsConfig]) -> None:
        self._limits = limits
        self._open: Counter[str] = Counter()
        self.refused: Counter[str] = Counter()
        """How many, by the limit that was reached."""

    @contextmanager
    def one(self, address: str) -> Iterator[None]:
        """One more from there while inside. Raises ProblemError where there are enough."""
        limits = self._limits()
        for many, most, key in (
            (self._open[address], limits.sockets_per_address, "sockets_per_address"),
            (self._open.total(), limits.sockets, "sockets"),
        ):
            if many >= most:
                self.refused[key] += 1
                raise ProblemError(
                    "too_many_sockets", f"{many} WebSockets are open (limits.{key}); close some of them."
                )
        self._open[address] += 1
        try:
            yield
        finally:
            self._open[address] -= 1
            if not self._open[address]:
                del self._open[address]
