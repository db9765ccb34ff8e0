"""A terminal on a virtual Grbl controller: says, waits, reads whole lines, in simulated time."""

import math
from typing import Any

from sim.grbl.machine import VirtualGrbl
from sim.grbl.simsettings import SimSettings

LIVELY = {110: 6000, 111: 6000, 112: 3000, 120: 200, 121: 200, 122: 100}
"""Rates and accelerations of a small router: the defaults of Grbl crawl."""


class Console:
    """`now` only goes on when `wait` or one of its kind is called."""

    def __init__(self, *, dollar: dict[int, float] | None = None, **settings: Any) -> None:
        self.machine = VirtualGrbl(SimSettings(dollar=LIVELY | (dollar or {}), **settings))
        self.now = 0.0

    def tell(self, text: str | bytes) -> list[str]:
        """Bytes as they are; what is said at once."""
        data = text if isinstance(text, bytes) else text.encode("latin-1")
        self.machine.receive_data(data, self.now)
        return self.heard()

    def heard(self) -> list[str]:
        text = self.machine.data_to_send(self.now).decode("ascii")
        assert text == "" or text.endswith("\r\n")
        return text.split("\r\n")[:-1]

    def wait(self, seconds: float) -> list[str]:
        self.now += seconds
        return self.heard()

    def timeline(self, seconds: float) -> list[tuple[float, str]]:
        """What is said when, as far as the machine's own timers tell; `now` is at the end of it."""
        end = self.now + seconds
        said: list[tuple[float, str]] = []
        while True:
            at = self.machine.next_timer()
            self.now = end if at is None or at > end else max(at, self.now)
            said += [(self.now, line) for line in self.heard()]
            if at is None or at > end:
                return said

    def rest(self, limit: float = 3600.0) -> list[str]:
        """Until nothing more would happen by itself."""
        end = self.now + limit
        said = self.heard()
        while (at := self.machine.next_timer()) is not None:
            assert at <= end, "the machine does not come to rest"
            self.now = max(self.now, at)
            said += self.heard()
        return said

    def status(self) -> str:
        found = [line for line in self.tell(b"?") if line.startswith("<")]
        assert len(found) == 1
        return found[0]

    def field(self, name: str) -> str | None:
        """One field of a status report."""
        for part in self.status()[1:-1].split("|"):
            if part.startswith(f"{name}:"):
                return part.removeprefix(f"{name}:")
        return None

    def state(self) -> str:
        return self.status()[1:].split("|")[0].rstrip(">")

    def place(self) -> tuple[float, ...]:
        text = self.field("MPos")
        assert text is not None
        return tuple(float(each) for each in text.split(","))

    def at(self, *place: float) -> bool:
        return all(math.isclose(a, b, abs_tol=0.005) for a, b in zip(self.place(), place, strict=True))

    def settings(self) -> dict[int, str]:
        lines = [line for line in self.tell("$$\n") if line.startswith("$")]
        return {int(key[1:]): value for key, _, value in (line.partition("=") for line in lines)}


def stream(console: Console, lines: list[bytes], *, window: int = 128) -> list[str]:
    """Send by counting characters, as the documents of Grbl tell: never more than `window` bytes unanswered."""
    waiting: list[int] = []
    said: list[str] = []

    def hear() -> None:
        for text in console.heard():
            said.append(text)
            if text == "ok" or text.startswith("error:"):
                del waiting[0]

    for line in lines:
        while sum(waiting) + len(line) > window:
            at = console.machine.next_timer()
            assert at is not None, "the machine owes answers and will never give them"
            console.now = max(console.now, at)
            hear()
        waiting.append(len(line))
        console.machine.receive_data(line, console.now)
        hear()
    while (at := console.machine.next_timer()) is not None:
        console.now = max(console.now, at)
        hear()
    assert not waiting, "lines without an answer"
    return said
