"""A block in a scene: verbs with a clock of its own, and what it did in the sheet's notation.

`pin^` rises, `pin_` falls, `pin=n` is set; a comma within a step, a bar between steps. The `state` pin is kept apart.
"""

from collections.abc import Mapping
from typing import TypeVar

from protocol.iocontrol.config import IoConfig
from protocol.iocontrol.control import IoControl
from protocol.iocontrol.events import End, Event, OperatorMessage, PinChanged
from protocol.iocontrol.tooltable import ToolTable, parse

E = TypeVar("E")

TABLE, _ = parse("T1 P1\nT5 P12 D6.0 Z+10.0 ;six mm\nT7 P3\n")
RANDOM, _ = parse("T1 P0\nT5 P12 ;six mm\nT7 P3\nT0 P4 ;empty\n", random=True)
CLOSED = {"emc-enable-in": True}


class Scene:
    """`io` is the block; each verb takes a tenth of a second."""

    def __init__(self, config: IoConfig, table: ToolTable | None = TABLE, *, tool: int | None = 0) -> None:
        self.now = 100.0
        self.io = IoControl(config, table, self.now, tool=tool)
        self.seen: list[Event] = []
        self.taken: list[Event] = self._drain()

    def tick(self, seconds: float = 0.1) -> float:
        self.now += seconds
        return self.now

    def inputs(self, **pins: bool | int) -> str:
        """`tool_prepared=True`: the sequence that follows from it, with it."""
        self.io.set_inputs(named(pins), self.tick())
        return self.sequence()

    def run_timer(self) -> str:
        """Let time pass until the next deadline."""
        at = self.io.next_timer()
        assert at is not None, "nothing is to happen by itself"
        self.now = max(self.now, at)
        self.io.handle_timer(self.now)
        return self.sequence()

    def sequence(self) -> str:
        """What has happened to the pins since the last look; the events are in `taken`."""
        self.taken = self._drain()
        return notation(self.taken)

    def of(self, kind: type[E]) -> list[E]:
        """The events of a kind that came with the last look."""
        return [event for event in self.taken if isinstance(event, kind)]

    @property
    def ends(self) -> list[End]:
        return [event for event in self.taken if isinstance(event, End)]

    @property
    def messages(self) -> list[str]:
        return [event.text for event in self.of(OperatorMessage)]

    def value(self, pin: str) -> bool | int:
        return next(state.value for state in self.io.pins() if state.name == pin)

    def _drain(self) -> list[Event]:
        events: list[Event] = []
        while (event := self.io.next_event()) is not None:
            events.append(event)
        self.seen += events
        return events


def named(pins: Mapping[str, bool | int]) -> dict[str, bool | int]:
    return {name.replace("_", "-"): value for name, value in pins.items()}


def notation(events: list[Event], *, without: frozenset[str] = frozenset({"state"})) -> str:
    steps: dict[int, list[str]] = {}
    for event in events:
        if isinstance(event, PinChanged) and event.pin not in without:
            sign = f"={event.value}" if not isinstance(event.value, bool) else "^" if event.value else "_"
            steps.setdefault(event.step, []).append(event.pin + sign)
    return " | ".join(", ".join(step) for step in steps.values())


def external(
    config: IoConfig | None = None, table: ToolTable | None = TABLE, *, tool: int | None = 0, **pins: bool | int
) -> Scene:
    """An external changer that is connected and has acknowledged the start; e-stop reset, nothing pending."""
    scene = Scene(config or IoConfig(kind="external", start_in_estop=False), table, tool=tool)
    scene.io.connect({"emc-enable-in": True, **named(pins)}, scene.tick())
    if scene.io.config.protocol_version == 2:
        scene.inputs(emc_abort_ack=True)
        scene.inputs(emc_abort_ack=False)
    scene.sequence()
    assert scene.io.start_refusal is None or tool is None
    return scene


def prepared(scene: Scene, number: int = 5) -> Scene:
    """T, and the changer has prepared it."""
    scene.io.prepare(number, scene.tick(), line=7)
    scene.inputs(tool_prepared=True)
    scene.inputs(tool_prepared=False)
    assert scene.io.prepared == number
    return scene


def changing(scene: Scene, number: int = 5) -> Scene:
    """In the middle of an M6: tool-change is TRUE."""
    prepared(scene, number).io.change(scene.tick(), line=8)
    scene.sequence()
    assert scene.value("tool-change") is True
    return scene
