"""The table of phases: complete, and the page in docs/ made from it."""

import runpy
import sys
from pathlib import Path

import pytest

from protocol.grbl.phases import GATES, OUTCOMES, STEPS, Phase, page
from protocol.grbl.traffic import SHUT_BY

PAGE = Path(__file__).parents[3] / "docs" / "grbl-phases.md"


def test_the_page_is_made_from_the_table() -> None:
    assert PAGE.read_text(encoding="utf-8") == page(), "run: python -m protocol.grbl.phases > docs/grbl-phases.md"


def test_run_as_a_program_it_prints_the_page(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delitem(sys.modules, "protocol.grbl.phases")  # runpy warns about a module that is imported already
    runpy.run_module("protocol.grbl.phases", run_name="__main__")
    assert capsys.readouterr().out == page()


def test_every_phase_has_a_step_can_be_reached_and_left() -> None:
    assert set(STEPS) == set(Phase)
    reached = {phase for step in STEPS.values() for phase in (step.then, step.on_silence)}
    reached |= {after for _, _, after in OUTCOMES}
    assert reached - {None} == set(Phase) - {Phase.OPENING}
    for phase, step in STEPS.items():
        left = step.then or step.on_silence or any(before is phase for before, _, _ in OUTCOMES)
        assert bool(left) == (phase is not Phase.CLOSED)


def test_answers_count_only_where_lines_are_sent() -> None:
    assert {phase for phase, step in STEPS.items() if step.counts} == {Phase.READING, Phase.READY, Phase.STOPPING}


def test_every_gate_that_a_state_shuts_is_in_the_table() -> None:
    assert set(SHUT_BY.values()) <= set(GATES)
