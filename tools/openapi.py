"""Writes docs/openapi.json, the OpenAPI document as the daemon serves it:  .venv/bin/python -m tools.openapi

Not the document's maker (server/api/openapi.py): that one's answer, with sorted keys and one value a line, so that a
change of the API is a change to read in a review. The one rule: nobody edits the file; a test compares it.
"""

import json
from pathlib import Path

from server.api.application import description

STORED = Path(__file__).parents[1] / "docs" / "openapi.json"
COMMAND = ".venv/bin/python -m tools.openapi"


def readable() -> str:
    """The document for people and for `git diff`."""
    return json.dumps(json.loads(description()), indent=1, sort_keys=True, ensure_ascii=False) + "\n"


if __name__ == "__main__":
    STORED.write_text(readable(), encoding="utf-8")
