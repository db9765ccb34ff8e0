"""The words of the dashboard: each language has the same keys and the same places for values, and no key is missing."""

import json
import re
from pathlib import Path

import pytest

from server.problems import CODES

WEB = Path(__file__).resolve().parents[2] / "web"
LANGUAGES = {path.stem: json.loads(path.read_text(encoding="utf-8")) for path in sorted((WEB / "i18n").glob("*.json"))}
SCRIPTS = [path for path in sorted(WEB.rglob("*.js")) if path.parent.name != "vendor"]
KEY = re.compile(r'"([a-z_]+(?:\.[a-z_-]+)+)"')
FAMILY = re.compile(r"`([a-z_]+(?:\.[a-z_]+)*\.)\$\{")
PLAIN = re.compile(r"\bt\(\"([^\"]+)\"")


def text() -> str:
    return "\n".join(path.read_text(encoding="utf-8") for path in SCRIPTS)


def test_there_are_the_three_languages() -> None:
    assert set(LANGUAGES) == {"en", "ru", "zh"}


@pytest.mark.parametrize("language", sorted(LANGUAGES))
def test_every_language_says_everything_with_the_same_values(language: str) -> None:
    def places(words: dict[str, str]) -> dict[str, list[str]]:
        return {key: sorted(re.findall(r"\{(\w+)\}", words[key])) for key in words}

    assert places(LANGUAGES[language]) == places(LANGUAGES["en"])
    assert all(word.strip() for word in LANGUAGES[language].values())


def test_what_the_pages_say_is_there() -> None:
    assert set(PLAIN.findall(text())) - set(LANGUAGES["en"]) == set()


def test_nothing_is_there_that_the_pages_never_say() -> None:
    code = text()
    said, families = set(KEY.findall(code)) | set(PLAIN.findall(code)), tuple(FAMILY.findall(code))
    assert [key for key in LANGUAGES["en"] if key not in said and not key.startswith(families)] == []


def test_every_status_has_its_word_its_picture_and_its_colour() -> None:
    """A state that somebody cannot read from three metres is a state that nobody has seen."""
    contract = ["offline", "idle", "run", "hold", "jog", "alarm", "home", "check", "door", "sleep", "tool"]
    icons = (WEB / "parts" / "icon.js").read_text()
    colours = "".join(path.read_text() for path in (WEB / "css").glob("*.css"))
    for status in [*contract, "connecting", "interrupted"]:
        assert f"status.{status}" in LANGUAGES["en"]
        assert re.search(rf"^\s*{status}: ", icons, re.MULTILINE), f"no icon of {status}"
        assert re.search(rf"\.s-{status}\b", colours), f"no colour of {status}"


def test_every_reason_for_a_hold_has_its_words_in_every_language() -> None:
    from jobs.holds import HOLD_CODES

    script = (WEB / "jobs" / "held.js").read_text(encoding="utf-8")
    plain, refused = (set(re.findall(r'"(\w+)"', text)) for text in re.findall(r"new Set\(\[(.*?)\]\)", script))
    assert plain == set(HOLD_CODES) - {"asked"}, "whoever asked for it knows why"
    assert refused <= set(CODES)
    for words in LANGUAGES.values():
        assert {key for key in words if key.startswith("held.")} == {f"held.{code}" for code in plain | refused}


def test_every_status_of_a_job_has_its_word() -> None:
    from jobs.job import Status

    assert {f"job.status.{status}" for status in Status} <= set(LANGUAGES["en"])
