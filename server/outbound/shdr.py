"""A machine as data items of MTConnect, and as lines of SHDR, the protocol between adapter and agent. Pure.

Not the sockets (mtconnect.py), not the model that an agent reads (devicemodel.py). The words are the standard's:
EXECUTION, CONTROLLER_MODE, EMERGENCY_STOP, conditions. The one rule: what a machine or a file says can neither end a
field nor a line; what is not known is UNAVAILABLE, never a guess.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from server.outbound.feed import Notice

UNAVAILABLE = "UNAVAILABLE"
MOST_TEXT_CHARS = 512
MOST = 1e15
"""No machine is there, and a reader of ours may not have the word for it (inf, nan)."""
HEARTBEAT_MS = 10_000
"""An agent that has heard this asks again so often, and gives the adapter up after twice the time."""
PING, PONG = b"* PING", f"* PONG {HEARTBEAT_MS}\n".encode()

_HOLDS_THE_MACHINE = frozenset({"running", "paused", "waiting"})


@dataclass(frozen=True, slots=True)
class Condition:
    """A condition of the standard: `level` NORMAL, WARNING, FAULT or UNAVAILABLE."""

    level: str
    code: str = ""
    text: str = ""


NORMAL, UNKNOWN = Condition("NORMAL"), Condition(UNAVAILABLE)
Value = str | Condition


@dataclass(frozen=True, slots=True)
class Device:
    """What is known of one machine: a state and a job as in api.md. `axes`: those that the agent's model has."""

    axes: str = "xyz"
    state: Mapping[str, Any] = field(default_factory=dict)
    job: Mapping[str, Any] = field(default_factory=dict)

    def told(self, notice: Notice) -> "Device":
        """The device after a message of the hub."""
        match notice.type:
            case "state":
                # How things stand begins with the state; a job follows if there still is one.
                over = notice.fresh and self._has_job
                return replace(self, state=notice.data, job={} if over else self.job)
            case "job" if self._is_mine(notice.data):
                return replace(self, job=notice.data)
            case _:
                return self

    def _is_mine(self, job: Mapping[str, Any]) -> bool:
        """Whether it is the job that has the machine, and not one that waits for it or is read meanwhile."""
        if job.get("id") == self.job.get("id"):
            return True
        return job.get("status") in (*_HOLDS_THE_MACHINE, "interrupted", "failed")

    # --- items ------------------------------------------------------------------------------------------------

    def items(self, *, emergency: bool) -> dict[str, Value]:
        """Every data item by its name. `emergency`: an emergency stop is pressed, or demanded and not confirmed."""
        if self.state.get("link") != "connected":
            return self._absent()
        state, overrides = self.state, self.state.get("overrides") or {}
        tool = state.get("tool")
        return {
            "avail": "AVAILABLE",
            "estop": "TRIGGERED" if emergency else "ARMED",
            "mode": self._mode(),
            "execution": self._execution(),
            "program": _text(self._program()),
            "line": _number((self.job.get("progress") or {}).get("line") if self._has_job else None),
            "Fact": _number(state.get("feed")),
            "Fovr": _number(overrides.get("feed")),
            "Frapidovr": _number(overrides.get("rapid")),
            "Sspeed": _number(state.get("spindle")),
            "Sovr": _number(overrides.get("spindle")),
            "tool": _number(tool),
            **self._positions(),
            "system": self._system(),
            "motion": self._motion(),
            "comms": NORMAL,
        }

    def _absent(self) -> dict[str, Value]:
        wanted = self.state.get("link") == "connecting"
        comms = Condition("FAULT", "link", "The link to the controller is down.") if wanted else UNKNOWN
        events = ("avail", "estop", "mode", "execution", "program", "line", "tool")
        samples = ("Fact", "Fovr", "Frapidovr", "Sspeed", "Sovr")
        return {
            **dict.fromkeys((*events, *samples), UNAVAILABLE),
            **{name: UNAVAILABLE for axis in self.axes for name in axis_items(axis)},
            "system": UNKNOWN,
            "motion": self._motion(),
            "comms": comms,
        }

    def _positions(self) -> dict[str, Value]:
        position = self.state.get("position") or {}
        at = [position.get("machine") or {}, position.get("work") or {}]
        return {name: _number(at[i].get(axis)) for axis in self.axes for i, name in enumerate(axis_items(axis))}

    @property
    def _has_job(self) -> bool:
        return self.job.get("status") in _HOLDS_THE_MACHINE

    def _program(self) -> object:
        return (self.job.get("program_name") or UNAVAILABLE) if self._has_job else UNAVAILABLE

    def _mode(self) -> str:
        """CONTROLLER_MODE: a job is AUTOMATIC; blocks by hand MANUAL_DATA_INPUT; the rest, and rest, MANUAL."""
        if self._has_job:
            return "AUTOMATIC"
        return "MANUAL_DATA_INPUT" if self.state.get("status") == "run" else "MANUAL"

    def _execution(self) -> str:
        status = self.state.get("status")
        if status in _EXECUTION_BY_STATE:
            return _EXECUTION_BY_STATE[status]
        if self._has_job:
            return _EXECUTION_BY_JOB[self.job["status"]]
        return "ACTIVE" if status in ("run", "jog", "home") else "READY"

    # --- conditions -------------------------------------------------------------------------------------------

    def _system(self) -> Condition:
        alarm = self.state.get("alarm")
        if alarm is None:
            return Condition("FAULT", "alarm", "The machine is in alarm.") if self._in_alarm else NORMAL
        code = alarm.get("code")
        return Condition("FAULT", "alarm" if code is None else str(code), str(alarm.get("message") or ""))

    @property
    def _in_alarm(self) -> bool:
        return self.state.get("status") == "alarm"

    def _motion(self) -> Condition:
        """Of the program: until another job runs, the last one is what is told."""
        error = self.job.get("error") or {}
        code, text = str(error.get("code") or ""), str(error.get("message") or "")
        match self.job.get("status"):
            case "failed":
                return Condition("FAULT", code or "failed", text)
            case "interrupted":
                return Condition("FAULT", code or "interrupted", text)
            case "paused" if code:
                return Condition("WARNING", code, text)
            case _:
                return NORMAL


