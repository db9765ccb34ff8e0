"""What the machine executes: a batch of blocks from the wire, or a file on the SD card (standard §4).

Not how: that is executor.py. The one rule: blocks are handed out one by one, so that whoever runs them stops where an
error, an alarm or the end of the program stands.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from sim.elvinto.gcode import ERR_NO_CARD, ERR_NO_FILE, QUERIES, BlockError, sd_blocks
from sim.elvinto.settings import SimSettings


def only_queries(blocks: Iterable[str]) -> bool:
    """Nothing in it moves or changes anything."""
    return all(block.upper() in QUERIES for block in blocks)


@dataclass(frozen=True, slots=True)
class Command:
    """A batch, or a file on the card. `quiet`: nothing but queries, so STATE goes on saying idle."""

    id: int
    blocks: Iterator[str]
    from_card: bool = False
    quiet: bool = False

    @classmethod
    def batch(cls, command_id: int, blocks: list[str]) -> "Command":
        """GCODE,DATA."""
        return cls(command_id, iter(blocks), quiet=only_queries(blocks))

    @classmethod
    def file(cls, command_id: int, name: bytes, settings: SimSettings) -> "Command":
        """RUN,NAME. Raises BlockError when there is no card that can be read, or no such file on it."""
        if settings.sd_files is None or settings.sd_fs != "FAT":
            raise BlockError(ERR_NO_CARD)
        content = settings.sd_files.get(name.decode(settings.encoding, errors="replace"))
        if content is None:
            raise BlockError(ERR_NO_FILE)
        return cls(command_id, sd_blocks(content, settings.encoding), from_card=True)
