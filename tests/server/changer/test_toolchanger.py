"""The tool changer of a machine by itself: what is refused, what the job hears, what is kept and what is written down.

The block behind it is the real one; time goes on by hand. Whole daemons are in tests/scenarios.
"""

import asyncio
from collections.abc import Callable
from typing import Any

import pytest

from jobs.job import Status
from jobs.toolstore import KeptTools
from protocol.iocontrol.config import AbortReason
from server.problems import ProblemError
from tests.harness.changerplace import CONNECTED, Place, external


def refusal(work: Callable[[], Any]) -> tuple[str, str]:
    with pytest.raises(ProblemError) as refused:
        work()
    return refused.value.code, refused.value.detail


def test_a_person_confirms_and_the_job_hears_that_it_was_a_person() -> None:
    place = Place()
    place.wanted()
    assert place.heard == ["started", "kept"]
    (asked,) = place.told("tool")
    assert (asked["tool"], asked["waiting_for"]) == (5, "operator")
    place.changer.confirm()
    assert place.heard[2:] == ["changed by a person", "free"]
    assert place.of("tool_confirmed") == [{"tool": 5}]
    assert (place.tools_told, place.kept) == ([5], [KeptTools(5)])


def test_what_is_a_fact_is_kept_before_the_job_hears_of_it() -> None:
    place = Place()
    order: list[str] = []
    place.post = lambda *_: order.append("kept")  # type: ignore[method-assign]
    place.tool_changed = lambda **_: order.append("heard")  # type: ignore[method-assign]
    place.wanted()
    place.changer.confirm()
    assert order == ["kept", "heard"]


def test_what_nobody_waits_for_is_refused() -> None:
    changer = Place().changer
    assert refusal(changer.confirm) == ("wrong_state", "router does not wait for a tool.")
    assert refusal(changer.fail) == ("wrong_state", "No tool is being changed on router.")
    assert refusal(changer.clear_fault)[0] == "wrong_state"
    assert "there is none" in refusal(changer.clear_fault)[1]


def test_a_fault_that_is_still_there_is_not_cleared() -> None:
    place = external()
    place.changer.drive({"toolchanger-reason": -3, "toolchanger-fault": True})
    assert "the changer still has it" in refusal(place.changer.clear_fault)[1]
    place.changer.drive({"toolchanger-fault": False})
    assert place.kept[-1] == KeptTools(0, None, -3)
    place.changer.clear_fault()
    assert place.kept[-1] == KeptTools()
    assert place.of("tool_fault_cleared") == [{"by": "operator"}]


def test_the_tool_is_not_set_while_one_is_changed_nor_to_one_that_is_not_there() -> None:
    place = Place()
    place.wanted()
    assert refusal(lambda: place.changer.set_tool(3))[0] == "wrong_state"
    place.changer.confirm()
    place.changer.replace_table("T3 P3\n", None)
    assert refusal(lambda: place.changer.set_tool(4))[0] == "invalid_request"
    place.changer.set_tool(3)
    assert (place.changer.io.tool, place.kept[-1].tool, place.tools_told[-1]) == (3, 3, 3)


def test_levels_that_do_not_exist_are_a_wrong_request_and_the_others_a_refusal() -> None:
    place = external()
    for levels, code in (
        ({"nonsense": True}, "invalid_request"),
        ({"tool-changed": 3}, "invalid_request"),
        ({"tool-change": True}, "wrong_state"),
    ):
        assert refusal(lambda levels=levels: place.changer.drive(levels))[0] == code  # type: ignore[misc]
    assert not place.changer.io.faulted


def test_the_first_words_of_a_connection_are_all_levels_and_its_end_is_the_changers() -> None:
    place = Place(kind="external", start_in_estop=False)
    one, other = object(), object()
    place.changer.drive({**CONNECTED, "tool-prepared": True}, by=one)
    assert place.changer.io.connected
    place.changer.leave(other)
    assert place.changer.io.connected, "that was somebody else"
    place.changer.leave(one)
    assert not place.changer.io.connected
    assert place.of("tool_fault") == [{"reason": -1000}]
    assert refusal(lambda: place.changer.drive({"tool-changed": True}))[0] == "wrong_state"
    place.changer.drive(CONNECTED, by=other)
    pins = {pin.name: pin.value for pin in place.changer.io.pins()}
    assert (pins["tool-prepared"], place.changer.io.connected) == (False, True)


def test_a_connection_that_the_ending_daemon_closes_is_not_lost() -> None:
    place = Place(kind="external", start_in_estop=False)
    one = object()
    place.changer.drive(CONNECTED, by=one)
    place.changer.say_farewell()
    place.changer.leave(one)
    assert (place.of("tool_fault"), place.changer.io.faulted) == ([], False)


