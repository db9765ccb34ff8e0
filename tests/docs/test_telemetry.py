"""docs/telemetry.md against the code: every item that an agent is told, every word of EXECUTION."""

from server.outbound.shdr import _EXECUTION_BY_JOB, _EXECUTION_BY_STATE, Condition, Device
from tests.harness.docs import page, rows


def test_every_item_that_agents_are_told() -> None:
    table = rows(page("telemetry.md"), "item", "type of the standard", "what it is here")
    documented = {name for row in table for name in row[0].replace("...", "").strip(" ,").split(", ")}
    sent = Device(axes="x").items(emergency=False)
    assert documented == set(sent)
    conditions = {row[0] for row in table if row[1].startswith("condition ")}
    assert conditions == {name for name, value in sent.items() if isinstance(value, Condition)}


def test_every_word_of_execution() -> None:
    table = rows(page("telemetry.md"), "execution", "when")
    assert {row[0] for row in table} == {*_EXECUTION_BY_STATE.values(), *_EXECUTION_BY_JOB.values(), "READY"}
