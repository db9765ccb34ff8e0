"""A virtual tool changer behind the pins of I/O control, version 2: a PLC with a magazine, an e-stop button, faults.

An object without I/O and without a clock, the second and independent reading of the page: what the other end drives
comes in by `see`, what the changer drives itself is taken by `changes`.
The one rule: `magazine` is what really happened; the pins are only what is said of it.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from random import Random
from typing import Final, Literal

from sim.changer.magazine import Magazine
from sim.changer.settings import EMPTY_POCKET, NOT_PREPARED, WRONG_TOOL, ChangerSettings

OUTPUTS: Final[dict[str, bool | int]] = {
    "emc-enable-in": True,
    "tool-prepared": False,
    "tool-changed": False,
    "emc-abort-ack": False,
    "start-change-ack": False,
    "toolchanger-fault": False,
    "toolchanger-reason": 0,
    "toolchanger-clear-fault": False,
}
"""What the changer drives, at power-on. Everything else it sees."""

Work = Literal["prepare", "change", "restore"]


@dataclass(frozen=True, slots=True)
class Later:
    """A level that comes by itself at a time."""

    at: float
    pin: str
    value: bool


@dataclass(frozen=True, slots=True)
class Under:
    """What the mechanics are doing, until when."""

    work: Work
    until: float
    pocket: int
    tool: int


class VirtualChanger:
    """Built running, with its e-stop chain closed."""

    def __init__(self, settings: ChangerSettings, *, now: float = 0.0) -> None:
        self.settings = settings
        self.magazine = Magazine(settings.magazine, settings.spindle, random=settings.random)
        self.prepared: int | None = None
        self.log: list[tuple[float, str]] = []
        self._now = now
        self._random = Random(settings.seed)
        self._seen: dict[str, bool | int] = {}
        self._drives = {**OUTPUTS, **settings.stuck}
        self._told: dict[str, bool | int] = {}
        self._under: Under | None = None
        self._later: list[Later] = []
        self._button = False
        self._fault_over_at: float | None = None

    # --- the verbs ------------------------------------------------------------------------------------------------

    def see(self, levels: Mapping[str, bool | int], now: float) -> None:
        """What the other end drives has changed, all at once."""
        self.handle_timer(now)
        before, self._seen = self._seen, {**self._seen, **levels}
        rose = {pin for pin in levels if self._seen[pin] and not before.get(pin)}
        fell = {pin for pin in levels if before.get(pin) and not self._seen[pin]}
        if "emc-abort" in rose:
            self._abort()
        if fell & {"tool-prepare", "tool-change"}:
            self._withdrawn(fell)
        for request, answer in (("emc-abort", "emc-abort-ack"), ("start-change", "start-change-ack")):
            if request in fell:
                self._set_later(answer, False)
        if "start-change" in rose:
            self._set_later("start-change-ack", True)
        if "tool-prepare" in rose:
            self._begin("prepare", self.settings.prepare_s)
        if "tool-change" in rose:
            self._begin("change", self.settings.change_s)
        if "toolchanger-fault-ack" in rose and self._drives["toolchanger-fault"]:
            self._fault_over_at = now + self._vary(self.settings.fault_s)
        if "user-request-enable" in rose and not self._button:  # the latch of the external chain
            self._set("emc-enable-in", True)

    def changes(self) -> dict[str, bool | int]:
        """The levels that have changed since the last call; at first all of them."""
        changed = {pin: value for pin, value in self._drives.items() if self._told.get(pin) != value or not self._told}
        self._told = dict(self._drives)
        return changed

    def connect(self) -> dict[str, bool | int]:
        """All levels, for a new connection."""
        self._told = dict(self._drives)
        return dict(self._drives)

    def next_timer(self) -> float | None:
        times = [later.at for later in self._later]
        times += [self._under.until] if self._under is not None else []
        times += [self._fault_over_at] if self._fault_over_at is not None else []
        return min(times, default=None)

    def handle_timer(self, now: float) -> None:
        """Everything that was to happen until now, in its order."""
        while (at := self.next_timer()) is not None and at <= now:
            self._now = at
            self._happen(at)
        self._now = now

    # --- what people do to it -------------------------------------------------------------------------------------

    def fault(self, reason: int, now: float) -> None:
        """A fault at any moment; what the mechanics were doing stops where it is, with the old tool in."""
        self.handle_timer(now)
        self._under = None
        self._fault(reason)

    def press_estop(self, now: float) -> None:
        """The button of the external chain; the mechanics stop."""
        self.handle_timer(now)
        self._button = True
        self._under = None
        self._set("emc-enable-in", False)

    def release_estop(self, now: float) -> None:
        """The button is pulled out; the chain closes with the next `user-request-enable`."""
        self.handle_timer(now)
        self._button = False

    def press_clear(self, now: float, *, down: bool = True) -> None:
        """The button for `toolchanger-clear-fault`."""
        self.handle_timer(now)
        self._set("toolchanger-clear-fault", down)

    # --- inside ---------------------------------------------------------------------------------------------------

    def _begin(self, work: Literal["prepare", "change"], seconds: float) -> None:
        if self._draw(self.settings.silence):
            self._note(f"{work}: no answer")
            return
        pocket, tool = int(self._seen.get("tool-prep-pocket", 0)), int(self._seen.get("tool-prep-number", 0))
        self._note(f"{work} tool {tool} of pocket {pocket}")
        self._under = Under(work, self._now + self._vary(seconds), pocket, tool)

    def _happen(self, at: float) -> None:
        """One thing whose time has come."""
        due = [later for later in self._later if later.at <= at]
        self._later = [later for later in self._later if later.at > at]
        for later in due:
            self._set(later.pin, later.value)
        if self._fault_over_at is not None and self._fault_over_at <= at:
            self._fault_over_at = None
            self._set("toolchanger-fault", False)
        under = self._under
        if under is not None and under.until <= at:
            self._under = None
            self._finish(under)

    def _finish(self, under: Under) -> None:
        match under.work:
            case "prepare":
                self._finish_prepare(under)
            case "change":
                self._finish_change(under)
            case "restore":
                self._acknowledge()

    def _finish_prepare(self, under: Under) -> None:
        if self._draw(self.settings.prepare_fault):
            self._fault(self._random.choice(self.settings.reasons))
        elif not self.magazine.holds(under.pocket, under.tool):
            self._fault(EMPTY_POCKET if under.pocket not in self.magazine.pockets else WRONG_TOOL)
        else:
            self.prepared = under.tool
            self._set("tool-prepared", True)

    def _finish_change(self, under: Under) -> None:
        if self._draw(self.settings.change_fault):
            self._fault(self._random.choice(self.settings.reasons))
        elif self.prepared != under.tool:
            self._fault(NOT_PREPARED)
        elif not self.magazine.load(under.pocket, under.tool):
            self._fault(EMPTY_POCKET)
        else:
            self._note(f"tool {under.tool} is in the spindle")
            self.prepared = None
            self._set("tool-changed", True)
            if self._draw(self.settings.both):
                self._fault(self._random.choice(self.settings.reasons))

    def _withdrawn(self, fell: set[str]) -> None:
        """A request has fallen: its answer falls too, and what is not begun in earnest is not done."""
        if "tool-prepare" in fell:
            self._set_later("tool-prepared", False)
        if "tool-change" in fell:
            self._set_later("tool-changed", False)
        under = self._under
        if under is not None and under.work in {pin.removeprefix("tool-") for pin in fell}:
            finishes = under.work == "change" and self.settings.on_abort == "finish"
            self._under = under if finishes else None

    def _abort(self) -> None:
        """A change in the middle is taken back before the abort is acknowledged: then both sides know the old tool."""
        under = self._under
        changing = under is not None and under.work == "change"
        if changing and self.settings.on_abort == "restore":
            self._note("the change is taken back")
            self._under = Under("restore", self._now + self._vary(self.settings.restore_s), 0, 0)
            return
        self._under = under if changing else None
        if self.settings.acknowledges_aborts:
            self._set_later("emc-abort-ack", True)

    def _acknowledge(self) -> None:
        if self.settings.acknowledges_aborts and self._seen.get("emc-abort"):
            self._set("emc-abort-ack", True)

    def _fault(self, reason: int) -> None:
        self._note(f"fault {reason}")
        self._set("toolchanger-reason", reason)
        self._set("toolchanger-fault", True)
        if self._seen.get("toolchanger-fault-ack"):  # the one before was never over
            self._fault_over_at = self._now + self._vary(self.settings.fault_s)

    def _set(self, pin: str, value: bool | int) -> None:
        if pin not in self.settings.stuck:
            self._drives[pin] = value

    def _set_later(self, pin: str, value: bool) -> None:
        """The last word on a pin counts: an answer that is to rise does not once its request has fallen."""
        self._later = [later for later in self._later if later.pin != pin]
        self._later.append(Later(self._now + self._vary(self.settings.answer_s), pin, value))

    def _vary(self, seconds: float) -> float:
        if not self.settings.jitter:
            return seconds
        return seconds * (1.0 + self.settings.jitter * self._random.uniform(-1.0, 1.0))

    def _draw(self, chance: float) -> bool:
        return bool(chance) and self._random.random() < chance

    def _note(self, text: str) -> None:
        self.log.append((self._now, text))