@pytest.mark.parametrize(
    ("status", "code", "reason"),
    [
        (Status.CANCELLED, "", AbortReason.USER),
        (Status.FAILED, "alarm", AbortReason.MOTION_OR_IO_ERROR),
        (Status.FAILED, "no_tool_word", AbortReason.TASK_EXEC_ERROR),
        (Status.INTERRUPTED, "link_lost", AbortReason.TASK_EXEC_ERROR),
        (Status.FAILED, "estop", None),
        (Status.COMPLETED, "", None),
    ],
)
def test_the_end_of_a_job_is_told_to_the_changer(status: Status, code: str, reason: AbortReason | None) -> None:
    place = external()
    before = len(place.of("tool_abort"))
    place.changer.job_ended(status, code)
    assert place.of("tool_abort")[before:] == ([] if reason is None else [{"reason": int(reason)}])


def test_an_alarm_of_the_emergency_button_is_reason_2() -> None:
    place = external()
    place.changer.emergency = lambda: True
    place.changer.job_ended(Status.FAILED, "alarm")
    assert place.of("tool_abort")[-1] == {"reason": 2}


def test_what_the_changer_has_aborted_is_not_aborted_twice() -> None:
    place = external()
    place.ask("prepare", 5)
    place.changer.drive({"tool-prepared": True})
    for what in ("start", "change"):
        place.ask(what, 5)
    place.changer.drive({"toolchanger-reason": -2, "toolchanger-fault": True})
    aborts = place.of("tool_abort")
    assert aborts[-1] == {"reason": 101}
    place.changer.job_ended(Status.FAILED, "tool_change_failed")
    assert place.of("tool_abort") == aborts
    place.changer.job_ended(Status.FAILED, "tool_change_failed")
    assert place.of("tool_abort") != aborts, "the next one is another"


def test_a_late_changer_is_told_to_job_and_people() -> None:
    place = external(prepare_timeout=2.0)
    place.ask("prepare", 5)
    assert place.told("tool") == []
    place.clock.pass_time()
    assert place.clock.now_s == 2.0
    assert place.heard == ["late"]
    assert (place.told("tool")[0]["waiting_for"], place.told("tool")[0]["overdue"]) == ("tool-prepared", True)
    assert "tool-prepared" in place.of("tool_message")[-1]["message"]
    assert place.told("log")[-1]["level"] == "error"


def test_the_external_chain_stops_the_machine_and_a_person_at_the_daemon_does_not_do_so_twice() -> None:
    place = external()
    place.changer.drive({"emc-enable-in": False})
    assert (place.stops, place.of("tool_estop")) == (1, [{"by": "external"}])
    place = external()
    place.changer.estop()
    assert (place.stops, place.of("tool_estop")) == (0, [{"by": "user"}])
    assert place.changer.stopped
    assert place.changer.estop_reset()
    assert not place.changer.stopped
    assert not place.changer.estop_reset(), "there is none any more"


def test_a_tool_that_was_asked_for_is_asked_for_again_when_the_changer_can_be_asked() -> None:
    place = Place(kind="external", start_in_estop=False)
    place.ask("again", 5)
    assert not place.changer.io.may_fail
    place.changer.drive(CONNECTED)
    assert not place.changer.io.may_fail, "the start is not acknowledged"
    place.changer.drive({"emc-abort-ack": True})
    assert place.changer.io.waiting_for.what == "tool-prepared"


def test_a_person_may_give_up_a_tool_that_nobody_could_be_asked_for() -> None:
    place = Place(kind="external", start_in_estop=False)
    place.ask("again", 5)
    place.changer.fail()
    assert place.heard[-1].startswith("failed: the operator says")
    assert refusal(place.changer.fail)[0] == "wrong_state"


def test_a_machine_that_wants_a_tool_by_itself() -> None:
    place = Place()
    assert place.changer.open(4)
    assert place.changer.io.waiting_for.tool == 4
    assert not place.changer.open(5), "one at a time"
    assert not Place(kind="none").changer.open(4)
    assert not Place(kind="external").changer.open(4), "it is in an e-stop"


@pytest.mark.parametrize(
    ("block", "turret", "certain", "tool"),
    [
        ("G1 X1", False, True, 5),
        ("M6", False, False, 5),
        ("T2", False, True, 5),
        ("T2", True, False, 5),
        ("M61 Q7", False, True, 7),
    ],
)
def test_a_block_that_was_typed_may_have_brought_another_tool(
    block: str, turret: bool, certain: bool, tool: int
) -> None:
    place = Place()
    place.changer.set_tool(5)
    place.changer.typed(block, turret=turret)
    assert (place.changer.io.tool_certain, place.changer.io.tool) == (certain, tool)
    assert bool(place.of("tool_by_hand")) == (not certain)


