"""The table of phases: complete, and the page in docs/ made from it."""

import runpy
import sys
from pathlib import Path

import pytest

from protocol.ncframe.phases import OUTCOMES, STEPS, Phase, page

PAGE = Path(__file__).parents[3] / "docs" / "ncframe-phases.md"


def test_the_page_is_made_from_the_table() -> None:
    written = PAGE.read_text(encoding="utf-8")
    assert written == page(), "run: python -m protocol.ncframe.phases > docs/ncframe-phases.md"


def test_run_as_a_program_it_prints_the_page(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delitem(sys.modules, "protocol.ncframe.phases")  # runpy warns about a module that is imported already
    runpy.run_module("protocol.ncframe.phases", run_name="__main__")
    assert capsys.readouterr().out == page()


def test_every_phase_has_a_step_can_be_reached_and_left() -> None:
    assert set(STEPS) == set(Phase)
    reached = {phase for step in STEPS.values() for phase in (step.then, step.on_silence)}
    reached |= {after for _, _, after in OUTCOMES} | {Phase.GREET}
    assert reached - {None} == set(Phase) - {Phase.ABORT}  # an emergency stop leads there
    for phase, step in STEPS.items():
        left = step.then or step.on_silence or any(before is phase for before, _, _ in OUTCOMES)
        assert bool(left) == (phase is not Phase.CLOSED)


def test_counts_that_were_not_expected_are_said_twice() -> None:
    asks = {phase for phase, step in STEPS.items() if step.sends == "ENQ"}
    assert {STEPS[phase].agree for phase in asks} == {2}
