"""The docs as data: tables of Markdown, and the pages themselves."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"


def page(name: str) -> str:
    """A page of docs/."""
    return (DOCS / name).read_text(encoding="utf-8")


def section(text: str, heading: str) -> str:
    """What stands under a heading, up to the next one of the same or a higher level."""
    level = heading.split(" ", 1)[0]
    start = text.index(f"\n{heading}\n") + len(heading) + 2
    following = re.search(rf"^#{{1,{len(level)}}} ", text[start:], re.MULTILINE)
    return text[start:] if following is None else text[start : start + following.start()]


def rows(text: str, *header: str) -> list[list[str]]:
    """The rows of the tables with this header, cell by cell, backquotes removed."""
    found: list[list[str]] = []
    inside = False
    for line in text.splitlines():
        cells = [cell.strip().replace("`", "") for cell in line.strip().strip("|").split(" | ")]
        if not line.startswith("|"):
            inside = False
        elif [cell.strip() for cell in line.replace("`", "").strip("|").split("|")] == list(header):
            inside = True
        elif inside and not re.fullmatch(r"[|\s-]+", line):
            found.append(cells)
    return found