def test_coolant_that_was_typed_where_the_codes_mean_that() -> None:
    for codes, on in ((frozenset({7, 8, 9}), True), (frozenset[int](), False)):
        place = Place()
        place.changer.coolant_codes = codes
        place.changer.typed("G1 X1 M8", turret=False)
        assert bool(place.of("io_pins")[-1]["pins"] == [["coolant-flood", True]]) == on
        place.changer.typed("M30", turret=False)
        pins = {pin.name: pin.value for pin in place.changer.io.pins()}
        assert not pins["coolant-flood"]


def test_a_block_of_a_dialogue_that_is_open_changes_nothing() -> None:
    place = Place()
    place.changer.open(4)
    place.changer.typed("T4 M6", turret=False)
    assert place.of("tool_by_hand") == []


def test_every_change_of_a_pin_is_written_down_and_told_step_by_step() -> None:
    place = external()
    place.notes.clear()
    place.published.clear()
    place.ask("prepare", 5)
    place.changer.drive({"tool-prepared": True})
    steps = [[name for name, _ in data["pins"]] for data in place.of("io_pins")]
    assert steps == [
        ["tool-prep-number", "tool-prep-pocket", "tool-prep-index", "tool-prepare", "state"],
        ["tool-prepared"],
        ["tool-prepare", "state"],
    ]
    assert [list(data["pins"]) for data in place.told("io")] == steps
    assert [(data["before"], data["after"]) for data in place.of("io")] == [
        ("idle", "preparing"),
        ("preparing", "idle"),
    ]


def test_what_has_no_effect_is_written_down() -> None:
    place = external()
    place.changer.drive({"tool-changed": True})
    (ignored,) = place.of("tool_answer_ignored")
    assert ignored["pin"] == "tool-changed"
    place.changer.estop()
    place.ask("coolant", 8)
    (request,) = place.of("tool_request_ignored")
    assert request["what"] == "coolant"


@pytest.mark.parametrize(
    ("codes", "pins"),
    [
        ((7,), {"coolant-mist"}),
        ((8, 7), {"coolant-flood", "coolant-mist"}),
        ((7, 8, 9), set()),
        ((7, 8, -7), {"coolant-flood"}),
        ((7, 8, -8), {"coolant-mist"}),
    ],
)
def test_coolant(codes: tuple[int, ...], pins: set[str]) -> None:
    place = external()
    for code in codes:
        place.ask("coolant", code)
    assert {pin.name for pin in place.changer.io.pins() if pin.name.startswith("coolant") and pin.value} == pins


def test_a_random_table_is_kept_after_each_change() -> None:
    place = Place(kind="loopback", random=True)
    place.changer.replace_table("T0 P0\nT5 P3\n", None)
    place.wanted(5)
    kept = place.kept[-1]
    assert (kept.tool, kept.table) == (5, "T0 P3\nT5 P0\n")
    again = Place(kind="loopback", random=True, kept=kept)
    assert (again.changer.io.tool, again.changer.known_tools) == (5, frozenset({0, 5}))


def test_a_table_is_not_taken_from_under_a_tool_that_is_being_changed() -> None:
    place = Place()
    place.wanted()
    assert refusal(lambda: place.changer.replace_table("T1 P1\n", None))[0] == "wrong_state"
    place.changer.confirm()
    assert place.changer.known_tools is None
    place.changer.replace_table("T1 P1\n", None)
    assert place.changer.known_tools == frozenset({0, 1})
    assert place.of("tool_table") == [{"tools": 1}]


def test_a_daemon_that_ends_tells_the_changer_and_not_the_job() -> None:
    place = external()
    place.active_job = 3
    place.ask("prepare", 5)
    place.changer.close()
    assert place.of("tool_abort")[-1] == {"reason": 4}
    assert not [text for text in place.heard if text.startswith("failed")]
    assert place.clock.due is None


def test_what_happened_is_read_from_the_history() -> None:
    place = Place()

    async def run(fn: Any, *args: Any, **named: Any) -> list[str]:
        return [fn.__name__, *map(str, args), *map(str, named.values())]

    place.read = run  # type: ignore[attr-defined]
    events: Any = asyncio.run(place.changer.events(after=4))
    assert events == ["of_tools", "router", "10000", "4"]
