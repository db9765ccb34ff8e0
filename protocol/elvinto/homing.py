"""Whether blocks by hand have led the machine to its limit switches, so that it knows again where it stands.

Not the motion itself. The one rule: it counts as homed only when it is certain; a G28 that the machine was told to
ignore (W93, elvinto §6) leads nowhere.
"""

import re
from collections.abc import Iterable

_WORD = re.compile(r"(?<![A-Z0-9.])(?:G0*(28|29)|W0*(93|94))(?![0-9.])", re.IGNORECASE)


def homing(blocks: Iterable[str], *, ignored: bool) -> tuple[bool, bool]:
    """Whether these blocks have homed the machine, and whether it ignores G28 behind them as it did (`ignored`)
    before. G27 homes only the first time since power-on, which nobody here knows."""
    homed = False
    for block in blocks:
        for found in _WORD.finditer(block):
            if found[2] is not None:
                ignored = int(found[2]) == 93
            elif not ignored:
                homed = True
    return homed, ignored
