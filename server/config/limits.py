"""`[limits]` as a model: how much others may ask for at once. Not the obedience (room.py, socketlimit.py).

The largest upload and the longest queue are older and stand in `[server]`. The one rule: a limit that is reached is a
refusal which names its key, never a daemon that gets slower.
"""

from typing import Annotated

from pydantic import Field

from server.config.section import Section

GIB_BYTES = 1024**3
MIB_BYTES = 1024**2
MOST_BLOCKS = 100


class LimitsConfig(Section):
    """`[limits]`."""

    sockets: Annotated[int, Field(ge=1, le=480)] = 400
    sockets_per_address: Annotated[int, Field(ge=1, le=480)] = 200
    programs_bytes: Annotated[int, Field(ge=0, le=1024 * 1024 * GIB_BYTES)] = 0
    disk_reserve_bytes: Annotated[int, Field(ge=0, le=1024 * GIB_BYTES)] = 256 * MIB_BYTES
    blocks_per_command: Annotated[int, Field(ge=1, le=MOST_BLOCKS)] = MOST_BLOCKS
