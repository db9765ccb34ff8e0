"""The table of phases: complete, and the page in docs/ made from it."""

import runpy
import sys
from pathlib import Path

import pytest

from protocol.elvinto.phases import OUTCOMES, STEPS, Phase, page

PAGE = Path(__file__).parents[3] / "docs" / "elvinto-phases.md"


def test_the_page_is_made_from_the_table():
    assert PAGE.read_text(encoding="utf-8") == page(), "run: python -m protocol.elvinto.phases > docs/elvinto-phases.md"


def test_run_as_a_program_it_prints_the_page(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch):
    monkeypatch.delitem(sys.modules, "protocol.elvinto.phases")  # runpy warns about a module that is imported already
    runpy.run_module("protocol.elvinto.phases", run_name="__main__")
    assert capsys.readouterr().out == page()


def test_every_phase_can_be_reached_and_left():
    reached = {step.then for step in STEPS.values()} | {step.on_silence for step in STEPS.values()}
    reached |= {after for _, _, after in OUTCOMES} | {Phase.INIT, Phase.PROBE}
    assert reached == set(Phase)
    left = set(STEPS) | {before for before, _, _ in OUTCOMES}
    assert left == set(Phase) - {Phase.CLOSED}


def test_every_phase_has_a_name_for_people():
    assert len({phase.value for phase in Phase}) == len(Phase)
