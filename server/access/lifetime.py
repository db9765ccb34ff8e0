"""How long a token lives, as people write it: `90d`, `12h`, `2w`. Not the token (tokens.py).

The one rule: a length of time is written with its unit, for a bare number would be read as days by one and as seconds
by the next.
"""

import re
from datetime import timedelta

UNITS = {"m": timedelta(minutes=1), "h": timedelta(hours=1), "d": timedelta(days=1), "w": timedelta(weeks=1)}
LONGEST = timedelta(days=3650)
"""Ten years: whoever wants more leaves it out."""
ALLOWED = "a number and one of m, h, d, w (minutes, hours, days, weeks), e.g. 90d; ten years at most"


def lifetime(text: str) -> timedelta:
    """The length of time that `text` says. Raises ValueError, which says what is allowed."""
    found = re.fullmatch(r"([1-9][0-9]{0,6})([mhdw])", text.strip().lower(), re.ASCII)
    if found is None or (length := int(found[1]) * UNITS[found[2]]) > LONGEST:
        raise ValueError(f"{text[:40]!r} is no lifetime of a token: {ALLOWED}")
    return length
