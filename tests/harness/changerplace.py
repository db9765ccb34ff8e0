"""The tool changer of a machine with stand-ins for its neighbours (job, database, hub) and a clock moved by hand.

The block behind it is the real one. The one rule: the stand-ins only write down what they are told.
"""

from collections.abc import Callable
from datetime import UTC, datetime
from typing import Any

from jobs.effects import ToolAsk
from jobs.toolstore import KeptTools
from server.changer.toolchanger import ToolChanger
from server.config.toolchanger import ToolchangerConfig

CONNECTED = {"emc-enable-in": True}


class Clock:
    """The loop's time and its one timer, and the time for people."""

    def __init__(self) -> None:
        self.now_s = 0.0
        self.due: tuple[float, Callable[[], None]] | None = None

    def time(self) -> float:
        return self.now_s

    def now(self) -> datetime:
        return datetime(2026, 3, 1, tzinfo=UTC)

    def call_at(self, at: float, then: Callable[[], None]) -> "Clock":
        self.due = at, then
        return self

    def cancel(self) -> None:
        self.due = None

    def pass_time(self) -> None:
        """Until the next deadline."""
        assert self.due is not None, "nothing is to happen by itself"
        (self.now_s, then), self.due = self.due, None
        then()


class Place:
    """The neighbours of a changer: job, database, hub."""

    def __init__(self, *, kept: KeptTools = KeptTools(), **config: Any) -> None:  # noqa: B008 - frozen
        self.clock = Clock()
        self.heard: list[str] = []
        self.notes: list[tuple[str, dict[str, Any]]] = []
        self.published: list[tuple[str, dict[str, Any]]] = []
        self.kept: list[KeptTools] = []
        self.stops = 0
        self.tools_told: list[int | None] = []
        self.active_job: int | None = None
        clock: Any = self.clock
        here: Any = self
        self.changer = ToolChanger(
            "router", ToolchangerConfig(**config), kept=kept, job=here, db=here, hub=here, clock=clock, loop=clock
        )
        self.changer.on_estop = self._stop
        self.changer.on_tool = self.tools_told.append

    def _stop(self) -> None:
        self.stops += 1

    # what a job, a database and a hub are asked

    def hear_changer(self, tell: Callable[[Any], Any]) -> None:
        tell(self)

    def tool_started(self) -> None:
        self.heard.append("started")

    def tool_changed(self, *, by_person: bool) -> None:
        self.heard.append("changed by a person" if by_person else "changed")

    def tool_failed(self, message: str, *, goes_on: bool) -> None:
        self.heard.append(f"failed: {message}{', goes on' if goes_on else ''}")

    def tool_late(self) -> None:
        self.heard.append("late")

    def tool_free(self, *, motion_allowed: bool) -> None:
        self.heard.append("free" if motion_allowed else "kept")

    def note(self, kind: str, **data: Any) -> None:
        self.notes.append((kind, data))

    def post(self, _save: Any, machine: str, kept: KeptTools) -> None:
        assert machine == "router"
        self.kept.append(kept)

    def publish(self, topic: str, _machine: str, data: dict[str, Any]) -> None:
        self.published.append((topic, data))

    # what they say

    def ask(self, what: Any, number: int | None = None) -> None:
        self.changer.ask(ToolAsk(what, number, 7))

    def wanted(self, tool: int = 5) -> None:
        """A job is in the middle of an M6: the machine stands where tools are changed."""
        for what in ("prepare", "start", "change"):
            self.ask(what, tool)

    def of(self, kind: str) -> list[dict[str, Any]]:
        return [data for name, data in self.notes if name == kind]

    def told(self, topic: str) -> list[dict[str, Any]]:
        return [data for name, data in self.published if name == topic]


def external(**config: Any) -> Place:
    """Connected over plain HTTP, the start acknowledged."""
    place = Place(kind="external", start_in_estop=False, **config)
    place.changer.drive(CONNECTED)
    for level in (True, False):
        place.changer.drive({"emc-abort-ack": level})
    place.heard.clear()
    return place
