"""The virtual changer as a PLC: what it answers to which pin, when, and what really happens."""

import pytest

from sim.changer.changer import OUTPUTS, VirtualChanger
from sim.changer.settings import EMPTY_POCKET, NOT_PREPARED, WRONG_TOOL, ChangerSettings

PREP_5 = {"tool-prep-number": 5, "tool-prep-pocket": 5, "tool-prepare": True}


def running(settings: ChangerSettings | None = None) -> VirtualChanger:
    changer = VirtualChanger(settings or ChangerSettings(), now=10.0)
    changer.changes()
    return changer


def run(changer: VirtualChanger, until: float) -> list[tuple[float, dict[str, bool | int]]]:
    """All that it says until then, each with its time."""
    said = []
    while (at := changer.next_timer()) is not None and at <= until:
        changer.handle_timer(at)
        if changed := changer.changes():
            said.append((round(at, 6), changed))
    return said


def prepared(settings: ChangerSettings | None = None) -> VirtualChanger:
    changer = running(settings)
    changer.see(PREP_5, 10.0)
    run(changer, 15.0)
    changer.see({"tool-prepare": False}, 15.0)
    run(changer, 16.0)
    assert changer.prepared == 5
    return changer


def test_at_power_on_it_says_everything() -> None:
    changer = VirtualChanger(ChangerSettings(stuck={"tool-changed": True}))
    assert changer.changes() == {**OUTPUTS, "tool-changed": True}
    assert changer.changes() == {}
    assert changer.connect() == {**OUTPUTS, "tool-changed": True}


def test_prepare_and_change() -> None:
    changer = running()
    changer.see(PREP_5, 10.0)
    assert run(changer, 20.0) == [(11.5, {"tool-prepared": True})]
    changer.see({"tool-prepare": False}, 20.0)
    assert run(changer, 21.0) == [(20.01, {"tool-prepared": False})]
    changer.see({"tool-change": True}, 21.0)
    assert changer.magazine.spindle == 0
    assert run(changer, 30.0) == [(24.0, {"tool-changed": True})]
    assert changer.magazine.spindle == 5
    changer.see({"tool-change": False, "tool-number": 5, "tool-prep-number": 0}, 30.0)
    assert run(changer, 31.0) == [(30.01, {"tool-changed": False})]
    assert [text for _, text in changer.log] == [
        "prepare tool 5 of pocket 5",
        "change tool 5 of pocket 5",
        "tool 5 is in the spindle",
    ]


def test_start_change_is_acknowledged() -> None:
    changer = running()
    changer.see({"start-change": True}, 10.0)
    assert run(changer, 11.0) == [(10.01, {"start-change-ack": True})]
    changer.see({"start-change": False}, 11.0)
    assert run(changer, 12.0) == [(11.01, {"start-change-ack": False})]


def test_an_abort_while_idle_or_preparing_is_acknowledged_at_once() -> None:
    changer = running()
    changer.see(PREP_5, 10.0)
    changer.see({"emc-abort": True, "tool-prepare": False}, 10.5)
    assert run(changer, 20.0) == [(10.51, {"emc-abort-ack": True})]
    assert changer.prepared is None
    changer.see({"emc-abort": False}, 20.0)
    assert run(changer, 21.0) == [(20.01, {"emc-abort-ack": False})]


def test_an_aborted_change_is_taken_back_and_then_acknowledged() -> None:
    changer = prepared()
    changer.see({"tool-change": True}, 20.0)
    changer.see({"emc-abort": True, "tool-change": False}, 21.0)
    assert run(changer, 30.0) == [(22.0, {"emc-abort-ack": True})]
    assert changer.magazine.spindle == 0


def test_a_stubborn_one_finishes_the_change_and_says_so_late() -> None:
    changer = prepared(ChangerSettings(on_abort="finish"))
    changer.see({"tool-change": True}, 20.0)
    changer.see({"emc-abort": True, "tool-change": False}, 21.0)
    assert run(changer, 30.0) == [(21.01, {"emc-abort-ack": True}), (23.0, {"tool-changed": True})]
    assert changer.magazine.spindle == 5


def test_one_that_never_acknowledges_stops_all_the_same() -> None:
    changer = running(ChangerSettings(acknowledges_aborts=False))
    changer.see(PREP_5, 10.0)
    changer.see({"emc-abort": True, "tool-prepare": False}, 10.5)
    assert run(changer, 20.0) == []


