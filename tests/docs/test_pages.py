"""The pages as a whole: links lead somewhere, and the reading tour is up to date."""

import re
from pathlib import Path

import pytest

from tests.harness.docs import DOCS, ROOT, page

PAGES = [ROOT / "README.md", ROOT / "CHANGELOG.md", *sorted(DOCS.glob("*.md"))]
LINK = re.compile(r"\[[^\]]*\]\(([^)]+)\)")


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.name)
def test_links_lead_to_files_that_exist(path: Path) -> None:
    targets = [target.partition("#")[0] for target in LINK.findall(path.read_text(encoding="utf-8"))]
    dead = [target for target in targets if "://" not in target and not (path.parent / target).exists()]
    assert dead == []


def test_every_page_can_be_reached_from_the_readme() -> None:
    seen: set[Path] = set()
    waiting = [ROOT / "README.md"]
    while waiting:
        path = waiting.pop()
        if path in seen or path.suffix != ".md":
            continue
        seen.add(path)
        targets = [target.partition("#")[0] for target in LINK.findall(path.read_text(encoding="utf-8"))]
        waiting += [(path.parent / target).resolve() for target in targets if "://" not in target]
    assert {path.name for path in DOCS.glob("*.md")} <= {path.name for path in seen}


def test_the_life_of_a_line_names_files_that_exist() -> None:
    named = re.findall(r"(?<!tests/)\b(?:server|jobs|gcode|protocol|sim)/[a-z_/]+\.py\b", page("overview.md"))
    assert len(named) > 20
    assert [name for name in named if not (ROOT / name).is_file()] == []
