"""What is done before anything is served, so that no request does it while machines are at work."""

import asyncio

import pytest
from anyio.lowlevel import current_token

from server.api import application
from tests.harness.fakeworkshop import FakeWorkshop
from tests.harness.simloop import run_simulated as run


def test_no_request_imports_what_could_be_imported_before(monkeypatch: pytest.MonkeyPatch) -> None:
    imported: list[str] = []
    monkeypatch.setattr(application, "import_module", imported.append)

    async def main() -> None:
        async with FakeWorkshop() as workshop, workshop.client():
            pass

    run(main())
    assert imported == list(application.LATE_IMPORTS)


def test_it_is_what_a_request_would_import() -> None:
    async def main() -> str:
        return current_token().backend_class.__module__

    assert [asyncio.run(main())] == list(application.LATE_IMPORTS)