@pytest.mark.parametrize(
    ("pins", "reason"),
    [
        ({"tool-prep-number": 5, "tool-prep-pocket": 4}, WRONG_TOOL),
        ({"tool-prep-number": 5, "tool-prep-pocket": 40}, EMPTY_POCKET),
    ],
)
def test_a_pocket_without_the_tool_is_a_fault(pins: dict[str, int], reason: int) -> None:
    changer = running()
    changer.see({**pins, "tool-prepare": True}, 10.0)
    assert run(changer, 20.0) == [(11.5, {"toolchanger-fault": True, "toolchanger-reason": reason})]


def test_a_change_without_a_prepare_is_a_fault() -> None:
    changer = running()
    changer.see({"tool-prep-number": 5, "tool-prep-pocket": 5, "tool-change": True}, 10.0)
    assert run(changer, 20.0) == [(13.0, {"toolchanger-fault": True, "toolchanger-reason": NOT_PREPARED})]
    assert changer.magazine.spindle == 0


def test_a_fault_ends_some_time_after_it_was_acknowledged() -> None:
    changer = running()
    changer.fault(-7, 10.0)
    assert changer.changes() == {"toolchanger-fault": True, "toolchanger-reason": -7}
    assert run(changer, 100.0) == []
    changer.see({"toolchanger-fault-ack": True, "toolchanger-faulted": True}, 100.0)
    assert run(changer, 200.0) == [(100.5, {"toolchanger-fault": False})]
    changer.press_clear(200.0)
    assert changer.changes() == {"toolchanger-clear-fault": True}
    changer.press_clear(201.0, down=False)
    assert changer.changes() == {"toolchanger-clear-fault": False}


def test_the_chain_closes_with_the_pulse_once_the_button_is_out() -> None:
    changer = prepared()
    changer.see({"tool-change": True}, 20.0)
    changer.press_estop(21.0)
    assert changer.changes() == {"emc-enable-in": False}
    changer.see({"user-request-enable": True}, 22.0)
    changer.see({"user-request-enable": False}, 22.02)
    assert changer.changes() == {}
    changer.release_estop(23.0)
    assert changer.changes() == {}
    changer.see({"user-request-enable": True}, 24.0)
    assert changer.changes() == {"emc-enable-in": True}
    assert changer.magazine.spindle == 0


def test_faults_by_chance() -> None:
    changer = prepared(ChangerSettings(change_fault=1.0, reasons=(6,)))
    changer.see({"tool-change": True}, 20.0)
    assert run(changer, 30.0) == [(23.0, {"toolchanger-fault": True, "toolchanger-reason": 6})]
    assert changer.magazine.spindle == 0
    changer = prepared(ChangerSettings(both=1.0, reasons=(6,)))
    changer.see({"tool-change": True}, 20.0)
    assert run(changer, 30.0) == [(23.0, {"tool-changed": True, "toolchanger-fault": True, "toolchanger-reason": 6})]
    assert changer.magazine.spindle == 5
    changer = running(ChangerSettings(silence=1.0))
    changer.see(PREP_5, 10.0)
    assert run(changer, 1000.0) == []


def test_a_line_that_is_stuck_does_not_move() -> None:
    changer = running(ChangerSettings(stuck={"tool-prepared": False}))
    changer.see(PREP_5, 10.0)
    assert run(changer, 20.0) == []
    assert changer.prepared == 5


def test_the_same_seed_gives_the_same_changer() -> None:
    def life(seed: int) -> list[tuple[float, dict[str, bool | int]]]:
        changer = running(ChangerSettings(seed=seed, jitter=0.5, prepare_fault=0.3, silence=0.2))
        said = []
        for at in range(20, 200, 10):
            changer.see(PREP_5, float(at))
            said += run(changer, at + 5.0)
            changer.see({"tool-prepare": False}, at + 5.0)
            said += run(changer, at + 9.0)
        return said

    assert life(3) == life(3)
    assert life(3) != life(4)
    assert life(3)[0][0] != 21.5


@pytest.mark.parametrize(
    ("values", "text"),
    [({"silence": 1.5}, "chance"), ({"prepare_s": -1.0}, "time"), ({"reasons": ()}, "reasons")],
)
def test_what_no_changer_has_is_refused(values: dict[str, object], text: str) -> None:
    with pytest.raises(ValueError, match=text):
        ChangerSettings(**values)  # type: ignore[arg-type]
