"""What must always hold, whatever is asked, answered, lost or pressed in whichever order."""

from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    invariant,
    precondition,
    rule,
    run_state_machine_as_test,
)

from protocol.errors import LocalError
from protocol.iocontrol.config import AbortReason, IoConfig, Kind
from protocol.iocontrol.control import IoControl
from protocol.iocontrol.events import (
    AbortSignalled,
    ChangeFailed,
    ChangeStarted,
    Event,
    FaultLatched,
    OperatorMessage,
    PinChanged,
    PrepareFailed,
    SetToolFailed,
    TableChanged,
    ToolChanged,
    ToolPrepared,
    ToolSet,
    Transition,
)
from protocol.iocontrol.pins import JUMPERS
from protocol.iocontrol.tables import State
from protocol.iocontrol.view import ANSWERS
from tests.protocol.iocontrol.scene import RANDOM, TABLE

BITS = ("emc-enable-in", "tool-prepared", "tool-changed", "emc-abort-ack", "start-change-ack")
FAULTS = ("toolchanger-fault", "toolchanger-clear-fault")
TOOLS = st.sampled_from((0, 1, 5, 7, 6))
LEVELS = st.dictionaries(st.sampled_from((*BITS, *BITS, *FAULTS)), st.booleans(), max_size=4)
REQUEST_PINS = ("tool-prepare", "tool-change", "start-change")


