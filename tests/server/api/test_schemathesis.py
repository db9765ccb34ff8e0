"""The OpenAPI document against the whole daemon with each kind of virtual machine: schemathesis tries what it promises.

Values at random, the same in each run (and with --long all at the limits of each schema): no 5xx but where a machine
does not answer, no status, code, media type or shape that is not in the document, no closed route without a token,
nothing accepted that the document forbids and nothing refused that it allows. Not what the routes do (the tests beside
this one). The one rule: each operation begins with a daemon that is fit, so what one of them did to it is not what
another one fails by. Only `test_any_order` mends nothing; it judges what is promised of every answer.
"""

import json
import re
from collections.abc import Iterator
from contextlib import closing
from functools import cache
from typing import Any

import pytest

pytest.importorskip("schemathesis", reason="*** SKIPPED: the OpenAPI document was NOT tried: no schemathesis here ***")

import schemathesis
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from schemathesis.checks import not_a_server_error
from schemathesis.core.parameters import ParameterLocation
from schemathesis.generation.modes import GenerationMode
from schemathesis.specs.openapi.checks import ignored_auth, negative_data_rejection, positive_data_acceptance
from schemathesis.specs.openapi.coverage._operation import iter_coverage_cases

from server.api.application import description
from tests.harness.apidaemon import BASE_URL, KINDS, Daemon, Daemons
from tests.harness.effort import LONG, more

EXAMPLES = more(6)
"""Random values for each operation, after the ones at the limits."""
EXAMPLES_ELSEWHERE = more(2)
"""On the other machines: what depends on values is the same code, what depends on the machine needs few."""
ORDERS, STEPS = more(1), 30
"""Of `test_any_order`: days of an operator who presses what he likes, and how often he presses."""
AWAY = ("/disconnect", "/estop")
"""Not pressed there: each ends the day at once."""


def described() -> Any:
    schema = schemathesis.openapi.from_dict(json.loads(description()))
    schema.config.update(base_url=BASE_URL)
    return schema


OPERATIONS = [result.ok() for result in described().get_all_operations()]
OF_A_MACHINE = [one for one in OPERATIONS if re.search(r"/machines/|/jobs|/check|/toolpath", one.path)]
"""What the kind of machine behind them decides; the others need not be tried with each."""


@pytest.fixture(scope="module")
def daemons(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemons]:
    made = Daemons(lambda: tmp_path_factory.mktemp("daemon"))
    yield made
    made.close()


@cache
def cases(number: int) -> st.SearchStrategy[schemathesis.Case]:
    """For an operation: making one takes longer than what it makes."""
    operation = OPERATIONS[number]
    return st.one_of([operation.as_strategy(generation_mode=mode) for mode in modes(operation)])


def aim(daemon: Daemon, case: schemathesis.Case) -> None:
    """At what is there: a name made up leads to 404 and no further. Wrong ones stay as they are."""
    if case.meta is not None and case.meta.is_negative_at(ParameterLocation.PATH):
        return
    for path, name in daemon.places.items():
        if path in case.path:
            case.path_parameters[path[path.index("{") + 1 : -1]] = name


IN_THE_SCHEMA = ("body.", "query.", "path.", "header.")
"""Fields that the document describes; a setting's number in `values` is judged by the controller's kind."""


NOT_WHOLE = "a whole number is needed, not a decimal number"
"""8.0 is an integer to a JSON schema, but not to us."""


def told_in_words(problem: dict[str, Any]) -> bool:
    """A refusal by what a schema cannot say: a rule between fields, or one of the service's own in a sentence."""
    errors = problem.get("errors", ())
    in_the_schema = [error for error in errors if error["field"].startswith(IN_THE_SCHEMA)]
    return len(in_the_schema) < max(len(errors), 1) or all(error["message"] == NOT_WHOLE for error in in_the_schema)


def is_documented(case: schemathesis.Case, status: int, code: str) -> bool:
    """Whether the document names this code for this status of this operation."""
    answers = case.operation.definition.raw["responses"].get(str(status), {})
    named = answers.get("content", {}).get("application/problem+json", {}).get("examples", {})
    return code in named