# PROGRAM_STOPPED is the program's own stop, FEED_HOLD that of the axes, INTERRUPTED anybody's from outside; STOPPED
# cannot go on as it is.
_EXECUTION_BY_STATE: Mapping[object, str] = {
    "alarm": "STOPPED",
    "sleep": "STOPPED",
    "hold": "FEED_HOLD",
    "door": "INTERRUPTED",
    "tool": "PROGRAM_STOPPED",
}
_EXECUTION_BY_JOB: Mapping[str, str] = {"running": "ACTIVE", "paused": "INTERRUPTED", "waiting": "PROGRAM_STOPPED"}


def axis_items(axis: str) -> tuple[str, str]:
    """The names of its two items: in machine coordinates, in those of the program."""
    return f"{axis.upper()}act", f"{axis.upper()}work"


def _number(value: object) -> str:
    return f"{value + 0.0:.10g}" if isinstance(value, int | float) and abs(value) < MOST else UNAVAILABLE


def _text(value: object) -> str:
    return str(value)[:MOST_TEXT_CHARS]


# --- lines ----------------------------------------------------------------------------------------------------


def lines(prefix: str, at: str, before: Mapping[str, Value], after: Mapping[str, Value]) -> Iterator[str]:
    """The lines that say what has changed. Values of one moment share a line, each condition has its own."""
    changed = {name: value for name, value in after.items() if before.get(name) != value}
    simple = [part for name, value in changed.items() if isinstance(value, str) for part in (prefix + name, value)]
    if simple:
        yield "|".join([at, *map(escaped, simple)]) + "\n"
    for name, value in changed.items():
        if not isinstance(value, Condition):
            continue
        earlier = before.get(name)
        if isinstance(earlier, Condition) and earlier.code and value.code:
            # Faults of several codes stand beside each other: the earlier one has to be taken back.
            yield _condition_line(at, prefix + name, NORMAL)
        yield _condition_line(at, prefix + name, value)


def _condition_line(at: str, name: str, condition: Condition) -> str:
    fields = (at, name, condition.level, condition.code, "", "", condition.text)
    return "|".join(map(escaped, fields)) + "\n"


def escaped(text: str) -> str:
    """A field. Quotes are made single and a text with a bar is quoted, its bars escaped, for the agent reads it so."""
    plain = " ".join("".join(char if char.isprintable() else " " for char in text[:MOST_TEXT_CHARS]).split())
    plain = plain.replace('"', "'")
    if "|" not in plain:
        return plain
    return '"' + plain.replace("\\", "/").replace("|", "\\|") + '"'
