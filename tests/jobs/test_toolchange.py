"""The dialogue of a job with its tool changer as a table: every way, every state, and nothing out of turn."""

import pytest

from jobs.toolchange import TABLE, Phase, Step, ToolChange


@pytest.mark.parametrize("phase", Phase)
@pytest.mark.parametrize("step", Step)
def test_it_goes_on_only_along_the_table(phase: Phase, step: Step) -> None:
    change = ToolChange(phase)
    after = TABLE.get((phase, step))
    assert change.go(step) == (after is not None)
    assert change.phase is (after or phase)


def test_a_change_from_its_beginning_to_its_end() -> None:
    change = ToolChange()
    phases = []
    for step in (Step.ASKED, Step.STARTED, Step.ARRIVED, Step.ENDED):
        assert change.go(step)
        phases.append(change.phase)
    assert phases == [Phase.STARTING, Phase.READY, Phase.CHANGING, Phase.NONE]


def test_the_machine_never_moves_for_a_change_that_has_not_begun() -> None:
    assert [before for (before, step), after in TABLE.items() if after is Phase.READY] == [Phase.STARTING]


def test_every_open_change_can_end() -> None:
    assert {before for (before, step) in TABLE if step is Step.ENDED} == set(Phase) - {Phase.NONE}
    assert all(after is Phase.NONE for (_, step), after in TABLE.items() if step is Step.ENDED)


def test_every_phase_is_reached() -> None:
    assert set(TABLE.values()) == set(Phase)