def tried(daemon: Daemon, case: schemathesis.Case, *, in_order: bool = True) -> None:
    aim(daemon, case)
    answer = case.call(session=daemon.session, headers=daemon.signed)
    if case.method.upper() != case.operation.method.upper():  # a method that the address does not take
        assert (answer.status_code, answer.json()["code"]) == (405, "method_not_allowed")
        return
    excluded = [ignored_auth]  # it would ask over the network: see below
    refused = answer.status_code >= 400
    if not in_order or (answer.status_code == 422 and told_in_words(answer.json())):
        excluded.append(positive_data_acceptance)
    if answer.status_code == 504:
        assert answer.json()["code"] == "no_answer"
        excluded.append(not_a_server_error)
    if answer.status_code == 413:
        excluded.append(negative_data_rejection)  # it is refused, and before it is read
    case.validate_response(answer, excluded_checks=excluded)
    if refused and answer.headers.get("content-type") == ["application/problem+json"]:
        assert is_documented(case, answer.status_code, answer.json()["code"]), (case.operation.label, answer.text)


def tried_with(kind: str, number: int, examples: int, daemons: Daemons) -> None:
    daemon = daemons.fit(kind)

    @settings(
        max_examples=examples,
        derandomize=True,
        database=None,
        deadline=None,
        phases=[Phase.generate],  # a smaller case would meet a daemon that the larger ones have changed
        suppress_health_check=list(HealthCheck),
        report_multiple_bugs=False,
    )
    @given(case=cases(number))
    def each(case: schemathesis.Case) -> None:
        tried(daemon, case)

    each()


@pytest.mark.parametrize("number", range(len(OPERATIONS)), ids=[one.label for one in OPERATIONS])
def test_the_daemon_keeps_what_the_document_says(number: int, daemons: Daemons) -> None:
    tried_with("elvinto", number, EXAMPLES, daemons)


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "elvinto"])
def test_so_does_one_with_another_machine(kind: str, daemons: Daemons) -> None:
    for number, operation in enumerate(OPERATIONS):
        if LONG or operation in OF_A_MACHINE:
            tried_with(kind, number, EXAMPLES_ELSEWHERE, daemons)


@pytest.mark.parametrize("kind", KINDS)
def test_any_order(kind: str, daemons: Daemons) -> None:
    """Whatever was asked before, and however long ago: no answer but those of the document."""
    numbers = [
        number for number, one in enumerate(OPERATIONS) if one in OF_A_MACHINE and not one.path.endswith(tuple(AWAY))
    ]

    @settings(
        max_examples=ORDERS,
        derandomize=True,
        database=None,
        deadline=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
        report_multiple_bugs=False,
    )
    @given(data=st.data())
    def day(data: st.DataObject) -> None:
        with closing(daemons.fresh(kind)) as daemon:
            for _ in range(STEPS):
                number = data.draw(st.sampled_from(numbers))
                tried(daemon, data.draw(cases(number)), in_order=False)
                daemon.passes(data.draw(st.sampled_from([0.0, 0.0, 0.3, 5.0])))

    day()


def modes(operation: Any) -> list[GenerationMode]:
    """What is against the document can only be said where there is something to say."""
    return list(GenerationMode) if operation.body or operation.query else [GenerationMode.POSITIVE]


@pytest.mark.parametrize("token", [None, "wrong"])
def test_what_is_closed_is_closed(token: str | None, daemons: Daemons) -> None:
    daemon = daemons.fit("elvinto")
    headers = {} if token is None else {"Authorization": f"Bearer {token}"}
    for operation in OPERATIONS:
        role = operation.definition.raw["x-required-role"]
        path = re.sub(r"\{[^}]*\}", "1", operation.path)
        answer = daemon.session.request(operation.method.upper(), BASE_URL + path, headers=headers)
        assert (answer.status_code == 401) == (role != "public")


@pytest.mark.skipif(not LONG, reason="all values at and past the limits of all schemas: --long")
@pytest.mark.parametrize("operation", OPERATIONS, ids=lambda operation: operation.label)
def test_values_at_the_limits(operation: Any, daemons: Daemons) -> None:
    for kind in KINDS:
        for case in iter_coverage_cases(
            operation=operation,
            generation_modes=list(GenerationMode),
            generate_duplicate_query_parameters=False,
            unexpected_methods={"TRACE"},
            generation_config=operation.schema.config.generation,
        ):
            tried(daemons.fit(kind), case)