class Block(RuleBasedStateMachine):
    """One block of any kind, under all verbs."""

    KINDS: tuple[Kind, ...] = ("manual", "external", "external", "external", "loopback", "none")

    @initialize(
        kind=st.sampled_from(range(6)),
        version=st.sampled_from((1, 2, 2, 2)),
        start=st.booleans(),
        timeout_s=st.sampled_from((0.0, 5.0)),
        table=st.sampled_from((None, TABLE, RANDOM)),
        jumpers=st.sampled_from((frozenset(), frozenset({"emc-abort-ack", "emc-enable-in"}))),
        start_in_estop=st.booleans(),
        always_ask=st.booleans(),
    )
    def begin(
        self, kind: int, version: Any, start: bool, timeout_s: float, table: Any, always_ask: bool, **others: Any
    ) -> None:
        self.config = IoConfig(
            kind=self.KINDS[kind],
            protocol_version=version,
            support_start_change=start and version == 2,
            prepare_timeout_s=timeout_s,
            change_timeout_s=timeout_s,
            ack_timeout_s=timeout_s,
            always_ask=always_ask and self.KINDS[kind] == "manual",
            **others,
        )
        self.now = 0.0
        self.io = IoControl(self.config, table, self.now)
        self.pins: dict[str, bool | int] = {pin.name: False if pin.type == "bit" else 0 for pin in self.io.pins()}
        self.regions: dict[str, str] = {}
        self.asked = {"T": 0, "M6": 0, "M61": 0}
        self.ended = {"T": 0, "M6": 0, "M61": 0}
        self.table = table
        self.step = 0
        self.prepared = False
        self.new: list[Event] = []
        self.take()

    # --- verbs ----------------------------------------------------------------------------------------------------

    def call(self, verb: Callable[..., None], *args: Any, **named: Any) -> None:
        self.now += 0.1
        verb(*args, self.now, **named)
        self.take()

    @rule(tool=TOOLS)
    def prepare(self, tool: int) -> None:
        self.asked["T"] += 1
        self.call(self.io.prepare, tool)

    @rule(whole=st.booleans())
    def change(self, whole: bool) -> None:
        pending = self.io.change_pending
        try:
            self.call(self.io.change if whole else self.io.start_change)
        except LocalError:
            assert pending
            return
        self.asked["M6"] += not pending

    @precondition(lambda self: self.io.state is State.IDLE and self.io.connected and not self.io.may_fail)
    @rule(tool=TOOLS, again=st.booleans())
    def come_to_a_change(self, tool: int, again: bool) -> None:
        """T, prepared, M6: single steps rarely get so far. `again`: and a second M6 behind it, without a T."""
        self.asked["T"] += 1
        self.call(self.io.prepare, tool)
        self.answer(dict.fromkeys(ANSWERS.values(), False), None)
        for _ in range(1 + again):
            self.answer_rightly()
            self.change(whole=True)

    @precondition(lambda self: self.io.state is State.CHANGING and self.io.connected)
    @rule(done=st.booleans(), reason=st.sampled_from((-5, 0, 5)))
    def fault_in_a_change(self, done: bool, reason: int) -> None:
        self.answer({"tool-changed": done, "toolchanger-fault": True}, reason)

    @rule(tool=TOOLS)
    def set_tool(self, tool: int) -> None:
        self.asked["M61"] += 1
        self.call(self.io.set_tool, tool)

    @precondition(lambda self: self.regions.get("connection") != "lost")
    @rule(levels=LEVELS, reason=st.sampled_from((None, -5, 0, 5)))
    def answer(self, levels: dict[str, bool], reason: int | None) -> None:
        self.call(self.io.set_inputs, self.possible(levels, reason))

    @precondition(lambda self: self.regions.get("connection") != "lost")
    @rule()
    def answer_rightly(self) -> None:
        """What a good changer would say now: random levels alone rarely come to a change."""
        levels = {pin: bool(self.pins.get(JUMPERS[pin])) for pin in ANSWERS.values()}
        self.call(self.io.set_inputs, self.possible({**levels, "emc-enable-in": True}, None))

    @precondition(lambda self: self.config.kind == "external")
    @rule(levels=LEVELS)
    def connect(self, levels: dict[str, bool]) -> None:
        self.call(self.io.connect, self.possible(levels, None))

    @rule()
    def disconnect(self) -> None:
        self.call(self.io.disconnect)
        if self.config.kind == "external":
            # What was asked since the connection was lost waits for it; a second loss changes nothing.
            waits = self.io.waiting_for.what in ("verdict", "connection")
            assert not self.io.may_fail or waits or self.io.state is State.ABORTING

    @rule(reason=st.sampled_from(AbortReason))
    def abort(self, reason: AbortReason) -> None:
        up = self.pins.get("emc-abort", False)
        self.call(self.io.abort, reason)
        assert AbortSignalled(int(reason)) in self.new
        rose = any(
            isinstance(event, PinChanged) and (event.pin, event.value) == ("emc-abort", True) for event in self.new
        )
        assert up or rose or self.config.protocol_version == 1
        assert not any(self.pins[pin] for pin in REQUEST_PINS if pin in self.pins)

    @rule(kind=st.sampled_from(("user", "external")))
    def estop(self, kind: Any) -> None:
        self.call(self.io.estop, kind)
        assert not self.io.motion_allowed

    @rule()
    def estop_reset(self) -> None:
        self.call(self.io.estop_reset)

    @rule(flood=st.sampled_from((None, False, True)), mist=st.sampled_from((None, False, True)))
    def coolant(self, flood: bool | None, mist: bool | None) -> None:
        self.call(self.io.coolant, flood=flood, mist=mist)

    @precondition(lambda self: self.io.may_confirm)
    @rule()
    def confirm(self) -> None:
        self.call(self.io.confirm)

    @precondition(lambda self: self.io.may_fail)
    @rule()
    def fail(self) -> None:
        self.call(self.io.fail)
        assert not self.io.change_pending

    @precondition(lambda self: self.io.may_clear_fault)
    @rule()
    def clear_fault(self) -> None:
        self.call(self.io.clear_fault)
        assert not self.io.faulted

    @precondition(lambda self: self.io.next_timer() is not None)
    @rule()
    def time_passes(self) -> None:
        self.now = max(self.now, self.io.next_timer() or 0.0)
        self.call(self.io.handle_timer)

    # --- what came of it ------------------------------------------------------------------------------------------

    def possible(self, levels: dict[str, bool], reason: int | None) -> dict[str, bool | int]:
        inputs = {pin: value for pin, value in levels.items() if pin in self.io.drivable}
        if reason is not None and "toolchanger-reason" in self.io.drivable:
            return {**inputs, "toolchanger-reason": reason}
        return inputs

    def take(self) -> None:
        self.new = []
        while (event := self.io.next_event()) is not None:
            self.new.append(event)
        for event in self.new:
            match event:
                case PinChanged():
                    assert self.pins[event.pin] != event.value
                    assert event.step >= self.step
                    assert event.at == self.now
                    self.pins[event.pin], self.step = event.value, event.step
                    if event.value is True:
                        self.request_rose(event.pin)
                    if event.pin == "tool-number":
                        self.number_changed(event.value)
                case Transition():
                    assert self.regions.setdefault(event.region, event.before) == event.before
                    self.regions[event.region] = event.after
                case ToolPrepared() | PrepareFailed():
                    self.ended["T"] += 1
                    self.prepared |= isinstance(event, ToolPrepared)
                case ToolChanged() | ChangeFailed():
                    self.ended["M6"] += 1
                    self.prepared &= isinstance(event, ChangeFailed)
                case ToolSet() | SetToolFailed():
                    self.ended["M61"] += 1
                case TableChanged():
                    assert sorted(tool.pocket for tool in event.table.tools) == sorted(
                        tool.pocket for tool in self.table.tools
                    )
                    self.table = event.table
                case ChangeStarted():
                    assert self.config.support_start_change is False or self.pins["start-change"] is False
        self.ends_without_going_on_are_signalled()
        self.an_abort_reaches_emc_abort()

    def request_rose(self, pin: str) -> None:
        """Also where a level answers it in the same verb, and nothing of it is left to be seen behind."""
        if pin == "tool-prepare":
            self.prepared = False
        if pin == "tool-change":
            assert self.prepared

    def number_changed(self, value: bool | int) -> None:
        """Only with a commit, M61, the start, or when it is not known any more."""
        committed = [event.number for event in self.new if isinstance(event, ToolSet)]
        committed += [event.number for event in self.new if isinstance(event, ToolChanged) and not event.skipped]
        doubted = [event for event in self.new if isinstance(event, FaultLatched | PrepareFailed | ChangeFailed)]
        assert value in committed or (value == -1 and doubted) or self.now == 0.0

    def an_abort_reaches_emc_abort(self) -> None:
        """Whoever aborts, for whatever reason: the changer has seen it rise, or it is up still; its reason is set."""
        signalled = [event.reason for event in self.new if isinstance(event, AbortSignalled)]
        if not signalled or "emc-abort" not in self.pins:
            return
        moved = any(isinstance(event, PinChanged) and event.pin == "emc-abort" for event in self.new)
        assert moved or self.pins["emc-abort"], "it has risen now, is up still, or was and is acknowledged"
        assert self.pins["emc-reason"] in (signalled[-1], AbortReason.TOOLCHANGER_FAULT)

    def ends_without_going_on_are_signalled(self) -> None:
        for event in self.new:
            if isinstance(event, PrepareFailed | ChangeFailed) and not event.goes_on:
                signalled = any(isinstance(other, AbortSignalled) for other in self.new)
                assert signalled or event.cause == "estop"
                if event.cause == "fault" and event.reason == 0:
                    assert not any(
                        isinstance(other, OperatorMessage) and other.text == event.message for other in self.new
                    )

    # --- invariants -----------------------------------------------------------------------------------------------

    @invariant()
    def the_events_tell_all_pins(self) -> None:
        assert {pin.name: pin.value for pin in self.io.pins()} == self.pins

    @invariant()
    def one_request_at_a_time_and_its_line_tells_the_state(self) -> None:
        state = self.io.state
        assert self.pins["tool-prepare"] == (state is State.PREPARING)
        assert self.pins["tool-change"] == (state is State.CHANGING)
        assert self.pins.get("start-change", False) == (state is State.STARTING)
        assert self.pins.get("emc-abort", False) == (state is State.ABORTING)

    @invariant()
    def tool_change_only_with_a_prepared_tool_that_is_not_in_the_spindle(self) -> None:
        if self.pins["tool-change"]:
            assert self.io.prepared is not None
            asked_again = self.config.always_ask or not self.io.tool_certain
            assert self.io.prepared != self.io.tool or (self.config.kind == "manual" and asked_again)
            assert self.pins["tool-prep-number"] == self.io.prepared

    @invariant()
    def nothing_moves_while_a_change_is_pending(self) -> None:
        if self.io.change_pending or self.pins["tool-change"] or self.io.estop_state.name != "ENABLED":
            assert not self.io.motion_allowed
        if self.io.change_moves_allowed:
            assert self.io.state is State.MOVING
            assert not any(self.pins[pin] for pin in REQUEST_PINS if pin in self.pins)

    @invariant()
    def in_doubt_nobody_knows_the_tool(self) -> None:
        assert (self.pins["tool-number"] == -1) == (self.io.tool is None)
        if self.io.waiting_for.what == "verdict":
            assert self.io.tool is None
        if self.io.tool is None:
            assert self.io.start_refusal is not None

    @invariant()
    def an_estop_leaves_nothing_on(self) -> None:
        if self.io.estop_state.name != "ENABLED":
            assert not any(self.pins[pin] for pin in ("coolant-flood", "coolant-mist", "tool-prepare", "tool-change"))
            assert self.io.start_refusal is not None

    @invariant()
    def nothing_waits_unseen(self) -> None:
        waiting = self.io.waiting_for
        if self.io.state is State.IDLE and self.io.connected:
            assert waiting.what is None
            return
        assert waiting.what is not None
        if waiting.what in ("position", "verdict"):
            return  # the machine's link watches the one, people were told of the other
        if waiting.deadline_at is None and not waiting.overdue:
            assert self.config.ack_timeout_s == 0.0
        if waiting.deadline_at is not None:
            assert self.io.next_timer() is not None

    @invariant()
    def every_level_has_had_its_effect(self) -> None:
        answer = ANSWERS.get(self.io.state)
        if answer is not None and self.io.connected:
            assert not self.pins.get(answer)
        for pin, output in JUMPERS.items():
            if pin not in self.io.drivable and pin in self.pins:
                assert self.pins[pin] == self.pins[output]

    @invariant()
    def every_request_ends_once(self) -> None:
        assert self.ended["M61"] == self.asked["M61"]
        assert 0 <= self.asked["T"] - self.ended["T"] <= 3
        assert self.asked["M6"] - self.ended["M6"] == self.io.change_pending
        if not self.io.may_fail:  # nothing is open
            assert self.asked["T"] == self.ended["T"]

    @invariant()
    def the_parameters_tell_the_latch(self) -> None:
        assert self.io.parameters[5060] == self.io.parameters[5600] == float(self.io.faulted)
        assert self.pins.get("toolchanger-faulted", False) == self.io.faulted
        if not self.io.faulted:
            assert self.io.parameters[5601] == 0.0


@pytest.mark.slow
def test_whatever_comes_in_whichever_order() -> None:
    run_state_machine_as_test(  # type: ignore[no-untyped-call]
        Block,
        settings=settings(
            max_examples=100, stateful_step_count=25, deadline=None, suppress_health_check=list(HealthCheck)
        ),
    )
