"""Lines of a stored program in any order, as an expansion asks for them: forwards, and back again in loops and calls.

Not the index (program.py), which finds where to begin. The one rule: memory stays constant; what is not kept is read
again.
"""

from collections import OrderedDict
from collections.abc import Callable, Iterator
from itertools import islice

BLOCK_LINES = 64
"""Read and forgotten together. A block of the longest lines that there can be is 16 MB."""
KEPT_BYTES = 8 * 1024 * 1024
"""Of blocks that are kept: a hundred thousand usual lines, which hold the inside of any loop. At least one is kept."""

Lines = Iterator[tuple[int, bytes]]


class LineAccess:
    """A program of `count` lines (gcode.expand.structure.Program). `lines_from` reads on from a line.

    Raises what that raises, as when the program is deleted meanwhile. For one thread.
    """

    def __init__(self, count: int, lines_from: Callable[[int], Lines]) -> None:
        self.count = count
        self._lines_from = lines_from
        self._kept: OrderedDict[int, list[bytes]] = OrderedDict()
        self._bytes = 0
        self._ahead: Lines | None = None
        self._next_block = 0

    def line(self, number: int) -> bytes | None:
        """Line `number`, from 1, without its end; None where there is none."""
        if not 1 <= number <= self.count:
            return None
        block, row = divmod(number - 1, BLOCK_LINES)
        lines = self._kept.get(block)
        if lines is None:
            lines = self._read(block)
        else:
            self._kept.move_to_end(block)
        return lines[row] if row < len(lines) else None

    def _read(self, block: int) -> list[bytes]:
        if self._ahead is None or self._next_block != block:
            self._ahead = self._lines_from(block * BLOCK_LINES + 1)
        lines = [raw for _, raw in islice(self._ahead, BLOCK_LINES)]
        self._next_block = block + 1
        self._kept[block] = lines
        self._bytes += sum(map(len, lines))
        while self._bytes > KEPT_BYTES and len(self._kept) > 1:
            _, gone = self._kept.popitem(last=False)
            self._bytes -= sum(map(len, gone))
        return lines
