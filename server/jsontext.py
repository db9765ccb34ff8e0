"""JSON as it leaves the daemon: ASCII, compact, never invalid.

Not a general serialiser: it takes what `json` takes. The one rule: what a machine says may hold any number and any
text, and must neither break a reader's parser (NaN is not JSON) nor raise in the middle of a stream.
"""

import json
import math
from typing import Any

_ENCODER = json.JSONEncoder(separators=(",", ":"), allow_nan=False)


def dumps(value: Any) -> str:
    """`value` as one line of JSON. Numbers that JSON has no word for (NaN, infinities) become null."""
    try:
        return _ENCODER.encode(value)
    except ValueError:
        return _ENCODER.encode(_finite(value))


def _finite(value: Any) -> Any:
    match value:
        case float() if not math.isfinite(value):
            return None
        case dict():
            return {key: _finite(item) for key, item in value.items()}
        case list() | tuple():
            return [_finite(item) for item in value]
        case _:
            return value
