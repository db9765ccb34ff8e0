"""docs/operations.md against the code: every code has its advice, and what it says of the doctor is what that sends."""

import re

from jobs.job import ERROR_CODES
from server.doctor.ask import TRIES, Talk, ask
from server.problems import CODES
from server.store.restoring import OLD
from tests.harness.docs import ROOT, page, rows


def test_every_refusal_has_its_advice() -> None:
    table = rows(page("operations.md"), "refusal", "what to do")
    assert [row[0] for row in table] == list(CODES)
    assert all(row[1] for row in table)


def test_every_error_of_a_job_has_its_advice() -> None:
    table = rows(page("operations.md"), "job error", "what to do")
    assert [row[0] for row in table] == list(ERROR_CODES)
    assert all(row[1] for row in table)


def test_metrics_that_are_worth_an_alarm_exist() -> None:
    named = set(re.findall(r"\bmillstream_[a-z_]+", page("operations.md")))
    assert {name for name in named if f"`{name}`" not in page("metrics.md")} == set()


def test_messages_of_a_start_that_fails_are_those_of_the_code() -> None:
    folder = ROOT / "server"
    code = "".join(path.read_text(encoding="utf-8") for path in sorted(folder.rglob("*.py")))
    code = re.sub(r'"\s*f?"', "", code)
    for said in (
        "another millstream daemon works here",
        "a restore was broken off in the middle",
        "the database is gone, and there are programs of it",
        "others on the network can reach, and there is no token yet",
        "the database cannot be used: ",
    ):
        assert said in page("operations.md")
        assert said in code
    assert f"`{OLD}<time>`" in page("operations.md")


def test_what_the_doctor_sends_is_what_is_written() -> None:
    class Deaf:
        def say(self, data: bytes) -> None: ...

        def hear(self, seconds: float) -> bytes:
            return b""

    talk = Talk(Deaf())
    assert ask(talk) is None
    assert TRIES == 2, "`twice` in the text"
    assert talk.sent[:4] == [b"\x05", b"\x05", b"?", b"?"]
    assert all(data.endswith(b",ID<#1;READY;") for data in talk.sent[4:])
    assert len(set(talk.sent[4:])) == 4


def test_sections_name_every_way_to_install() -> None:
    text = page("operations.md")
    for name in ("Debian", "Ubuntu", "Raspberry Pi OS", "Windows", "Docker"):
        assert re.search(rf"^### .*{name}", text, re.MULTILINE)
