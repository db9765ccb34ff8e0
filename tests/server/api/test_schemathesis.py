"""The OpenAPI document against the whole daemon with a virtual machine: what it promises, schemathesis tries.

Values at random, the same in each run (and with --long all at the limits of each schema): no 5xx, no status, media type
or shape that is not in the document, no closed route without a token, nothing accepted that the document forbids and
nothing refused that it allows. Not what the routes do (the tests beside this one). The one rule: each operation begins
with a daemon that is fit, so what one of them did to it is not what another one fails by.
"""

import json
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("schemathesis", reason="*** SKIPPED: the OpenAPI document was NOT tried: no schemathesis here ***")

import requests
import schemathesis
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from schemathesis.core.parameters import ParameterLocation
from schemathesis.generation.modes import GenerationMode
from schemathesis.specs.openapi.checks import ignored_auth, positive_data_acceptance
from schemathesis.specs.openapi.coverage._operation import iter_coverage_cases

from server.api import create_app
from server.api.application import description
from tests.harness.asgihttp import AsgiAdapter
from tests.harness.effort import LONG, more
from tests.harness.simloop import SimLoop
from tests.harness.workshop import MACHINE, Bench

EXAMPLES = more(6)
"""Random values for each operation, after the ones at the limits."""
BASE_URL = "http://127.0.0.1:8420"
PROGRAM = "G21 G90\nG0 X1\nG1 X2 Y3 F600\nM30\n"


def described() -> Any:
    schema = schemathesis.openapi.from_dict(json.loads(description()))
    schema.config.update(base_url=BASE_URL)
    return schema


OPERATIONS = [result.ok() for result in described().get_all_operations()]


@dataclass
class Daemon:
    """One daemon with a connected machine, a program and a job; its tokens close it."""

    folder: Path
    loop: SimLoop = field(default_factory=SimLoop)

    def __post_init__(self) -> None:
        self.loop.run_until_complete(self._begin())
        self.session = requests.Session()
        self.session.trust_env = False
        self.session.mount("http://", AsgiAdapter(create_app(self.shop), self.loop, self.secret))
        self.signed = {"Authorization": f"Bearer {self.secret}"}

    def is_fit(self) -> bool:
        """Connected, without an alarm, and with its program."""
        machine = self.shop.machines[MACHINE]
        if machine.link_status != "connected" or machine.state_view()["status"] != "idle":
            return False
        programs = self.loop.run_until_complete(self.shop.programs.list())
        return any(program["id"] == self.places["/programs/{id}"] for program in programs)

    async def _begin(self) -> None:
        bench = Bench(self.folder)
        self.shop = await bench.connected()
        self.secret = (await self.shop.tokens.create("tool", "admin"))["token"]
        job = await bench.job(PROGRAM, hold=True)
        self.places = {"/machines/{m}": MACHINE, "/programs/{id}": job["program"], "/jobs/{id}": job["id"]}

    def aim(self, case: schemathesis.Case) -> None:
        """At what is there: a name made up leads to 404 and no further. Wrong ones stay as they are."""
        if case.meta is not None and case.meta.is_negative_at(ParameterLocation.PATH):
            return
        for path, name in self.places.items():
            if path in case.path:
                case.path_parameters[path[path.index("{") + 1 : -1]] = name

    def close(self) -> None:
        self.loop.run_until_complete(self.shop.stop())
        self.session.close()
        self.loop.close()


class Daemons:
    """The daemon that is there, or another one where an operation has spoilt it."""

    def __init__(self, make_folder: Callable[[], Path]) -> None:
        self._make_folder = make_folder
        self._daemon: Daemon | None = None

    def fit(self) -> Daemon:
        if self._daemon is not None and not self._daemon.is_fit():
            self.close()
        self._daemon = self._daemon or Daemon(self._make_folder())
        return self._daemon

    def close(self) -> None:
        if self._daemon is not None:
            self._daemon.close()
            self._daemon = None


@pytest.fixture(scope="module")
def daemons(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemons]:
    made = Daemons(lambda: tmp_path_factory.mktemp("daemon"))
    yield made
    made.close()


def told_in_words(problem: dict[str, Any]) -> bool:
    """A refusal by what a schema cannot say: a rule between fields, or one of the service's own in a sentence."""
    errors = problem.get("errors", ())
    return not errors or any(error["field"] == "body" for error in errors)


def tried(daemon: Daemon, case: schemathesis.Case) -> None:
    daemon.aim(case)
    answer = case.call(session=daemon.session, headers=daemon.signed)
    excluded = [ignored_auth]  # it would ask over the network: see below
    if answer.status_code == 422 and told_in_words(answer.json()):
        excluded.append(positive_data_acceptance)
    case.validate_response(answer, excluded_checks=excluded)


@pytest.mark.parametrize("operation", OPERATIONS, ids=lambda operation: operation.label)
def test_the_daemon_keeps_what_the_document_says(operation: Any, daemons: Daemons) -> None:
    daemon = daemons.fit()

    @settings(
        max_examples=EXAMPLES,
        derandomize=True,
        database=None,
        deadline=None,
        phases=[Phase.generate],  # a smaller case would meet a daemon that the larger ones have changed
        suppress_health_check=list(HealthCheck),
        report_multiple_bugs=False,
    )
    @given(case=st.one_of([operation.as_strategy(generation_mode=mode) for mode in modes(operation)]))
    def each(case: schemathesis.Case) -> None:
        tried(daemon, case)

    each()


def modes(operation: Any) -> list[GenerationMode]:
    """What is against the document can only be said where there is something to say."""
    return list(GenerationMode) if operation.body or operation.query else [GenerationMode.POSITIVE]


@pytest.mark.parametrize("token", [None, "wrong"])
def test_what_is_closed_is_closed(token: str | None, daemons: Daemons) -> None:
    daemon = daemons.fit()
    headers = {} if token is None else {"Authorization": f"Bearer {token}"}
    for operation in OPERATIONS:
        role = operation.definition.raw["x-required-role"]
        path = re.sub(r"\{[^}]*\}", "1", operation.path)
        answer = daemon.session.request(operation.method.upper(), BASE_URL + path, headers=headers)
        assert (answer.status_code == 401) == (role != "public")


@pytest.mark.skipif(not LONG, reason="all values at and past the limits of all schemas: --long")
@pytest.mark.parametrize("operation", OPERATIONS, ids=lambda operation: operation.label)
def test_values_at_the_limits(operation: Any, daemons: Daemons) -> None:
    for case in iter_coverage_cases(
        operation=operation,
        generation_modes=list(GenerationMode),
        generate_duplicate_query_parameters=False,
        unexpected_methods={"TRACE"},
        generation_config=operation.schema.config.generation,
    ):
        tried(daemons.fit(), case)
